#include "map/voxel_average.h"

#include <algorithm>
#include <bitset>
#include <cmath>
#include <stdexcept>
#include <vector>

#include "map/voxel_key.h"

namespace raceloc {

namespace {

constexpr double kEdge = 4;  // of a block, in voxels

}  // namespace

VoxelAverage::VoxelAverage(double voxel_size_m) : x_voxel_m(voxel_size_m) {
  if (!(voxel_size_m > 0)) throw std::invalid_argument("VoxelAverage: the voxel's edge must be > 0");
}

void VoxelAverage::add(const Cloud& cloud_map) {
  std::pair<const std::uint64_t, Block>* last = nullptr;
  for (std::size_t i = 0; i < cloud_map.size(); ++i) {
    const Eigen::Vector3d p = cloud_map.point(i).cast<double>();
    const Eigen::Vector3d index = (p / x_voxel_m).array().floor();
    const Eigen::Vector3d block = (index / kEdge).array().floor();
    const auto key = voxelKey(block);
    if (!key) continue;
    if (last == nullptr || last->first != *key) last = &*x_blocks.try_emplace(*key).first;
    const Eigen::Vector3i at = (index - kEdge * block).cast<int>();
    Block& here = last->second;
    const std::uint64_t bit = std::uint64_t{1} << static_cast<unsigned>((at.z() * 4 + at.y()) * 4 + at.x());
    const auto place =
        here.cells.begin() + static_cast<std::ptrdiff_t>(std::bitset<64>(here.held & (bit - 1)).count());
    Cell& cell = (here.held & bit) != 0 ? *place : *here.cells.insert(place, Cell{});
    here.held |= bit;
    cell.sum_m += (p - x_voxel_m * index).cast<float>();
    ++cell.points;
  }
}

Cloud VoxelAverage::cloud() const {
  std::vector<const std::pair<const std::uint64_t, Block>*> blocks;
  blocks.reserve(x_blocks.size());
  for (const auto& block : x_blocks) blocks.push_back(&block);
  std::sort(blocks.begin(), blocks.end(), [](const auto* a, const auto* b) { return a->first < b->first; });
  Cloud cloud;
  for (const auto* block : blocks) {
    std::uint64_t left = block->second.held;
    for (const Cell& cell : block->second.cells) {
      const auto at = static_cast<int>(std::bitset<64>((left & ~(left - 1)) - 1).count());
      left &= left - 1;
      const Eigen::Vector3d index =
          kEdge * voxelIndex(block->first) + Eigen::Vector3i(at % 4, at / 4 % 4, at / 16).cast<double>();
      cloud.push(
          (x_voxel_m * index + (cell.sum_m / static_cast<float>(cell.points)).cast<double>()).cast<float>());
    }
  }
  return cloud;
}

}  // namespace raceloc
