/** \file
 * Searches in a KdTreeView, compiled once for each instruction set. */
#pragma once

#include "core/linear.hpp"
#include "cpu/kd_tree.hpp"
#include "cpu/lanes.hpp"

namespace raceloc::gpu::GK_ISA {

static_assert(kLeafPoints == kLanes);

/** Visits the leaves that may hold a point within `reach(0)` of q, near ones first; reach() may shrink on the
 * way. \param visit called with a leaf's first place */
template <class Reach, class Visit>
RACELOC_HD void visitLeaves(const KdTreeView& tree, const Vec3<float>& q, const Reach& reach,
                            const Visit& visit) {
  struct Branch {
    std::int32_t node;
    float squared_m2;   ///< distance to the branch's box
    float offset_m[3];  ///< of q from the box, axis by axis
  };
  // A distance and a bound are rounded apart: a branch is left out only if it is surely too far.
  constexpr float surely = 1 - 1e-6F;
  const float from[3] = {q.x, q.y, q.z};
  Branch stack[kDeepest + 1];
  stack[0] = {0, 0.0F, {0.0F, 0.0F, 0.0F}};
  int depth = 1;
  while (depth > 0) {
    Branch here = stack[--depth];
    if (here.squared_m2 * surely > reach()) continue;
    while (here.node < tree.inner_nodes) {
      const KdNode cut = tree.nodes[here.node];
      const float beyond_m = from[cut.axis] - cut.split_m;
      const std::int32_t low = 2 * here.node + 1, near = beyond_m < 0 ? low : low + 1;
      if (beyond_m * beyond_m * surely <= reach()) {  // else its box is not nearer than its plane
        Branch& other = stack[depth];
        other = here;
        other.node = beyond_m < 0 ? low + 1 : low;
        other.offset_m[cut.axis] = beyond_m;
        other.squared_m2 = other.offset_m[0] * other.offset_m[0] + other.offset_m[1] * other.offset_m[1] +
                           other.offset_m[2] * other.offset_m[2];
        if (other.squared_m2 * surely <= reach()) ++depth;
      }
      here.node = near;
    }
    visit((here.node - tree.inner_nodes) * kLeafPoints);
  }
}

struct Neighbour {
  float squared_m2;
  std::int32_t index;
};

RACELOC_HD bool nearer(const Neighbour& a, const Neighbour& b) {
  return a.squared_m2 != b.squared_m2 ? a.squared_m2 < b.squared_m2 : a.index < b.index;
}

/** Calls `take` with the points of a leaf that are not farther than `reach`, in the order of their places. */
template <class Take>
RACELOC_HD void takeNear(const KdTreeView& tree, const Vec3<float>& q, std::int32_t leaf, float reach_m2,
                         const Take& take) {
  for (int at = 0; at < kLanes; at += kWidth) {
    const std::int32_t place = leaf + at;
    const Vec3<F> d = Vec3<F>{load(tree.x + place), load(tree.y + place), load(tree.z + place)} -
                      Vec3<F>{F(q.x), F(q.y), F(q.z)};
    const F squared = dot(d, d);
    unsigned near = lanesOf(squared <= F(reach_m2));
    if (near == 0) continue;
    alignas(64) float squared_m2[kWidth];
    store(squared_m2, squared);
    for (; near != 0; near &= near - 1) {
      const int lane = __builtin_ctz(near);
      take(Neighbour{squared_m2[lane], tree.index[place + lane]});
    }
  }
}

/** The nearest point that is nearer than `best` (of two equally near the one of smaller index), else `best`. */
RACELOC_HD Neighbour nearest(const KdTreeView& tree, const Vec3<float>& q, Neighbour best) {
  visitLeaves(
      tree, q, [&] { return best.squared_m2; },
      [&](std::int32_t leaf) {
        takeNear(tree, q, leaf, best.squared_m2, [&](const Neighbour& candidate) {
          if (nearer(candidate, best)) best = candidate;
        });
      });
  return best;
}

/** The `count` nearest points in ascending order; `found` ends with places that are infinitely far if there are
 * fewer. */
RACELOC_HD void nearestOf(const KdTreeView& tree, const Vec3<float>& q, int count, Neighbour* found) {
  for (int k = 0; k < count; ++k) found[k] = {1e30F, INT32_MAX};
  visitLeaves(
      tree, q, [&] { return found[count - 1].squared_m2; },
      [&](std::int32_t leaf) {
        takeNear(tree, q, leaf, found[count - 1].squared_m2, [&](const Neighbour& candidate) {
          if (!nearer(candidate, found[count - 1])) return;
          int place = count - 1;
          for (; place > 0 && nearer(candidate, found[place - 1]); --place) found[place] = found[place - 1];
          found[place] = candidate;
        });
      });
}

}  // namespace raceloc::gpu::GK_ISA
