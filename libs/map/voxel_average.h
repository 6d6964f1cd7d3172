/** \file
 * One point a voxel, over any number of scans. */
#pragma once

#include <cstdint>
#include <unordered_map>

#include "core/types.h"

namespace raceloc {

/** Means of all points that fell into a voxel: memory grows with the map, not with the scans. */
class VoxelAverage {
 public:
  /** \throws std::invalid_argument if the edge is not > 0. */
  explicit VoxelAverage(double voxel_size_m);

  /** Points that are not finite or 2^20 voxels away are passed over. \param cloud_map  map frame [m] */
  void add(const Cloud& cloud_map);

  [[nodiscard]] std::size_t size() const { return x_cells.size(); }
  /** Voxel by voxel, by z, then y, then x; without intensity. */
  [[nodiscard]] Cloud cloud() const;

 private:
  struct Cell {
    Eigen::Vector3f sum_m = Eigen::Vector3f::Zero();  ///< from the voxel's corner
    std::uint32_t points = 0;
  };
  double x_voxel_m;
  std::unordered_map<std::uint64_t, Cell> x_cells;
};

}  // namespace raceloc
