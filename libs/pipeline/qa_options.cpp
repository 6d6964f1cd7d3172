#include "pipeline/qa_options.h"

namespace raceloc {

void QaOptions::describe(OptionList& keys) {
  keys.add("max_wall_thickness_m", max_wall_thickness_m, above(0),
           "a map fails above: standard deviation across its walls, median [m]");
  keys.add("max_gps_rmse_m", max_gps_rmse_m, above(0),
           "a map fails above: distance of the fixes that were not refused, rmse [m]");
  keys.add("max_refused_share", max_refused_share, between(0, 1),
           "a map fails above: share of refused fixes");
  keys.add("max_loop_residual_m", max_loop_residual_m, above(0),
           "a map fails above: distance of the loops from it, median [m]");
  keys.add("min_passes", min_passes, {1, 1000}, "a map fails below: passes over each station");
  keys.add("max_gap_m", max_gap_m, above(0), "key poses farther apart than this are not one pass [m]");
  keys.add("max_way_without_fix_m", max_way_without_fix_m, above(0),
           "a map fails above: way without a believed fix (on a lap: on any pass), where only the LiDAR "
           "holds it [m]");
  keys.add("min_road_share", min_road_share, between(0, 1),
           "a map fails below: share of stations with a road");
  keys.add("min_wall_share", min_wall_share, between(0, 1),
           "a map fails below: share of stations with a wall, left or right");
  keys.add(
      "degenerate_sigma_m", degenerate_sigma_m, above(0),
      "a station is degenerate above: sigma of the odometry between two key poses, weakest direction [m]");
  keys.add("max_degenerate_share", max_degenerate_share, between(0, 1),
           "a map fails above: share of degenerate stations");
  keys.add("degenerate_loop_sigma_m", degenerate_loop_sigma_m, above(0),
           "a loop is degenerate above: its sigma, weakest direction; such loops are listed [m]");
  keys.add("max_lever_error_m", max_lever_error_m, above(0),
           "a map fails above: error of a lever arm, as the residuals of its receiver have it [m]");
  keys.add("max_lever_sigma_m", max_lever_sigma_m, above(0),
           "the error of a lever arm is not observable above: its sigma [m]");
  keys.add("max_time_offset_s", max_time_offset_s, above(0),
           "a map fails above: offset of a receiver's stamps, as its residuals have it [s]");
  keys.add("max_time_sigma_s", max_time_sigma_s, above(0),
           "the offset of stamps is not observable above: its sigma [s]");
}

}  // namespace raceloc
