/** \file
 * A tree of boxes over points, for exact nearest neighbours. A node has up to 16 children and a leaf up to 16
 * points: one comparison of 16 lanes covers either. */
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "core/host_device.hpp"
#include "raceloc/gpu/types.h"

namespace raceloc::gpu {

inline constexpr int kFanOut = 16;

/** Levels of nodes of the largest tree: 16^7 leaves of 16 points. */
inline constexpr int kMostLevels = 7;

/** Where there is no point and no box; its square is finite. */
inline constexpr float kNowhere_m = 1e18F;

/** The boxes of a node's children. One that does not exist is inside out: far from everywhere. */
struct BoxNode {
  alignas(64) float low_m[3][kFanOut], high_m[3][kFanOut];  ///< x, y, z
};

/** Points of a leaf; places without one are far away. */
struct BoxLeaf {
  alignas(64) float x[kFanOut], y[kFanOut], z[kFanOut];
  std::int32_t index[kFanOut];  ///< of the point in the caller's cloud; INT32_MAX without one
};

/** A tree as searches read it. The children of the k-th node of a level are the nodes 16k, 16k + 1, ... of the
 * next level, or those leaves. */
struct BoxTreeView {
  const BoxNode* nodes;  ///< level by level, the root first
  const std::uint32_t* level_first;
  std::uint32_t levels;  ///< of nodes; the leaves are below
  const BoxLeaf* leaves;
};

class BoxTree {
 public:
  /** Builds the tree anew, in the memory of the one before. \param points finite, fewer than 2^31 */
  void build(const PointsView& points);
  [[nodiscard]] BoxTreeView view() const {
    return {x_nodes.data(), x_level_first.data(), x_levels, x_leaves.data()};
  }

 private:
  struct Item {
    float p[3];
    std::int32_t index;
  };
  void divide(std::size_t first_leaf, std::size_t leaves, Item* first, Item* last);
  void fillLeaf(std::size_t number, const Item* first, const Item* last);

  std::vector<BoxNode> x_nodes;
  std::vector<BoxLeaf> x_leaves;
  std::array<std::uint32_t, kMostLevels> x_level_first{};
  std::uint32_t x_levels = 0;
  std::vector<Item> x_items;
};

}  // namespace raceloc::gpu
