#include "pipeline/qa_options.h"

namespace raceloc {

void QaOptions::describe(OptionList& keys) {
  keys.add("max_wall_thickness_m", max_wall_thickness_m, above(0),
           "a map passes up to this standard deviation across its walls, median [m] ...");
  keys.add("max_gps_rmse_m", max_gps_rmse_m, above(0), "... this distance of believed fixes, rmse [m] ...");
  keys.add("max_refused_share", max_refused_share, between(0, 1), "... this share of refused fixes ...");
  keys.add("max_loop_residual_m", max_loop_residual_m, above(0),
           "... this distance of loops from the map, median [m] ...");
  keys.add("min_passes", min_passes, {1, 1000}, "... from so many passes over every station on ...");
  keys.add("max_gap_m", max_gap_m, above(0),
           "... each of them without key poses farther apart than this [m] ...");
  keys.add("min_road_share", min_road_share, between(0, 1),
           "... with a road at this share of the stations ...");
  keys.add("min_wall_share", min_wall_share, between(0, 1),
           "... with a wall, left or right, at this share ...");
  keys.add(
      "degenerate_sigma_m", degenerate_sigma_m, above(0),
      "... where LiDAR odometry is weaker than this in its weakest direction, from one key pose to the next, "
      "on [m] ...");
  keys.add("max_degenerate_share", max_degenerate_share, between(0, 1),
           "... no more than this share of the stations ...");
  keys.add("max_lever_error_m", max_lever_error_m, above(0),
           "... and with lever arms that the residuals put right by no more than this [m] ...");
  keys.add("max_lever_sigma_m", max_lever_sigma_m, above(0), "... if they are known to this sigma [m] ...");
  keys.add("max_time_offset_s", max_time_offset_s, above(0),
           "... as stamps are by no more than this [s] ...");
  keys.add("max_time_sigma_s", max_time_sigma_s, above(0), "... if they are known to this sigma [s]");
}

}  // namespace raceloc
