/** \file
 * The line that a driver takes round a circuit. */
#pragma once

#include <vector>

#include "track/track.h"

namespace raceloc {

/** The line that bends least between the edges: the sum of squared second differences of its points at equal steps of
 * the centre line is minimal under n in [margin - right, left - margin], by Ceres. That is its curvature up to the
 * stretch between line and centre line. Closed and twice continuously differentiable.
 * Source: Heilmeier et al., Vehicle System Dynamics 58 (2020): minimum curvature as least squares. */
class RacingLine {
 public:
  /** \param margin_m  from the car's centre line to the edges; where the road is narrower than twice that, the
   * line keeps to its middle */
  RacingLine(const Track& track, double margin_m);
  /** A line as it is given. \param n_m  8 offsets or more to the left of the centre line, at equal steps of it from the
   * start line on \throws std::invalid_argument for fewer */
  RacingLine(const Track& track, const std::vector<double>& n_m);

  struct Point {
    double n_m;              ///< offset to the left of the centre line
    double direction_rad;    ///< of the line against the surface's x axis at (s, n)
    double stretch;          ///< metres of the line per metre of the centre line
    double curvature_per_m;  ///< in the surface, positive to the left
    double dip_per_m;        ///< out of the surface: positive where the road curves upward under the car
  };
  [[nodiscard]] Point at(double s_m) const;

 private:
  PeriodicSpline<1> x_offset_m;
  PeriodicSpline<4> x_shape;  ///< direction, stretch, curvature, dip
};

}  // namespace raceloc
