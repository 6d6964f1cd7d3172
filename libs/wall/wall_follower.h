/** \file
 * A path along a wall that goes on from scan to scan. */
#pragma once

#include <optional>
#include <vector>

#include "wall/wall_path.h"

namespace raceloc {

/** What a tracker is given while the guard says that the wall leads.
 *
 * The way to the gap is planned once (planAlong()), when a wall or a gap is new, and kept as what it adds to the wall's
 * own line, by the way driven; the line itself is that of each new scan. A plan that began at the car in each scan would
 * correct what the tracker corrects already, a scan's age later: at 60 m/s the two swing up. One that went on smoothly
 * from the path before would follow a wall that begins or ends to bend too late. */
class WallFollower {
 public:
  explicit WallFollower(const WallPathOptions& options) : x_options(options) {}

  /** \param seen             of the newest scan, body frame
   * \param gap_m            to come to, and keep
   * \param speed_mps        forward
   * \param curvature_per_m  of the car's way now
   * \param course_rad       of the car's way against its x axis: where a plan begins to lead
   * \param moved_m          way since the scan before
   * \return a path from the car on, in the body frame: it may begin beside the car
   * \throws std::invalid_argument as planAlong() does */
  [[nodiscard]] Path follow(const Wall& seen, double gap_m, double speed_mps, double curvature_per_m,
                            double course_rad, double moved_m);
  /** The next wall is a new one. */
  void restart() { x_side.reset(); }

 private:
  /** What the plan adds to the wall's line. */
  struct Shift {
    double s_m;          ///< along the plan
    double clearance_m;  ///< from the wall
    double heading_rad, curvature_per_m;
  };
  [[nodiscard]] Shift shiftAt(double s_m) const;
  void plan(const Wall& wall, double gap_m, double speed_mps, double curvature_per_m, double course_rad);

  WallPathOptions x_options;
  std::optional<Side> x_side;
  double x_gap_m = 0, x_driven_m = 0;
  std::vector<Shift> x_shifts;  ///< at least one; the last one stays
};

}  // namespace raceloc
