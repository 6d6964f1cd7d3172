#include "cloud/voxel_grid.h"

#include <raceloc/gpu/voxel_grid.h>

#include <utility>

#include "cloud/covariances.h"

namespace raceloc {

Cloud voxelGrid(gpu::Context& context, const Cloud& cloud, double voxel_size_m, Cloud into) {
  auto points = gpu::voxelGrid(context, viewOf(cloud), static_cast<float>(voxel_size_m), nullptr,
                               {std::move(into.x), std::move(into.y), std::move(into.z)});
  return {std::move(points.x), std::move(points.y), std::move(points.z), {}};
}

}  // namespace raceloc
