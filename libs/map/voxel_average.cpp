#include "map/voxel_average.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <vector>

#include "map/voxel_key.h"

namespace raceloc {

VoxelAverage::VoxelAverage(double voxel_size_m) : x_voxel_m(voxel_size_m) {
  if (!(voxel_size_m > 0)) throw std::invalid_argument("VoxelAverage: the voxel's edge must be > 0");
}

void VoxelAverage::add(const Cloud& cloud_map) {
  for (std::size_t i = 0; i < cloud_map.size(); ++i) {
    const Eigen::Vector3d p = cloud_map.point(i).cast<double>();
    const Eigen::Vector3d index = (p / x_voxel_m).array().floor();
    const auto key = voxelKey(index);
    if (!key) continue;
    Cell& cell = x_cells[*key];
    cell.sum_m += (p - x_voxel_m * index).cast<float>();
    ++cell.points;
  }
}

Cloud VoxelAverage::cloud() const {
  std::vector<std::uint64_t> keys;
  keys.reserve(x_cells.size());
  for (const auto& entry : x_cells) keys.push_back(entry.first);
  std::sort(keys.begin(), keys.end());
  Cloud cloud;
  cloud.reserve(keys.size());
  for (const std::uint64_t key : keys) {
    const Cell& cell = x_cells.at(key);
    cloud.push((x_voxel_m * voxelIndex(key) + (cell.sum_m / static_cast<float>(cell.points)).cast<double>())
                   .cast<float>());
  }
  return cloud;
}

}  // namespace raceloc
