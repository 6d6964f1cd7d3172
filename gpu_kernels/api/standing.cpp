#include "raceloc/gpu/standing.h"

#include <utility>

#include "api/check.hpp"
#include "core/backend.hpp"

namespace raceloc::gpu {

StandingCells standingCells(Context& context, const PointsView& points, const StandingOptions& options,
                            std::vector<std::uint8_t>* is_standing, StandingCells into) {
  constexpr float kMostCells = 1 << 14;  // to each side: keys of 32 bits
  requirePositive("cell_m", options.cell_m);
  requirePositive("min_spread_m", options.min_spread_m);
  requirePositive("foot_m", options.foot_m);
  requirePositive("reach_m", options.reach_m);
  require(options.min_points > 0, "min_points", options.min_points, "> 0");
  requirePositive("max_range_m", options.max_range_m);
  require(options.max_range_m <= kMostCells * options.cell_m, "max_range_m", options.max_range_m,
          "within 2^14 cells");
  requireCountable(points.size);
  return context.implementation().standingCells(points, options, is_standing, std::move(into));
}

}  // namespace raceloc::gpu
