#include "raceloc/gpu/voxel_map.h"

#include "api/check.hpp"
#include "api/voxel_map_storage.hpp"

namespace raceloc::gpu {

VoxelMap::VoxelMap(Context& context, double voxel_size_m) {
  requirePositive("voxel_size_m", voxel_size_m);
  x_storage = std::make_unique<Storage>(voxel_size_m, context.implementation().mirror());
}

VoxelMap::VoxelMap(double voxel_size_m) {
  requirePositive("voxel_size_m", voxel_size_m);
  x_storage = std::make_unique<Storage>(voxel_size_m, nullptr);
}

VoxelMap::~VoxelMap() = default;
VoxelMap::VoxelMap(VoxelMap&&) noexcept = default;
VoxelMap& VoxelMap::operator=(VoxelMap&&) noexcept = default;

void VoxelMap::bringTo(Context& context) { x_storage->bringTo(context.implementation().mirror()); }

std::size_t VoxelMap::insert(const PointsView& points, const CovariancesView& covariances,
                             const Transform& T_map_points) {
  requireSameSize(points, covariances);
  return x_storage->changed(
      [&](VoxelTable& table) { return table.insert(points, covariances, T_map_points); });
}

std::size_t VoxelMap::fill(const PointsView& points, const CovariancesView& covariances,
                           const Transform& T_map_points) {
  requireSameSize(points, covariances);
  return x_storage->changed(
      [&](VoxelTable& table) { return table.insert(points, covariances, T_map_points, Into::empty); });
}

std::size_t VoxelMap::keepWithin(const std::array<double, 3>& centre_m, double distance_m) {
  return x_storage->changed([&](VoxelTable& table) { return table.keepWithin(centre_m, distance_m); });
}

std::size_t VoxelMap::keepNewest(std::size_t voxels) {
  return x_storage->changed([&](VoxelTable& table) { return table.keepNewest(voxels); });
}

std::size_t VoxelMap::size() const { return x_storage->table().records().size(); }
double VoxelMap::voxelSize() const { return x_storage->table().voxelSize(); }
VoxelGaussians VoxelMap::contents() const { return x_storage->table().contents(); }

}  // namespace raceloc::gpu
