#include "raceloc/gpu/covariance.h"

#include <utility>

#include "api/check.hpp"
#include "core/backend.hpp"

namespace raceloc::gpu {

Covariances covariances(Context& context, const PointsView& points, const CovarianceOptions& options,
                        Covariances into) {
  requireGood(options);
  requireCountable(points.size);
  for (std::size_t i = 0; i < points.size; ++i) {
    if (!std::isfinite(points.x[i]) || !std::isfinite(points.y[i]) || !std::isfinite(points.z[i]))
      throw std::invalid_argument("covariances: point " + std::to_string(i) + " is not finite");
  }
  if (options.neighbourhood == Neighbourhood::nearest && context.backend() == Backend::cuda)
    return makeCpuBackend(1)->covariances(points, options, std::move(into));
  return context.implementation().covariances(points, options, std::move(into));
}

}  // namespace raceloc::gpu
