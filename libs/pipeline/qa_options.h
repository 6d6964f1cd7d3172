#pragma once

#include "core/options.h"

namespace raceloc {

/** Section [qa]: what a map must keep to pass. */
struct QaOptions {
  double max_wall_thickness_m = 0.05;
  double max_gps_rmse_m = 0.10;
  double max_refused_share = 0.25;
  double max_loop_residual_m = 0.10;
  int min_passes = 1;
  double max_gap_m = 20;
  double max_way_without_fix_m = 200;
  double min_road_share = 0.95;
  double min_wall_share = 0.5;
  double degenerate_sigma_m = 0.1;
  double max_degenerate_share = 0.1;
  double degenerate_loop_sigma_m = 0.5;
  double max_lever_error_m = 0.1;
  double max_lever_sigma_m = 0.03;
  double max_time_offset_s = 0.01;
  double max_time_sigma_s = 0.003;
  void describe(OptionList& keys);
};

}  // namespace raceloc
