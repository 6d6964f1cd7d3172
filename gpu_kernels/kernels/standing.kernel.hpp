/** \file
 * What stands on the ground: one warp a cell. */
#pragma once

#include "core/standing.hpp"
#include "kernels/rows.hpp"
#include "kernels/simt.hpp"

namespace raceloc::gpu {

inline constexpr int kStandingThreads = 256;

/** Rows of the cells: x, y and z of the face and of its upper half, lowest and highest. */
inline constexpr std::size_t kStandingRows = 8;

/** Warps of standingOfCells at most. */
inline constexpr std::uint32_t kStandingBlocks = 1024;

/** Adds the sum of the lane whose number differs by `mask`. */
RACELOC_DEVICE void add(CentroidSum& sum, int mask) {
  sum.x += simt::fromLaneXor(sum.x, mask);
  sum.y += simt::fromLaneXor(sum.y, mask);
  sum.z += simt::fromLaneXor(sum.z, mask);
}

template <class Key>
RACELOC_KERNEL(kStandingThreads)
standingKeys(PointsView p, StandingGrid grid, Key* keys, std::uint32_t* order, unsigned char* is_standing) {
  const std::uint32_t i = simt::globalThread();
  if (i >= p.size) return;
  keys[i] = static_cast<Key>(grid.key(p.x[i], p.y[i], p.z[i]));
  order[i] = i;
  is_standing[i] = 0;
}

/** \param rows      kStandingRows of as many cells as there are runs
 * \param standing  of each cell how many points stand; 0: it is ground, and its rows are of no use */
RACELOC_KERNEL(kStandingThreads)
standingOfCells(PointsView p, StandingOptions options, const std::uint32_t* order, const std::uint32_t* first,
                std::uint32_t runs, float* rows, std::int32_t* standing, unsigned char* is_standing) {
  const std::uint32_t warps = simt::blocks().x * (kStandingThreads / simt::kWarp);
  for (std::uint32_t run = simt::globalThread() / simt::kWarp; run < runs; run += warps) {
    const std::uint32_t begin = first[run] + simt::lane(), end = first[run + 1];
    float lowest_m = FLT_MAX;
    for (std::uint32_t k = begin; k < end; k += simt::kWarp)
      lowest_m = p.z[order[k]] < lowest_m ? p.z[order[k]] : lowest_m;
    for (int mask = simt::kWarp / 2; mask > 0; mask /= 2) {
      const float other_m = simt::fromLaneXor(lowest_m, mask);
      lowest_m = other_m < lowest_m ? other_m : lowest_m;
    }
    StandingCell cell(lowest_m);
    for (std::uint32_t k = begin; k < end; k += simt::kWarp) cell.add(p, order[k], options);
    for (int mask = simt::kWarp / 2; mask > 0; mask /= 2) {
      const float other_m = simt::fromLaneXor(cell.highest_m, mask);
      cell.highest_m = other_m > cell.highest_m ? other_m : cell.highest_m;
      cell.within += simt::fromLaneXor(cell.within, mask);
      cell.standing += simt::fromLaneXor(cell.standing, mask);
      add(cell.sum, mask);
    }
    const bool stands = cell.stands(options);
    if (simt::lane() == 0) standing[run] = stands ? cell.standing : 0;
    if (!stands) continue;  // all lanes
    for (std::uint32_t k = begin; k < end; k += simt::kWarp)
      is_standing[order[k]] = cell.addHigh(p, order[k], options) ? 1 : 0;
    for (int mask = simt::kWarp / 2; mask > 0; mask /= 2) {
      cell.high += simt::fromLaneXor(cell.high, mask);
      add(cell.high_sum, mask);
    }
    if (simt::lane() != 0) continue;
    const Vec3<float> face = cell.sum.centroid(static_cast<std::size_t>(cell.standing)),
                      upper = cell.high_sum.centroid(static_cast<std::size_t>(cell.high));
    const float values[kStandingRows] = {face.x,  face.y,  face.z,        upper.x,
                                         upper.y, upper.z, cell.lowest_m, cell.highest_m};
    RACELOC_UNROLL
    for (std::size_t r = 0; r < kStandingRows; ++r) rows[r * runs + run] = values[r];
  }
}

}  // namespace raceloc::gpu
