#include "cpu/box_tree.hpp"

#include <algorithm>
#include <limits>

namespace raceloc::gpu {

namespace {

constexpr std::size_t kFan = kFanOut;

BoxLeaf emptyLeaf() {
  BoxLeaf leaf{};
  for (auto* axis : {&leaf.x, &leaf.y, &leaf.z}) std::fill(std::begin(*axis), std::end(*axis), kNowhere_m);
  std::fill(std::begin(leaf.index), std::end(leaf.index), std::numeric_limits<std::int32_t>::max());
  return leaf;
}

BoxNode emptyNode() {
  BoxNode node{};
  for (auto& axis : node.low_m) std::fill(std::begin(axis), std::end(axis), kNowhere_m);
  for (auto& axis : node.high_m) std::fill(std::begin(axis), std::end(axis), -kNowhere_m);
  return node;
}

/** Child c's box, which holds the boxes of its own children. */
void setBox(BoxNode& node, std::size_t c, const BoxNode& child) {
  for (std::size_t a = 0; a < 3; ++a) {
    node.low_m[a][c] = *std::min_element(std::begin(child.low_m[a]), std::end(child.low_m[a]));
    node.high_m[a][c] = *std::max_element(std::begin(child.high_m[a]), std::end(child.high_m[a]));
  }
}

}  // namespace

void BoxTree::build(const PointsView& points) {
  x_items.resize(points.size);
  for (std::size_t i = 0; i < points.size; ++i)
    x_items[i] = {{points.x[i], points.y[i], points.z[i]}, static_cast<std::int32_t>(i)};
  std::size_t leaves = 1;
  while (leaves * kFan < points.size) leaves *= 2;
  x_leaves.assign(leaves, emptyLeaf());
  std::array<std::uint32_t, kMostLevels> nodes{};  // of each level, the lowest first
  std::uint32_t all = 0;
  x_levels = 0;
  for (std::size_t children = leaves; x_levels == 0 || children > 1; ++x_levels) {
    children = (children + kFan - 1) / kFan;
    nodes[x_levels] = static_cast<std::uint32_t>(children);
    all += nodes[x_levels];
  }
  x_nodes.assign(all, emptyNode());
  x_level_first.fill(0);
  for (std::uint32_t level = 1; level < x_levels; ++level)
    x_level_first[level] = x_level_first[level - 1] + nodes[x_levels - level];

  divide(0, leaves, x_items.data(), x_items.data() + x_items.size());
  for (std::uint32_t level = x_levels - 1; level > 0; --level) {
    const std::size_t first = x_level_first[level], parents = x_level_first[level - 1];
    for (std::size_t k = 0; k < nodes[x_levels - 1 - level]; ++k)
      setBox(x_nodes[parents + k / kFan], k % kFan, x_nodes[first + k]);
  }
}

/** Halves [first, last), across its widest side, until it is a leaf's; both halves always fit the leaves below
 * them. At most 4 kMostLevels deep. */
// NOLINTNEXTLINE(misc-no-recursion)
void BoxTree::divide(std::size_t first_leaf, std::size_t leaves, Item* first, Item* last) {
  if (leaves == 1) return fillLeaf(first_leaf, first, last);
  std::array<float, 3> low{}, high{};
  low.fill(kNowhere_m);
  high.fill(-kNowhere_m);
  for (const Item* item = first; item != last; ++item)
    for (std::size_t a = 0; a < 3; ++a) {
      low[a] = std::min(low[a], item->p[a]);
      high[a] = std::max(high[a], item->p[a]);
    }
  std::size_t axis = 0;
  for (std::size_t a = 1; a < 3; ++a)
    if (high[a] - low[a] > high[axis] - low[axis]) axis = a;
  Item* middle = first + (last - first) / 2;
  std::nth_element(first, middle, last, [axis](const Item& a, const Item& b) {
    return a.p[axis] != b.p[axis] ? a.p[axis] < b.p[axis] : a.index < b.index;
  });
  divide(first_leaf, leaves / 2, first, middle);
  divide(first_leaf + leaves / 2, leaves / 2, middle, last);
}

/** The leaf's points, and its box in the node above. */
void BoxTree::fillLeaf(std::size_t number, const Item* first, const Item* last) {
  BoxLeaf& leaf = x_leaves[number];
  BoxNode& node = x_nodes[x_level_first[x_levels - 1] + number / kFan];
  const std::size_t c = number % kFan;
  std::size_t place = 0;
  for (const Item* item = first; item != last; ++item, ++place) {
    leaf.x[place] = item->p[0], leaf.y[place] = item->p[1], leaf.z[place] = item->p[2];
    leaf.index[place] = item->index;
    for (std::size_t a = 0; a < 3; ++a) {
      node.low_m[a][c] = std::min(node.low_m[a][c], item->p[a]);
      node.high_m[a][c] = std::max(node.high_m[a][c], item->p[a]);
    }
  }
}

}  // namespace raceloc::gpu
