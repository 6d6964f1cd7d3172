/** \file
 * Kernels around the sort: a run of equal keys is a voxel of the voxel grid, or a cell of the neighbour grid.
 */
#pragma once

#include "core/neighbour_grid.hpp"
#include "core/voxel_grid.hpp"
#include "kernels/simt.hpp"

namespace raceloc::gpu {

inline constexpr int kRunThreads = 256;

RACELOC_KERNEL(kRunThreads)
voxelKeys(PointsView p, KeyLayout layout, double voxel_size_m, std::uint64_t* keys, std::uint32_t* order) {
  const std::uint32_t i = simt::globalThread();
  if (i >= p.size) return;
  keys[i] = voxelKey(layout, voxel_size_m, p.x[i], p.y[i], p.z[i]);
  order[i] = i;
}

RACELOC_KERNEL(kRunThreads)
cellKeys(PointsView p, NeighbourGrid grid, std::uint64_t* keys, std::uint32_t* order) {
  const std::uint32_t i = simt::globalThread();
  if (i >= p.size) return;
  keys[i] = grid.layout.key(grid.cell(p.x[i], p.y[i], p.z[i]));
  order[i] = i;
}

/** heads[k] = 1 where a run begins; their inclusive sum numbers the runs from 1. */
RACELOC_KERNEL(kRunThreads)
markHeads(const std::uint64_t* keys, std::uint32_t n, std::uint32_t* heads) {
  const std::uint32_t k = simt::globalThread();
  if (k >= n) return;
  heads[k] = k == 0 || keys[k] != keys[k - 1] ? 1 : 0;
}

/** One thread a run, at its head: the centroid, summed in order. */
RACELOC_KERNEL(kRunThreads)
centroids(PointsView p, const std::uint64_t* keys, const std::uint32_t* order, const std::uint32_t* numbers,
          std::uint32_t kept, float* x, float* y, float* z) {
  const std::uint32_t first = simt::globalThread();
  if (first >= kept || (first > 0 && keys[first] == keys[first - 1])) return;
  std::uint32_t last = first + 1;
  while (last < kept && keys[last] == keys[first]) ++last;
  CentroidSum sum;
  for (std::uint32_t k = first; k < last; ++k) sum.add(p, order[k]);
  const Vec3<float> mean = sum.centroid();
  const std::uint32_t out = numbers[first] - 1;
  x[out] = mean.x;
  y[out] = mean.y;
  z[out] = mean.z;
}

/** Compact list of cells: key and first point of each; the points themselves in cell order. */
RACELOC_KERNEL(kRunThreads)
listCells(PointsView p, const std::uint64_t* keys, const std::uint32_t* order, const std::uint32_t* numbers,
          std::uint64_t* cell_keys, std::uint32_t* cell_first, float* x, float* y, float* z) {
  const std::uint32_t k = simt::globalThread();
  if (k >= p.size) return;
  const std::uint32_t i = order[k];
  x[k] = p.x[i];
  y[k] = p.y[i];
  z[k] = p.z[i];
  if (k == 0 || keys[k] != keys[k - 1]) {
    cell_keys[numbers[k] - 1] = keys[k];
    cell_first[numbers[k] - 1] = k;
  }
}

/** First of `n` ascending keys that is not below `key`. */
RACELOC_DEVICE std::uint32_t lowerBound(const std::uint64_t* keys, std::uint32_t n, std::uint64_t key) {
  std::uint32_t first = 0;
  for (std::uint32_t left = n; left > 0;) {
    const std::uint32_t half = left / 2;
    const bool below = keys[first + half] < key;
    first = below ? first + half + 1 : first;
    left = below ? left - half - 1 : half;
  }
  return first;
}

/** One thread a cell and row: the run of points in the three cells of the row. */
RACELOC_KERNEL(kRunThreads)
findRuns(NeighbourGrid grid, const std::uint64_t* cell_keys, const std::uint32_t* cell_first,
         std::uint32_t cells, std::uint32_t points, Run* runs) {
  const std::uint32_t i = simt::globalThread();
  if (i >= cells * kRowsAround) return;
  const std::uint64_t low = grid.rowKey(cell_keys[i / kRowsAround], static_cast<int>(i % kRowsAround));
  const std::uint32_t first = lowerBound(cell_keys, cells, low), last = lowerBound(cell_keys, cells, low + 3);
  runs[i] = {first < cells ? cell_first[first] : points, last < cells ? cell_first[last] : points};
}

}  // namespace raceloc::gpu
