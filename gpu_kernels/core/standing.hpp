/** \file
 * Ground or not, by the heights in the cells of a plane. Neither the cell of a point nor a comparison depends on how
 * products are contracted: every device keeps the same points. */
#pragma once

#include <cfloat>
#include <cmath>
#include <cstdint>
#include <utility>

#include "core/cell.hpp"
#include "core/scalar.hpp"
#include "core/voxel_grid.hpp"
#include "raceloc/gpu/standing.h"

namespace raceloc::gpu {

/** Cells of a square about the origin. */
struct StandingGrid {
  KeyLayout layout;
  float cells_per_m, max_range_m;

  static StandingGrid of(const StandingOptions& options) {
    StandingGrid grid{{}, 1 / options.cell_m, options.max_range_m};
    const std::int32_t low = grid.index(-options.max_range_m), high = grid.index(options.max_range_m);
    grid.layout = KeyLayout::of({low, low, 0}, {high, high, 0});
    return grid;
  }

  /** \return false if a point is not finite or out of range. */
  [[nodiscard]] RACELOC_HD bool cellOf(float x, float y, float z, Cell& cell) const {
    if (!(fabsf(x) < max_range_m && fabsf(y) < max_range_m && fabsf(z) <= FLT_MAX)) return false;
    cell = {index(x), index(y), 0};
    return true;
  }

  /** Key of a point's cell; a point without one gets the key after all others, 2^bits. */
  [[nodiscard]] RACELOC_HD std::uint64_t key(float x, float y, float z) const {
    Cell c{};
    return cellOf(x, y, z, c) ? layout.key(c) : std::uint64_t{1} << layout.bits;
  }

 private:
  [[nodiscard]] RACELOC_HD std::int32_t index(float x) const { return floorToInt(product(x, cells_per_m)); }
};

/** What is found in one cell above its lowest point. */
struct StandingCell {
  float lowest_m, highest_m;
  std::int32_t within = 0, standing = 0;
  CentroidSum sum;
  std::int32_t high = 0;
  CentroidSum high_sum;

  RACELOC_HD explicit StandingCell(float lowest) : lowest_m(lowest), highest_m(lowest) {}

  /** \return whether the point stands, if something does in this cell */
  RACELOC_HD bool add(const PointsView& p, std::size_t i, const StandingOptions& options) {
    const float above_m = p.z[i] - lowest_m;
    if (!(above_m <= options.reach_m)) return false;
    ++within;
    highest_m = p.z[i] > highest_m ? p.z[i] : highest_m;
    if (!(above_m > options.foot_m)) return false;
    ++standing;
    sum.add(p, i);
    return true;
  }

  /** Of a cell that stands, when all its points were added. \return whether this one stands */
  RACELOC_HD bool addHigh(const PointsView& p, std::size_t i, const StandingOptions& options) {
    const float above_m = p.z[i] - lowest_m;
    if (!(above_m <= options.reach_m && above_m > options.foot_m)) return false;
    if (above_m >= 0.5F * (highest_m - lowest_m)) {
      ++high;
      high_sum.add(p, i);
    }
    return true;
  }

  [[nodiscard]] RACELOC_HD bool stands(const StandingOptions& options) const {
    return within >= options.min_points && highest_m - lowest_m >= options.min_spread_m && standing > 0;
  }
};

inline void clear(StandingCells& cells) {
  for (Points* points : {&cells.face, &cells.upper})
    for (auto* axis : {&points->x, &points->y, &points->z}) axis->clear();
  cells.lowest_m.clear();
  cells.highest_m.clear();
  cells.standing.clear();
}

inline void append(StandingCells& cells, const Vec3<float>& face, const Vec3<float>& upper, float lowest_m,
                   float highest_m, std::int32_t standing) {
  for (const auto& [points, p] : {std::pair(&cells.face, &face), std::pair(&cells.upper, &upper)}) {
    points->x.push_back(p->x);
    points->y.push_back(p->y);
    points->z.push_back(p->z);
  }
  cells.lowest_m.push_back(lowest_m);
  cells.highest_m.push_back(highest_m);
  cells.standing.push_back(standing);
}

}  // namespace raceloc::gpu
