#include "map/static_points.h"

#include <algorithm>
#include <bitset>
#include <cmath>
#include <limits>
#include <stdexcept>

namespace raceloc {

namespace {

constexpr double kGrid = 1 << 23;  // voxels along an axis
constexpr double kSteepest = 1;    // tangent of the tilt of a road under the car
constexpr double kRough_m = 0.02;  // of a road, and noise of a range
// Few rays pass at the edges of what moved, and over its top where they end on nothing. There a voxel with this share
// of the evidence, one pass more than was counted, goes with the ones around it and in so many layers above and below.
constexpr double kEdgeShare = 0.3;
constexpr int kEdgeLayers = 4, kMovedAround = 5;

bool isInGrid(const Eigen::Array3d& at) { return (at >= 0).all() && (at < kGrid).all(); }  // NaN is not

std::uint64_t columnKey(std::uint32_t x_block, std::uint32_t y_block) {
  return static_cast<std::uint64_t>(x_block) << 32 | y_block;
}

std::size_t bitsIn(std::uint64_t mask) { return std::bitset<64>(mask).count(); }

template <class Use>
void forEachBit(std::uint64_t mask, Use use) {
  for (; mask != 0; mask &= mask - 1) use(mask & ~(mask - 1));
}

void increase(std::uint8_t& count) {
  if (count < std::numeric_limits<std::uint8_t>::max()) ++count;
}

template <class Voxel>
Voxel voxelAt(const Eigen::Array3d& at) {
  return {static_cast<std::uint32_t>(at.x()), static_cast<std::uint32_t>(at.y()),
          static_cast<std::uint32_t>(at.z())};
}

/** The voxels up to so many away, itself among them. \return whether `use` was true of one, the last that is asked. */
template <class Voxel, class Use>
bool anyAround(const Voxel& voxel, int layers, Use use) {
  for (int dz = -layers; dz <= layers; ++dz)
    for (int dy = -1; dy <= 1; ++dy)
      for (int dx = -1; dx <= 1; ++dx)
        if (use(Voxel{voxel.x + static_cast<std::uint32_t>(dx), voxel.y + static_cast<std::uint32_t>(dy),
                      voxel.z + static_cast<std::uint32_t>(dz)}))
          return true;
  return false;
}

/** \return nullptr if the column does not reach it */
template <class Column, class Voxel>
auto* blockIn(Column& column, const Voxel& voxel) {
  const std::uint32_t above = (voxel.z >> 2) - column.lowest;  // huge if it is below
  return above < column.blocks.size() ? &column.blocks[above] : nullptr;
}

template <class Columns, class Voxel>
auto* blockOf(Columns& columns, const Voxel& voxel) {
  const auto found = columns.find(columnKey(voxel.x >> 2, voxel.y >> 2));
  return found == columns.end() ? nullptr : blockIn(found->second, voxel);
}

void requireFinite(const Pose& T_map_body) {
  if (!T_map_body.matrix().allFinite()) throw std::invalid_argument("StaticVoxels: the pose is not finite");
}

}  // namespace

void StaticOptions::describe(OptionList& keys) {
  keys.add("voxel_m", voxel_m, between(0.05, 2),
           "what moves is told from what stays in voxels so wide [m] ...");
  keys.add("layer_m", layer_m, between(0.02, 2), "... and so high [m]");
  keys.add("near_m", near_m, atLeast(0), "a ray sees through nothing nearer to the LiDAR [m] ...");
  keys.add("range_m", range_m, between(1, 200), "... nor farther away [m] ...");
  keys.add("end_m", end_m, atLeast(0), "... nor closer to its end [m] ...");
  keys.add("end_share", end_share, between(0, 1),
           "... and where it may graze a surface, not in up to this share of its length");
  keys.add("min_passes", min_passes, between(1, 255), "what moved is seen through by so many scans ...");
  keys.add("passes_per_hit", passes_per_hit, above(0), "... and by more than so many for each that hits it");
}

/** Columns around a sensor, found without a hash: a ray asks at every step. Remembers what one scan saw there. */
class StaticVoxels::Window {
 public:
  Window(const Columns& columns, const Voxel& middle, std::uint32_t reach_blocks)
      : x_first((middle.x >> 2) - reach_blocks),
        y_first((middle.y >> 2) - reach_blocks),
        x_edge(2 * reach_blocks + 1),
        x_columns(static_cast<std::size_t>(x_edge) * x_edge) {
    std::size_t blocks = 0;
    for (std::uint32_t y = 0; y < x_edge; ++y)
      for (std::uint32_t x = 0; x < x_edge; ++x) {
        const auto found = columns.find(columnKey(x_first + x, y_first + y));
        if (found == columns.end()) continue;
        x_columns[static_cast<std::size_t>(y) * x_edge + x] = {&found->second, blocks};
        blocks += found->second.blocks.size();
      }
    x_masks.resize(blocks);
  }

  /** A block, and what the scan saw of it. */
  struct Here {
    const Block* block;  ///< nullptr where nothing is held, or outside
    std::size_t number;  ///< of its masks
  };
  [[nodiscard]] Here at(const Voxel& voxel) const {
    const std::uint32_t x = (voxel.x >> 2) - x_first, y = (voxel.y >> 2) - y_first;
    if (x >= x_edge || y >= x_edge) return {nullptr, 0};
    const Place& place = x_columns[static_cast<std::size_t>(y) * x_edge + x];
    if (place.column == nullptr) return {nullptr, 0};
    const Block* block = blockIn(*place.column, voxel);
    if (block == nullptr) return {nullptr, 0};
    return {block, place.first_mask + static_cast<std::size_t>(block - place.column->blocks.data())};
  }

  [[nodiscard]] bool isHit(const Voxel& voxel) const {
    const Here here = at(voxel);
    return here.block != nullptr && (x_masks[here.number].hit & bitOf(voxel)) != 0;
  }

  /** \return whether it was not yet */
  bool hit(const Here& here, Mask bit) {
    const bool first = (x_masks[here.number].hit & bit) == 0;
    x_masks[here.number].hit |= bit;
    return first;
  }
  void seeThrough(const Here& here, const Voxel& voxel) {
    Mask& seen = x_masks[here.number].seen;
    if (seen == 0) x_through.push_back({{voxel.x & ~3U, voxel.y & ~3U, voxel.z & ~3U}, here});
    seen |= bitOf(voxel);
  }

  struct Through {
    Voxel corner;
    Here here;
  };
  [[nodiscard]] const std::vector<Through>& through() const { return x_through; }
  [[nodiscard]] Mask missed(const Here& here) const {  ///< seen through, and not hit
    return x_masks[here.number].seen & ~x_masks[here.number].hit;
  }

 private:
  struct Place {
    const Column* column = nullptr;
    std::size_t first_mask = 0;
  };
  struct Masks {
    Mask hit = 0, seen = 0;
  };
  std::uint32_t x_first, y_first, x_edge;  ///< blocks
  std::vector<Place> x_columns;
  std::vector<Masks> x_masks;
  std::vector<Through> x_through;
};

Eigen::Array3d StaticVoxels::inGrid(const Eigen::Vector3d& p_map_m) const {
  return p_map_m.array() / Eigen::Array3d(x_options.voxel_m, x_options.voxel_m, x_options.layer_m) +
         kGrid / 2;
}

StaticVoxels::Mask StaticVoxels::bitOf(const Voxel& voxel) {
  return Mask(1) << ((voxel.x & 3) | (voxel.y & 3) << 2 | (voxel.z & 3) << 4);
}

StaticVoxels::Voxel StaticVoxels::voxelIn(const Voxel& corner, Mask bit) {
  const auto place = static_cast<std::uint32_t>(bitsIn(bit - 1));
  return {corner.x | (place & 3), corner.y | (place >> 2 & 3), corner.z | place >> 4};
}

std::uint32_t StaticVoxels::numberOf(const Block& block, Mask bit) {
  return block.first_count + static_cast<std::uint32_t>(bitsIn(block.holds & (bit - 1)));
}

void StaticVoxels::mark(const Cloud& scan_body, const Pose& T_map_body) {
  requireFinite(T_map_body);
  if (!x_marking) throw std::logic_error("StaticVoxels: mark() all scans before endMarking()");
  std::pair<const std::uint64_t, Column>* last = nullptr;  // points of a scan come column by column
  for (std::size_t i = 0; i < scan_body.size(); ++i) {
    const Eigen::Array3d at = inGrid(T_map_body * scan_body.point(i).cast<double>());
    if (!isInGrid(at)) continue;
    const auto voxel = voxelAt<Voxel>(at);
    const std::uint64_t key = columnKey(voxel.x >> 2, voxel.y >> 2);
    if (last == nullptr || last->first != key) last = &*x_columns.try_emplace(key).first;
    Column& column = last->second;
    const std::uint32_t z_block = voxel.z >> 2;
    if (column.blocks.empty()) column.lowest = z_block;
    if (z_block < column.lowest) {
      column.blocks.insert(column.blocks.begin(), column.lowest - z_block, {});
      column.lowest = z_block;
    }
    if (z_block - column.lowest >= column.blocks.size()) column.blocks.resize(z_block - column.lowest + 1);
    column.blocks[z_block - column.lowest].holds |= bitOf(voxel);
  }
}

void StaticVoxels::endMarking() {
  std::size_t voxels = 0;
  for (auto& [key, column] : x_columns)
    for (Block& block : column.blocks) {
      block.first_count = static_cast<std::uint32_t>(voxels);
      voxels += bitsIn(block.holds);
    }
  x_counts.resize(voxels);
  x_marking = false;
}

void StaticVoxels::lookAlong(Window& window, const Eigen::Array3d& sensor, const Eigen::Array3d& end,
                             double length_m, double end_m) const {
  const double last_m = std::min(length_m - end_m, x_options.range_m);
  if (!(last_m > x_options.near_m)) return;
  // A step is as long as a voxel is wide: of what it cuts only a corner of, a ray proves little.
  const Eigen::Array3d step = (end - sensor) * (x_options.voxel_m / length_m);
  Eigen::Array3d at = sensor + (end - sensor) * (x_options.near_m / length_m);
  const int steps = static_cast<int>((last_m - x_options.near_m) / x_options.voxel_m);
  for (int k = 0; k <= steps; ++k, at += step) {
    const auto voxel = voxelAt<Voxel>(at);
    const Window::Here here = window.at(voxel);
    if (here.block != nullptr && (bitOf(voxel) & here.block->holds) != 0) window.seeThrough(here, voxel);
  }
}

StaticVoxels::Seen StaticVoxels::look(const Cloud& scan_body, const Pose& T_map_body,
                                      const Eigen::Vector3d& p_body_sensor_m) const {
  requireFinite(T_map_body);
  if (!p_body_sensor_m.allFinite()) throw std::invalid_argument("StaticVoxels: the sensor is not finite");
  if (x_marking) throw std::logic_error("StaticVoxels: look() after endMarking()");
  Seen seen;
  const Eigen::Array3d sensor = inGrid(T_map_body * p_body_sensor_m);
  if (!isInGrid(sensor)) return seen;
  const auto reach_blocks = static_cast<std::uint32_t>(x_options.range_m / (4 * x_options.voxel_m)) + 2;
  Window window(x_columns, voxelAt<Voxel>(sensor), reach_blocks);

  // A sloping road rises within a voxel, by this much above its middle.
  const Eigen::Vector3d up_map = T_map_body.linear().col(2);
  const double slope = up_map.z() > 0 ? std::min(up_map.head<2>().norm() / up_map.z(), kSteepest) : kSteepest;
  const double clear_m = kRough_m + x_options.layer_m + 0.5 * slope * x_options.voxel_m;
  std::vector<std::uint32_t> far;  // hits outside the window
  for (std::size_t i = 0; i < scan_body.size(); ++i) {
    const Eigen::Vector3d p_body_m = scan_body.point(i).cast<double>();
    const Eigen::Array3d end = inGrid(T_map_body * p_body_m);
    if (!isInGrid(end)) continue;
    const auto voxel = voxelAt<Voxel>(end);
    const Mask bit = bitOf(voxel);
    if (const Window::Here here = window.at(voxel); here.block != nullptr) {
      if ((bit & here.block->holds) != 0) {
        if (!window.hit(here, bit)) continue;  // rays that end in one voxel go one way
        seen.hit.push_back(numberOf(*here.block, bit));
      }
    } else if (const Block* block = blockOf(x_columns, voxel);
               block != nullptr && (bit & block->holds) != 0) {
      far.push_back(numberOf(*block, bit));
    }
    const Eigen::Vector3d ray_m = p_body_m - p_body_sensor_m;
    const double length_m = ray_m.norm(), longest_m = x_options.end_share * length_m;
    const double fall = std::abs(ray_m.z());
    const double grazing_m = clear_m < x_options.end_share * fall ? clear_m * length_m / fall : longest_m;
    lookAlong(window, sensor, end, length_m, std::max(x_options.end_m, grazing_m));
  }
  std::sort(far.begin(), far.end());
  seen.hit.insert(seen.hit.end(), far.begin(), std::unique(far.begin(), far.end()));

  for (const auto& [corner, here] : window.through())
    forEachBit(window.missed(here), [&, &corner = corner, &here = here](Mask bit) {
      const Voxel voxel = voxelIn(corner, bit);
      if (!anyAround(voxel, 0, [&](const Voxel& near) { return window.isHit(near); }))
        seen.through.push_back(numberOf(*here.block, bit));
    });
  return seen;
}

void StaticVoxels::count(const Seen& seen) {
  for (const std::uint32_t voxel : seen.hit) increase(x_counts[voxel].hits);
  for (const std::uint32_t voxel : seen.through) increase(x_counts[voxel].passes);
}

StaticVoxels::Count StaticVoxels::countOf(const Voxel& voxel) const {
  const Block* block = blockOf(x_columns, voxel);
  if (block == nullptr || (block->holds & bitOf(voxel)) == 0) return {};
  return x_counts[numberOf(*block, bitOf(voxel))];
}

bool StaticVoxels::outweighHits(double passes, const Voxel& voxel) const {
  const auto isHitAsOften = [&](const Voxel& near) {
    return passes <= x_options.passes_per_hit * countOf(near).hits;
  };
  return !isHitAsOften(voxel) && !anyAround(voxel, 1, isHitAsOften);
}

bool StaticVoxels::isSeenThrough(const Voxel& voxel) const {
  const int passes = countOf(voxel).passes;
  return passes >= x_options.min_passes && outweighHits(passes, voxel);
}

bool StaticVoxels::hasMoved(const Voxel& voxel) const {
  const Count count = countOf(voxel);
  if (count.hits == 0 || !outweighHits((count.passes + 1) / kEdgeShare, voxel)) return false;
  if (isSeenThrough(voxel)) return true;
  int moved = 0;
  return anyAround(voxel, kEdgeLayers,
                   [&](const Voxel& near) { return isSeenThrough(near) && ++moved == kMovedAround; });
}

void StaticVoxels::endCounting() {
  for (auto& [key, column] : x_columns)
    for (std::size_t k = 0; k < column.blocks.size(); ++k) {
      Block& block = column.blocks[k];
      const Voxel corner{static_cast<std::uint32_t>(key >> 32) << 2, static_cast<std::uint32_t>(key) << 2,
                         (column.lowest + static_cast<std::uint32_t>(k)) << 2};
      forEachBit(block.holds, [&](Mask bit) {
        if (hasMoved(voxelIn(corner, bit))) block.moved |= bit;
      });
    }
}

bool StaticVoxels::isStatic(const Eigen::Vector3d& p_map_m) const {
  const Eigen::Array3d at = inGrid(p_map_m);
  if (!isInGrid(at)) return true;
  const auto voxel = voxelAt<Voxel>(at);
  const Block* block = blockOf(x_columns, voxel);
  return block == nullptr || (block->moved & bitOf(voxel)) == 0;
}

Cloud StaticVoxels::staticPart(const Cloud& cloud, const Pose& T_map_cloud) const {
  Cloud part;
  for (std::size_t i = 0; i < cloud.size(); ++i) {
    if (!isStatic(T_map_cloud * cloud.point(i).cast<double>())) continue;
    if (cloud.intensity.empty())
      part.push(cloud.point(i));
    else
      part.push(cloud.point(i), cloud.intensity[i]);
  }
  return part;
}

}  // namespace raceloc
