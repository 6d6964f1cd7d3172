/** \file
 * Clusters: a thread a point, all trees at once. */
#pragma once

#include "core/union_find.hpp"
#include "kernels/simt.hpp"

namespace raceloc::gpu {

inline constexpr int kClusterThreads = 128;

/** Parents that other blocks change in the same launch. */
struct SharedParents {
  std::uint32_t* parents;
  [[nodiscard]] RACELOC_DEVICE std::uint32_t get(std::uint32_t i) const {
    return simt::fromOtherBlock(parents[i]);
  }
  RACELOC_DEVICE void set(std::uint32_t i, std::uint32_t ancestor) const { parents[i] = ancestor; }
  RACELOC_DEVICE std::uint32_t hook(std::uint32_t i, std::uint32_t parent) const {
    return simt::exchangeIf(parents[i], i, parent);
  }
};

RACELOC_KERNEL(kClusterThreads)
plantTrees(std::uint32_t points, std::uint32_t* parents) {
  const std::uint32_t i = simt::globalThread();
  if (i < points) parents[i] = i;
}

RACELOC_KERNEL(kClusterThreads)
joinTrees(PointsView sorted, const std::uint32_t* order, const std::uint32_t* numbers, const Run* runs,
          float squared_radius_m2, std::uint32_t* parents) {
  const std::uint32_t k = simt::globalThread();
  if (k >= sorted.size) return;
  uniteWithNeighbours(SharedParents{parents}, k, sorted, order,
                      runs + static_cast<std::size_t>(numbers[k] - 1) * kRowsAround, squared_radius_m2);
}

RACELOC_KERNEL(kClusterThreads)
labelTrees(std::uint32_t points, std::uint32_t* parents, std::int32_t* labels) {
  const std::uint32_t i = simt::globalThread();
  if (i < points) labels[i] = static_cast<std::int32_t>(rootOf(SharedParents{parents}, i));
}

}  // namespace raceloc::gpu
