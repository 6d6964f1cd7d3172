/** \file
 * How sharp a map is, measured on its own walls. */
#pragma once

#include <cstddef>
#include <cstdint>
#include <unordered_map>

#include "core/types.h"

namespace raceloc {

struct WallThickness {
  double median_m;    ///< of the cells' standard deviations across the wall; 0 when there is no cell
  double p90_m;       ///< nine cells of ten are thinner
  std::size_t cells;  ///< flat, upright pieces of surface that were measured
};

/** Cuts the points (not thinned, all scans together) into cubes of `cell_m`; a cube with 30 points
 * or more whose smallest eigenvalue is below a tenth of the middle one and whose normal is within 10 deg of
 * the horizontal is a piece of wall, and the square root of the smallest eigenvalue is its thickness.
 * Roughness of a real wall, range noise and misalignment of the scans all show in it. Memory grows with the map. */
class WallSharpness {
 public:
  explicit WallSharpness(double cell_m = 0.5) : x_cell_m(cell_m) {}
  /** Points that are not finite or 2^20 cubes away are passed over. \param points_map  map frame [m] */
  void add(const Cloud& points_map);
  [[nodiscard]] WallThickness thickness() const;

 private:
  struct Cell {
    std::size_t points = 0;
    Eigen::Vector3d sum = Eigen::Vector3d::Zero();      ///< from the cube's corner [m]
    Eigen::Matrix3d squares = Eigen::Matrix3d::Zero();  ///< [m^2]
  };
  double x_cell_m;
  std::unordered_map<std::uint64_t, Cell> x_cells;
};

}  // namespace raceloc
