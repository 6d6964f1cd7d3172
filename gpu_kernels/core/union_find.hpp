/** \file
 * Clusters as trees: each point has a parent of a smaller index, or is a root. Parents are reached through
 * \code
 * std::uint32_t get(i);           // may be old on a device: then it is an ancestor all the same
 * void set(i, ancestor);
 * std::uint32_t hook(i, parent);  // if i is a root, gives it a parent; returns the parent it had: i itself if it was one
 * \endcode
 * so that many threads can join trees at once. Source: Jaiganesh, Burtscher, HPDC 2018 (ECL-CC). */
#pragma once

#include <cstdint>

#include "core/neighbour_grid.hpp"
#include "core/scalar.hpp"

namespace raceloc::gpu {

/** The root above i; halves the way for whoever comes next. */
template <class Parents>
RACELOC_HD std::uint32_t rootOf(const Parents& parents, std::uint32_t i) {
  for (std::uint32_t parent = parents.get(i); parent != i;) {
    const std::uint32_t above = parents.get(parent);
    if (above == parent) return parent;
    parents.set(i, above);
    i = above;
    parent = parents.get(i);
  }
  return i;
}

template <class Parents>
RACELOC_HD void unite(const Parents& parents, std::uint32_t a, std::uint32_t b) {
  a = rootOf(parents, a);
  b = rootOf(parents, b);
  while (a != b) {  // ends: every round either joins, or goes on from a parent, which is smaller
    const std::uint32_t high = a > b ? a : b, low = a > b ? b : a;
    const std::uint32_t before = parents.hook(high, low);
    if (before == high) return;
    a = rootOf(parents, before);
    b = low;
  }
}

/** Joins the sorted point k with those before it that are near. \param runs  the nine of its cell */
template <class Parents>
RACELOC_HD void uniteWithNeighbours(const Parents& parents, std::uint32_t k, const PointsView& sorted,
                                    const std::uint32_t* order, const Run* runs, float squared_radius_m2) {
  for (int row = 0; row < kRowsAround; ++row) {
    const std::uint32_t last = runs[row].last < k ? runs[row].last : k;
    for (std::uint32_t j = runs[row].first; j < last; ++j) {
      const float x = sorted.x[j] - sorted.x[k], y = sorted.y[j] - sorted.y[k], z = sorted.z[j] - sorted.z[k];
      // Not contracted: every device has the same neighbours.
      if (product(x, x) + product(y, y) + product(z, z) <= squared_radius_m2)
        unite(parents, order[k], order[j]);
    }
  }
}

}  // namespace raceloc::gpu
