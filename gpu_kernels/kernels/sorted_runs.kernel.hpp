/** \file
 * Kernels around the sort: a run of equal keys is a voxel of the voxel grid, or a cell of the neighbour grid.
 */
#pragma once

#include "core/neighbour_grid.hpp"
#include "core/voxel_grid.hpp"
#include "kernels/rows.hpp"
#include "kernels/simt.hpp"
#include "kernels/sort_buffers.hpp"

namespace raceloc::gpu {

inline constexpr int kRunThreads = 256;

/** Of a warp, given to all its lanes. */
RACELOC_DEVICE VoxelBox overWarp(VoxelBox box) {
  const auto from = [](std::int32_t value, int mask) { return simt::fromLaneXor(value, mask); };
  for (int mask = simt::kWarp / 2; mask > 0; mask /= 2)
    box.add({{from(box.low.x, mask), from(box.low.y, mask), from(box.low.z, mask)},
             {from(box.high.x, mask), from(box.high.y, mask), from(box.high.z, mask)},
             simt::fromLaneXor(box.kept, mask)});
  return box;
}

/** Blocks of voxelBoxes at most: the host adds the boxes of their warps. */
inline constexpr std::uint32_t kBoxBlocks = 32;

/** The box of each warp's points goes to boxes[warp of the grid]. */
RACELOC_KERNEL(kRunThreads)
voxelBoxes(PointsView p, double voxel_size_m, VoxelBox* boxes) {
  const std::uint32_t first = simt::globalThread(), threads = simt::blocks().x * simt::threads();
  VoxelBox box;
  Cell c{};
  for (std::size_t i = first; i < p.size; i += threads)
    if (cellOf(p.x[i], p.y[i], p.z[i], voxel_size_m, c)) box.add({c, c, 1});
  box = overWarp(box);
  if (simt::lane() == 0) boxes[first / simt::kWarp] = box;
}

template <class Key>
RACELOC_KERNEL(kRunThreads)
voxelKeys(PointsView p, KeyLayout layout, double voxel_size_m, Key* keys, std::uint32_t* order) {
  const std::uint32_t i = simt::globalThread();
  if (i >= p.size) return;
  keys[i] = static_cast<Key>(voxelKey(layout, voxel_size_m, p.x[i], p.y[i], p.z[i]));
  order[i] = i;
}

template <class Key>
RACELOC_KERNEL(kRunThreads)
cellKeys(PointsView p, NeighbourGrid grid, Key* keys, std::uint32_t* order) {
  const std::uint32_t i = simt::globalThread();
  if (i >= p.size) return;
  keys[i] = static_cast<Key>(grid.layout.key(grid.cell(p.x[i], p.y[i], p.z[i])));
  order[i] = i;
}

/** first[r] is where run r begins, and behind the last one where it ends. \param count  of the runs, on the host */
template <class Key>
RACELOC_KERNEL(kRunThreads)
listRuns(SortedKeys<Key> sorted, const std::uint32_t* numbers, std::uint32_t* first, std::uint32_t* count) {
  const std::uint32_t k = simt::globalThread();
  if (k == 0 && !sorted.isKept(0)) *count = 0;
  if (!sorted.isKept(k)) return;
  if (sorted(k) != 0) first[numbers[k] - 1] = k;
  if (sorted.isKept(k + 1)) return;
  first[numbers[k]] = k + 1;
  *count = numbers[k];
}

/** Blocks of centroids at most: how many runs there are is known to the device alone. */
inline constexpr std::uint32_t kCentroidBlocks = 1024;

/** One warp a run, then the next one: each lane adds every 32nd point, then the lanes are added as a tree.
 * \param rows  of as many points as there are runs */
RACELOC_KERNEL(kRunThreads)
centroids(PointsView p, const std::uint32_t* order, const std::uint32_t* first,
          const std::uint32_t* run_count, float* rows) {
  const std::uint32_t runs = *run_count, warps = simt::blocks().x * (kRunThreads / simt::kWarp);
  const PointsOut out = pointRows(rows, runs);
  for (std::uint32_t run = simt::globalThread() / simt::kWarp; run < runs; run += warps) {
    const std::uint32_t begin = first[run], end = first[run + 1];
    CentroidSum sum;
    std::uint32_t k = begin + simt::lane();
    constexpr std::uint32_t at_once =
        4;  // so that their loads overlap: voxels beside the sensor hold thousands
    for (; k + (at_once - 1) * simt::kWarp < end; k += at_once * simt::kWarp) {
      RACELOC_UNROLL
      for (std::uint32_t j = 0; j < at_once; ++j) sum.add(p, order[k + j * simt::kWarp]);
    }
    for (; k < end; k += simt::kWarp) sum.add(p, order[k]);
    for (int mask = simt::kWarp / 2; mask > 0; mask /= 2) {
      sum.x += simt::fromLaneXor(sum.x, mask);
      sum.y += simt::fromLaneXor(sum.y, mask);
      sum.z += simt::fromLaneXor(sum.z, mask);
    }
    if (simt::lane() != 0) continue;
    const Vec3<float> mean = sum.centroid(end - begin);
    out.x[run] = mean.x;
    out.y[run] = mean.y;
    out.z[run] = mean.z;
  }
}

/** Compact list of cells: key and first point of each; the points themselves in cell order. */
template <class Key>
RACELOC_KERNEL(kRunThreads)
listCells(PointsView p, SortedKeys<Key> sorted, const std::uint32_t* order, const std::uint32_t* numbers,
          Key* cell_keys, std::uint32_t* cell_first, PointsOut points) {
  const std::uint32_t k = simt::globalThread();
  if (k >= p.size) return;
  const std::uint32_t i = order[k];
  points.x[k] = p.x[i];
  points.y[k] = p.y[i];
  points.z[k] = p.z[i];
  if (sorted(k) != 0) {
    cell_keys[numbers[k] - 1] = sorted.keys[k];
    cell_first[numbers[k] - 1] = k;
  }
}

/** First of `n` ascending keys that is not below `key`. */
template <class Key>
RACELOC_DEVICE std::uint32_t lowerBound(const Key* keys, std::uint32_t n, std::uint64_t key) {
  std::uint32_t first = 0;
  for (std::uint32_t left = n; left > 0;) {
    const std::uint32_t half = left / 2;
    const bool below = keys[first + half] < key;
    first = below ? first + half + 1 : first;
    left = below ? left - half - 1 : half;
  }
  return first;
}

/** One thread a cell and row, of as many cells as the device knows of: the run of points in the three cells of the row. */
template <class Key>
RACELOC_KERNEL(kRunThreads)
findRuns(NeighbourGrid grid, const Key* cell_keys, const std::uint32_t* cell_first,
         const std::uint32_t* cell_count, std::uint32_t points, Run* runs) {
  const std::uint32_t i = simt::globalThread(), cells = *cell_count;
  if (i >= cells * kRowsAround) return;
  const std::uint64_t low = grid.rowKey(cell_keys[i / kRowsAround], static_cast<int>(i % kRowsAround));
  const std::uint32_t first = lowerBound(cell_keys, cells, low), last = lowerBound(cell_keys, cells, low + 3);
  runs[i] = {first < cells ? cell_first[first] : points, last < cells ? cell_first[last] : points};
}

}  // namespace raceloc::gpu
