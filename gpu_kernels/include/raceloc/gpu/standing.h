/** \file
 * What stands on the ground: cells of a plane in which points are stacked. */
#pragma once

#include <cstdint>
#include <vector>

#include "raceloc/gpu/context.h"
#include "raceloc/gpu/types.h"

namespace raceloc::gpu {

struct StandingOptions {
  float cell_m = 0.5F;        ///< edge of a cell of the x-y plane
  float min_spread_m = 0.4F;  ///< heights in a cell that spread less are ground
  float foot_m = 0.15F;  ///< points that are not higher above the lowest of their cell are ground in any case
  float reach_m = 1.5F;  ///< points higher above it are not looked at: a bridge stands elsewhere
  int min_points = 3;    ///< within reach, the lowest one included
  float max_range_m = 80;  ///< nor those with a larger |x| or |y|
};

/** Cells in which something stands, in ascending order of (y, x) cell. */
struct StandingCells {
  Points face;                         ///< mean of the points that stand
  Points upper;                        ///< mean of those of them in the upper half of the cell's heights
  std::vector<float> lowest_m;         ///< z of the lowest point of the cell
  std::vector<float> highest_m;        ///< z of the highest one within reach
  std::vector<std::int32_t> standing;  ///< how many points stand
  [[nodiscard]] std::size_t size() const { return face.size(); }
};

/** Votes of points on a grid (paper, eq. (hash_table)); but not their number decides, it is the spread of heights, so
 * that a slope of less than about min_spread_m / (1.4 cell_m) is ground however dense, and a wall that three beams see
 * is none however far. Points that are not finite are dropped. The same bits on every device.
 * \param is_standing  may be null; else of each point 1 if it stands, 0 if it is ground or was dropped
 * \param into  what is no longer needed: its memory is used again
 * \throws std::invalid_argument if an option is not > 0 and finite, or max_range_m not within 2^14 cells. */
[[nodiscard]] StandingCells standingCells(Context& context, const PointsView& points,
                                          const StandingOptions& options,
                                          std::vector<std::uint8_t>* is_standing = nullptr,
                                          StandingCells into = {});

}  // namespace raceloc::gpu
