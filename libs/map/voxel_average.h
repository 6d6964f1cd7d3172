/** \file
 * One point a voxel, over any number of scans. */
#pragma once

#include <cstdint>
#include <unordered_map>
#include <vector>

#include "core/types.h"

namespace raceloc {

/** Means of all points that fell into a voxel: memory grows with the map, not with the scans. Voxels are kept in
 * blocks of 4 x 4 x 4, which points of a scan that follow each other often share. */
class VoxelAverage {
 public:
  /** \throws std::invalid_argument if the edge is not > 0. */
  explicit VoxelAverage(double voxel_size_m);

  /** Points that are not finite or 2^22 voxels away are passed over. \param cloud_map  map frame [m] */
  void add(const Cloud& cloud_map);

  /** Block by block, by z, then y, then x, and so within each; without intensity. */
  [[nodiscard]] Cloud cloud() const;

 private:
  struct Cell {
    Eigen::Vector3f sum_m = Eigen::Vector3f::Zero();  ///< from the voxel's corner
    std::uint32_t points = 0;
  };
  struct Block {
    std::uint64_t held = 0;   ///< a bit for each voxel that has points
    std::vector<Cell> cells;  ///< of those
  };
  double x_voxel_m;
  std::unordered_map<std::uint64_t, Block> x_blocks;
};

}  // namespace raceloc
