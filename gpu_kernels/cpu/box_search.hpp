/** \file
 * Searches in a BoxTreeView, compiled once for each instruction set. */
#pragma once

#include "core/linear.hpp"
#include "cpu/box_tree.hpp"
#include "cpu/lanes.hpp"

namespace raceloc::gpu::GK_ISA {

static_assert(kFanOut == kLanes);

/** Squared, and farther than anything that is sought. */
inline constexpr float kFar_m2 = 1e30F;

/** Squared distances of q from kWidth of a leaf's points. */
RACELOC_HD F squaredDistances(const BoxLeaf& leaf, const Vec3<float>& q, int at) {
  const Vec3<F> d =
      Vec3<F>{load(leaf.x + at), load(leaf.y + at), load(leaf.z + at)} - Vec3<F>{F(q.x), F(q.y), F(q.z)};
  return dot(d, d);
}

/** Squared distances of q from the boxes of kWidth children. They are rounded as those of points are, which is
 * monotone: never more than that of a point in the box. */
RACELOC_HD F squaredDistances(const BoxNode& node, const Vec3<float>& q, int at) {
  const auto outside = [&](int axis, float x) {
    return larger(larger(load(&node.low_m[axis][at]) - F(x), F(x) - load(&node.high_m[axis][at])), F(0));
  };
  const Vec3<F> d{outside(0, q.x), outside(1, q.y), outside(2, q.z)};
  return dot(d, d);
}

/** Visits the leaves that may hold a point within reach() of q (squared), near ones first; reach() may shrink
 * on the way. \param visit called with a leaf \param leave called with the squared distances of
 * boxes that are left out */
template <class Reach, class Visit, class Leave>
RACELOC_HD void visitLeaves(const BoxTreeView& tree, const Vec3<float>& q, const Reach& reach,
                            const Visit& visit, const Leave& leave) {
  // A branch is one number, which orders as the squared distance does: its bits, the level, the place in it.
  constexpr int place_bits = 4 * kMostLevels;
  std::uint64_t stack[kMostLevels * (kFanOut - 1) + 1];
  stack[0] = 0;
  int depth = 1;
  while (depth > 0) {
    const std::uint64_t here = stack[--depth];
    const auto bits = static_cast<std::uint32_t>(here >> 32);
    float here_m2 = 0;
    __builtin_memcpy(&here_m2, &bits, sizeof(here_m2));
    if (here_m2 > reach()) {
      leave(F(here_m2));
      continue;
    }
    const auto name = static_cast<std::uint32_t>(here);
    const std::uint32_t level = name >> place_bits, place = name & ((1U << place_bits) - 1);
    if (level == tree.levels) {
      visit(tree.leaves[place]);
      continue;
    }
    const std::uint64_t child = (level + 1) << place_bits | place * kFanOut;
    const BoxNode& node = tree.nodes[tree.level_first[level] + place];
    const int below = depth;
    for (int at = 0; at < kLanes; at += kWidth) {
      const F squared = squaredDistances(node, q, at);
      const M within = squared <= F(reach());
      leave(select(within, F(kFar_m2), squared));
      unsigned near = lanesOf(within);
      if (near == 0) continue;
      alignas(64) std::int32_t distances[kWidth];  // their bits
      storeInts(distances, bitsOf(squared));
      for (; near != 0; near &= near - 1) {
        const auto lane = static_cast<unsigned>(__builtin_ctz(near));
        const auto distance = static_cast<std::uint64_t>(distances[lane]);  // not negative
        const std::uint64_t branch = distance << 32 | (child + static_cast<unsigned>(at) + lane);
        int to = depth++;
        for (; to > below && stack[to - 1] < branch; --to) stack[to] = stack[to - 1];
        stack[to] = branch;
      }
    }
  }
}

struct Neighbour {
  float squared_m2;
  std::int32_t index;
};

RACELOC_HD bool nearer(const Neighbour& a, const Neighbour& b) {
  return a.squared_m2 != b.squared_m2 ? a.squared_m2 < b.squared_m2 : a.index < b.index;
}

/** The least of 16. */
RACELOC_HD float leastOf(const float* a) {
  using Four = float __attribute__((vector_size(16)));
  Four q[4];
  __builtin_memcpy(q, a, sizeof(q));
  const auto lesser = [](const Four& b, const Four& c) { return b < c ? b : c; };
  const Four m = lesser(lesser(q[0], q[1]), lesser(q[2], q[3]));
  const float b = m[0] < m[2] ? m[0] : m[2], c = m[1] < m[3] ? m[1] : m[3];
  return b < c ? b : c;
}

/** The two least of what each lane takes. */
struct TwoLeast {
  F least[kParts], next[kParts];
  TwoLeast() {
    for (int part = 0; part < kParts; ++part) least[part] = next[part] = F(kFar_m2);
  }
  RACELOC_HD void take(int part, const F& x) {
    next[part] = smaller(next[part], larger(least[part], x));
    least[part] = smaller(least[part], x);
  }
  /** The least of all without one that is `but`, which none is less than. */
  [[nodiscard]] RACELOC_HD float leastWithout(float but) const {
    alignas(64) float row[kLanes], instead[kLanes];
    unsigned same = 0;
    for (int part = 0; part < kParts; ++part) {
      const int at = part * kWidth;
      same |= lanesOf(least[part] <= F(but)) << at;
      store(&row[at], least[part]);
      store(&instead[at], next[part]);
    }
    if (same != 0) row[__builtin_ctz(same)] = instead[__builtin_ctz(same)];
    return leastOf(row);
  }
};

/** The nearest point that is nearer than `best` (of two equally near the one of smaller index), else `best`.
 * \param others_m2 squared: no other point is nearer than this */
RACELOC_HD Neighbour nearest(const BoxTreeView& tree, const Vec3<float>& q, Neighbour best,
                             float& others_m2) {
  TwoLeast seen;
  F left(kFar_m2);
  visitLeaves(
      tree, q, [&] { return best.squared_m2; },
      [&](const BoxLeaf& leaf) {
        alignas(64) float row[kLanes];
        F squared[kParts];
        for (int part = 0; part < kParts; ++part) {
          const int at = part * kWidth;
          squared[part] = squaredDistances(leaf, q, at);
          seen.take(part, squared[part]);
          store(&row[at], squared[part]);
        }
        const float least_m2 = leastOf(row);
        if (least_m2 > best.squared_m2) return;
        unsigned those = 0;
        for (int part = 0; part < kParts; ++part)
          those |= lanesOf(squared[part] <= F(least_m2)) << (part * kWidth);
        for (; those != 0; those &= those - 1) {
          const Neighbour candidate{least_m2, leaf.index[__builtin_ctz(those)]};
          if (nearer(candidate, best)) best = candidate;
        }
      },
      [&](const F& boxes_m2) { left = smaller(left, boxes_m2); });
  seen.take(0, left);
  others_m2 = seen.leastWithout(best.index == INT32_MAX ? -1.0F : best.squared_m2);
  return best;
}

/** The `count` nearest points in ascending order; `found` ends with places that are infinitely far if there are
 * fewer. */
RACELOC_HD void nearestOf(const BoxTreeView& tree, const Vec3<float>& q, int count, Neighbour* found) {
  for (int k = 0; k < count; ++k) found[k] = {kFar_m2, INT32_MAX};
  visitLeaves(
      tree, q, [&] { return found[count - 1].squared_m2; },
      [&](const BoxLeaf& leaf) {
        for (int at = 0; at < kLanes; at += kWidth) {
          const F squared = squaredDistances(leaf, q, at);
          unsigned near = lanesOf(squared <= F(found[count - 1].squared_m2));
          if (near == 0) continue;
          alignas(64) float squared_m2[kWidth];
          store(squared_m2, squared);
          for (; near != 0; near &= near - 1) {
            const int lane = __builtin_ctz(near);
            const Neighbour candidate{squared_m2[lane], leaf.index[at + lane]};
            if (!nearer(candidate, found[count - 1])) continue;
            int place = count - 1;
            for (; place > 0 && nearer(candidate, found[place - 1]); --place) found[place] = found[place - 1];
            found[place] = candidate;
          }
        }
      },
      [](const F&) {});
}

}  // namespace raceloc::gpu::GK_ISA
