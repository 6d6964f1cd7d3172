/** \file
 * The path that keeps a set distance from a wall. */
#pragma once

#include <vector>

#include "core/options.h"
#include "wall/wall_detector.h"

namespace raceloc {

/** Of a path in the body frame at one instant; it begins at the rear axle. */
struct PathPoint {
  double s_m;  ///< along the path
  double x_m, y_m;
  double heading_rad;  ///< 0: as the car's, > 0: to the left
  double curvature_per_m;
};
using Path = std::vector<PathPoint>;

/** The arc that the car drives as it steers now: what is tracked if nobody says what. */
[[nodiscard]] Path arcPath(double curvature_per_m, double length_m);

/** Section [wall_path]. */
struct WallPathOptions {
  double gap_m = 3;
  double least_gap_m = 2;
  double step_m = 1;
  double horizon_s = 2;
  double min_length_m = 20;
  double lateral_limit_mps2 = 20;
  double shift_limit_mps2 = 6;
  double shift_limit_mps3 = 20;
  void describe(OptionList& keys);
};

/** A path beside a wall: from where the car is, smoothly, to gap_m from the wall and on along it. */
struct WallPath {
  Side side;
  double gap_m;      ///< to the wall, from the rear axle's centre
  Path points;       ///< every step_m, from the rear axle on
  double valid_m;    ///< so far along the path the wall was seen
  double settled_m;  ///< from here on it keeps the gap; may be beyond valid_m
  /** Its curvature is within lateral_limit_mps2 / v^2 and the shift keeps to its limits: false says that the car is too
   * fast for what lies ahead. */
  bool drivable;
};

/** p_w(x) of the paper, eq. (wall_path), plus a shift that begins at the car's place, heading and curvature, and ends at
 * none of the three: a quintic, as long as its curvature (shift_limit_mps2 / v^2) and curvature rate
 * (shift_limit_mps3 / v^3) ask; shorter where it would come nearer to the wall than least_gap_m and than the car is.
 * \param wall             of the newest scan
 * \param gap_m            > 0, on the car's side of the wall
 * \param speed_mps        >= 0; forward
 * \param curvature_per_m  of the car's way now: yaw rate over speed, > 0 to the left
 * \throws std::invalid_argument for a gap that is not > 0 or a speed that is not >= 0 and finite. */
[[nodiscard]] WallPath planAlong(const Wall& wall, double gap_m, double speed_mps, double curvature_per_m,
                                 const WallPathOptions& options);

}  // namespace raceloc
