#include "map/voxel_average.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <vector>

namespace raceloc {

namespace {

constexpr std::int64_t kBias = 1 << 20, kMask = (1 << 21) - 1;  // 21 bits an axis

std::uint64_t keyOf(const Eigen::Vector3d& cell) {
  const auto bits = [](double index) {
    return static_cast<std::uint64_t>((static_cast<std::int64_t>(index) + kBias) & kMask);
  };
  return bits(cell.z()) << 42U | bits(cell.y()) << 21U | bits(cell.x());
}
Eigen::Vector3d cellOf(std::uint64_t key) {
  const auto index = [key](unsigned shift) {
    return static_cast<double>(static_cast<std::int64_t>(key >> shift & kMask) - kBias);
  };
  return {index(0), index(21), index(42)};
}

}  // namespace

VoxelAverage::VoxelAverage(double voxel_size_m) : x_voxel_m(voxel_size_m) {
  if (!(voxel_size_m > 0)) throw std::invalid_argument("VoxelAverage: the voxel's edge must be > 0");
}

void VoxelAverage::add(const Cloud& cloud_map) {
  for (std::size_t i = 0; i < cloud_map.size(); ++i) {
    const Eigen::Vector3d p = cloud_map.point(i).cast<double>();
    const Eigen::Vector3d index = (p / x_voxel_m).array().floor();
    if (!(index.array().abs() < kBias).all()) continue;  // NaN too: maxCoeff() may overlook one
    Cell& cell = x_cells[keyOf(index)];
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
    cloud.push((x_voxel_m * cellOf(key) + (cell.sum_m / static_cast<float>(cell.points)).cast<double>())
                   .cast<float>());
  }
  return cloud;
}

}  // namespace raceloc
