#include "cpu/kd_tree.hpp"

#include <algorithm>
#include <array>
#include <limits>

namespace raceloc::gpu {

void KdTree::build(const PointsView& points) {
  x_items.resize(points.size);
  for (std::size_t i = 0; i < points.size; ++i)
    x_items[i] = {{points.x[i], points.y[i], points.z[i]}, static_cast<std::int32_t>(i)};
  std::size_t leaves = 1;
  while (leaves * kLeafPoints < points.size) leaves *= 2;
  x_nodes.resize(leaves - 1);
  constexpr float nowhere_m = 1e18F;  // its square is finite
  for (auto* v : {&x_x, &x_y, &x_z}) v->assign(leaves * kLeafPoints, nowhere_m);
  x_index.assign(leaves * kLeafPoints, std::numeric_limits<std::int32_t>::max());
  divide(0, x_items.data(), x_items.data() + x_items.size());
}

/** Halves [first, last) until it is a leaf's; both halves always fit the leaves below them. Depth is that of the
 * tree, at most kDeepest. */
// NOLINTNEXTLINE(misc-no-recursion)
void KdTree::divide(std::int32_t node, Item* first, Item* last) {
  const auto inner_nodes = static_cast<std::int32_t>(x_nodes.size());
  if (node >= inner_nodes) {
    auto place = static_cast<std::size_t>(node - inner_nodes) * kLeafPoints;
    for (const Item* item = first; item != last; ++item, ++place) {
      x_x[place] = item->p[0], x_y[place] = item->p[1], x_z[place] = item->p[2];
      x_index[place] = item->index;
    }
    return;
  }
  std::array<float, 3> low{}, high{};
  low.fill(std::numeric_limits<float>::max());
  high.fill(std::numeric_limits<float>::lowest());
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
  x_nodes[static_cast<std::size_t>(node)] = {middle == last ? 0.0F : middle->p[axis],
                                             static_cast<std::int32_t>(axis)};
  divide(2 * node + 1, first, middle);
  divide(2 * node + 2, middle, last);
}

}  // namespace raceloc::gpu
