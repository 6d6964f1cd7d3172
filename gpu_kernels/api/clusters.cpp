#include "raceloc/gpu/clusters.h"

#include <cmath>
#include <utility>

#include "api/check.hpp"
#include "core/backend.hpp"

namespace raceloc::gpu {

std::vector<std::int32_t> clusters(Context& context, const PointsView& points, float radius_m,
                                   std::vector<std::int32_t> into) {
  requirePositive("radius_m", radius_m);
  requireCountable(points.size);
  for (const float* axis : {points.x, points.y, points.z})
    for (std::size_t i = 0; i < points.size; ++i)
      require(std::isfinite(axis[i]), "coordinate of a point", axis[i], "finite");
  return context.implementation().clusters(points, radius_m, std::move(into));
}

}  // namespace raceloc::gpu
