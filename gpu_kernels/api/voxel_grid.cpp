#include "raceloc/gpu/voxel_grid.h"

#include <utility>

#include "api/check.hpp"
#include "core/backend.hpp"

namespace raceloc::gpu {

Points voxelGrid(Context& context, const PointsView& points, float voxel_size_m, std::size_t* dropped,
                 Points into) {
  requirePositive("voxel_size_m", voxel_size_m);
  requireCountable(points.size);
  std::size_t lost = 0;
  into = context.implementation().voxelGrid(points, static_cast<double>(voxel_size_m), lost, std::move(into));
  if (dropped != nullptr) *dropped = lost;
  return into;
}

}  // namespace raceloc::gpu
