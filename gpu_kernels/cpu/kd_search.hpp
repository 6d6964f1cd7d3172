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
      const int axis = tree.axis[here.node];
      const float beyond_m = from[axis] - tree.split[here.node];
      const std::int32_t low = 2 * here.node + 1, near = beyond_m < 0 ? low : low + 1;
      Branch& other = stack[depth];
      other = here;
      other.node = beyond_m < 0 ? low + 1 : low;
      other.offset_m[axis] = beyond_m;
      other.squared_m2 = other.offset_m[0] * other.offset_m[0] + other.offset_m[1] * other.offset_m[1] +
                         other.offset_m[2] * other.offset_m[2];
      if (other.squared_m2 * surely <= reach()) ++depth;
      here.node = near;
    }
    visit((here.node - tree.inner_nodes) * kLeafPoints);
  }
}

/** Squared distances of a leaf's points. */
RACELOC_HD void leafDistances(const KdTreeView& tree, const Vec3<float>& q, std::int32_t leaf,
                              float* squared_m2) {
  for (int at = 0; at < kLanes; at += kWidth) {
    const Vec3<F> d = Vec3<F>{load(tree.x + leaf + at), load(tree.y + leaf + at), load(tree.z + leaf + at)} -
                      Vec3<F>{F(q.x), F(q.y), F(q.z)};
    store(squared_m2 + at, dot(d, d));
  }
}

struct Neighbour {
  float squared_m2;
  std::int32_t index;
};

RACELOC_HD bool nearer(const Neighbour& a, const Neighbour& b) {
  return a.squared_m2 != b.squared_m2 ? a.squared_m2 < b.squared_m2 : a.index < b.index;
}

/** The nearest point that is nearer than `best` (of two equally near the one of smaller index), else `best`. */
RACELOC_HD Neighbour nearest(const KdTreeView& tree, const Vec3<float>& q, Neighbour best) {
  visitLeaves(
      tree, q, [&] { return best.squared_m2; },
      [&](std::int32_t leaf) {
        alignas(64) float squared_m2[kLanes];
        leafDistances(tree, q, leaf, squared_m2);
        F low = load(squared_m2);
        for (int at = kWidth; at < kLanes; at += kWidth) {
          const F other = load(squared_m2 + at);
          low = select(other < low, other, low);
        }
        float smallest = low.v[0];
        for (int k = 1; k < kWidth; ++k) smallest = low.v[k] < smallest ? low.v[k] : smallest;
        if (smallest > best.squared_m2) return;
        for (int lane = 0; lane < kLanes; ++lane) {
          const Neighbour candidate{squared_m2[lane], tree.index[leaf + lane]};
          if (nearer(candidate, best)) best = candidate;
        }
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
        alignas(64) float squared_m2[kLanes];
        leafDistances(tree, q, leaf, squared_m2);
        for (int lane = 0; lane < kLanes; ++lane) {
          const Neighbour candidate{squared_m2[lane], tree.index[leaf + lane]};
          if (!nearer(candidate, found[count - 1])) continue;
          int place = count - 1;
          for (; place > 0 && nearer(candidate, found[place - 1]); --place) found[place] = found[place - 1];
          found[place] = candidate;
        }
      });
}

}  // namespace raceloc::gpu::GK_ISA
