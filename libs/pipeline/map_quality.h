/** \file
 * How sharp a map is, measured on its own walls. */
#pragma once

#include <cstddef>

#include "core/types.h"

namespace raceloc {

struct WallThickness {
  double median_m;    ///< of the cells' standard deviations across the wall; 0 when there is no cell
  double p90_m;       ///< nine cells of ten are thinner
  std::size_t cells;  ///< flat, upright pieces of surface that were measured
};

/** Cuts the points (map frame, not thinned, all scans together) into cubes of `cell_m`; a cube with 30 points
 * or more whose smallest eigenvalue is below a tenth of the middle one and whose normal is within 10 deg of
 * the horizontal is a piece of wall, and the square root of the smallest eigenvalue is its thickness.
 * Roughness of a real wall, range noise and misalignment of the scans all show in it. */
[[nodiscard]] WallThickness wallThickness(const Cloud& points_map, double cell_m = 0.5);

}  // namespace raceloc
