/** \file
 * Downsampling on points sorted by voxel: each run of equal keys becomes its centroid. */
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>

#include "core/cell.hpp"
#include "core/linear.hpp"
#include "raceloc/gpu/types.h"

namespace raceloc::gpu {

/** What a cloud looks like to the voxel grid. */
struct VoxelExtent {
  KeyLayout layout;
  std::size_t kept = 0;  ///< points with a voxel
};

/** One reading of the cloud: the box of the voxels that are occupied. */
inline VoxelExtent voxelExtent(const PointsView& p, double voxel_size_m) {
  VoxelExtent extent;
  Cell low{kCellLimit, kCellLimit, kCellLimit}, high{-kCellLimit, -kCellLimit, -kCellLimit}, c{};
  for (std::size_t i = 0; i < p.size; ++i) {
    if (!cellOf(p.x[i], p.y[i], p.z[i], voxel_size_m, c)) continue;
    low = {std::min(low.x, c.x), std::min(low.y, c.y), std::min(low.z, c.z)};
    high = {std::max(high.x, c.x), std::max(high.y, c.y), std::max(high.z, c.z)};
    ++extent.kept;
  }
  if (extent.kept > 0) extent.layout = KeyLayout::of(low, high);
  return extent;
}

/** Key of a point's voxel; a point without one gets the key after all others, 2^bits. */
RACELOC_HD std::uint64_t voxelKey(const KeyLayout& layout, double voxel_size_m, float x, float y, float z) {
  Cell c{};
  return cellOf(x, y, z, voxel_size_m, c) ? layout.key(c) : std::uint64_t{1} << layout.bits;
}

/** Sums of a voxel's points in double and in the order of the cloud: the same bits on every device. */
struct CentroidSum {
  double x = 0, y = 0, z = 0;
  std::size_t points = 0;

  RACELOC_HD void add(const PointsView& p, std::size_t i) {
    x += static_cast<double>(p.x[i]);
    y += static_cast<double>(p.y[i]);
    z += static_cast<double>(p.z[i]);
    ++points;
  }
  [[nodiscard]] RACELOC_HD Vec3<float> centroid() const {
    const auto n = static_cast<double>(points);
    return {static_cast<float>(x / n), static_cast<float>(y / n), static_cast<float>(z / n)};
  }
};

}  // namespace raceloc::gpu
