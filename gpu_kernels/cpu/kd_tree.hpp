/** \file
 * Exact nearest neighbours: a balanced tree over points, cut at medians of the widest axis, with leaves of up
 * to 16 points that one comparison of 16 lanes covers. */
#pragma once

#include <cstdint>
#include <vector>

#include "core/host_device.hpp"
#include "raceloc/gpu/types.h"

namespace raceloc::gpu {

inline constexpr int kLeafPoints = 16;

/** Depth of the deepest tree: 2^27 leaves of 16 points. */
inline constexpr int kDeepest = 27;

/** Where an inner node cuts. */
struct KdNode {
  float split_m;
  std::int32_t axis;
};

/** A tree as searches read it: nodes of a complete binary tree, the children of node i are 2i+1 and 2i+2; then
 * its 2^depth leaves. */
struct KdTreeView {
  const KdNode* nodes;        ///< inner nodes
  const float *x, *y, *z;     ///< kLeafPoints a leaf; places without a point are far away
  const std::int32_t* index;  ///< of the point in the caller's cloud; INT32_MAX without one
  std::int32_t inner_nodes;   ///< 2^depth - 1
};

class KdTree {
 public:
  /** Builds the tree anew, in the memory of the one before. \param points finite, fewer than 2^31 */
  void build(const PointsView& points);
  [[nodiscard]] KdTreeView view() const {
    return {x_nodes.data(), x_x.data(),     x_y.data(),
            x_z.data(),     x_index.data(), static_cast<std::int32_t>(x_nodes.size())};
  }

 private:
  struct Item {
    float p[3];
    std::int32_t index;
  };
  void divide(std::int32_t node, Item* first, Item* last);

  std::vector<KdNode> x_nodes;
  std::vector<float> x_x, x_y, x_z;
  std::vector<std::int32_t> x_index;
  std::vector<Item> x_items;
};

}  // namespace raceloc::gpu
