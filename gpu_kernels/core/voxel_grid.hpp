/** \file
 * Downsampling on points sorted by voxel: each run of equal keys becomes its centroid. */
#pragma once

#include <cmath>
#include <cstdint>

#include "core/cell.hpp"
#include "core/linear.hpp"
#include "raceloc/gpu/types.h"

namespace raceloc::gpu {

/** The box of the voxels that are occupied, and the points in it. */
struct VoxelBox {
  Cell low{kCellLimit, kCellLimit, kCellLimit}, high{-kCellLimit, -kCellLimit, -kCellLimit};
  std::uint32_t kept = 0;

  RACELOC_HD void add(const VoxelBox& other) {
    low = {least(low.x, other.low.x), least(low.y, other.low.y), least(low.z, other.low.z)};
    high = {most(high.x, other.high.x), most(high.y, other.high.y), most(high.z, other.high.z)};
    kept += other.kept;
  }

 private:
  static RACELOC_HD std::int32_t least(std::int32_t a, std::int32_t b) { return a < b ? a : b; }
  static RACELOC_HD std::int32_t most(std::int32_t a, std::int32_t b) { return a > b ? a : b; }
};

/** Key of a point's voxel; a point without one gets the key after all others, 2^bits. */
RACELOC_HD std::uint64_t voxelKey(const KeyLayout& layout, double voxel_size_m, float x, float y, float z) {
  Cell c{};
  return cellOf(x, y, z, voxel_size_m, c) ? layout.key(c) : std::uint64_t{1} << layout.bits;
}

/** Sum of a voxel's points. In double it is exact, and its order of no effect, unless a coordinate of some 1e-6 m stands
 * beside much larger ones: a float has 24 bits, a double 53. */
struct CentroidSum {
  double x = 0, y = 0, z = 0;

  RACELOC_HD void add(const PointsView& p, std::size_t i) {
    x += static_cast<double>(p.x[i]);
    y += static_cast<double>(p.y[i]);
    z += static_cast<double>(p.z[i]);
  }
  [[nodiscard]] RACELOC_HD Vec3<float> centroid(std::size_t points) const {
    const auto n = static_cast<double>(points);
    return {static_cast<float>(x / n), static_cast<float>(y / n), static_cast<float>(z / n)};
  }
};

}  // namespace raceloc::gpu
