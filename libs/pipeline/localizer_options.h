/** \file
 * What can be set of the localizer. */
#pragma once

#include <Eigen/Core>
#include <optional>
#include <string>
#include <vector>

#include "core/options.h"
#include "fusion/history.h"
#include "fusion/integrity.h"
#include "pipeline/matching_options.h"
#include "pipeline/track_surface.h"
#include "registration/search.h"
#include "wall/guard.h"
#include "wall/wall_detector.h"

namespace raceloc {

/** Section [localizer]. */
struct LocalizerPolicy {
  double map_radius_m = 100;
  double output_period_s = 0.01;
  double match_delay_s = 0.03;
  double max_fix_age_s = 0.3;
  double min_course_speed_mps = 3.0;
  double course_sigma_deg = 2.0;
  double gps_min_sigma_m = 0.05;
  double start_patience_s = 3.0;
  int search_after = 5;
  double line_lookahead_s = 0.4;
  void describe(OptionList& keys);
};

/** Section [trial]: what a source says is made worse on purpose, as in the paper's experiment. */
struct TrialOptions {
  std::string noise_labels;
  double noise_m = 5;
  double noise_after_s = 2;
  int noise_seed = 1;
  void describe(OptionList& keys);
};

struct LocalizerOptions {
  MatchingOptions matching;
  EstimatorOptions estimator;
  HistoryOptions history;
  IntegrityOptions integrity;
  TrackSurfaceOptions surface;
  LocalizerPolicy policy;
  SearchOptions search;
  TrialOptions trial;
  WallOptions wall;
  WallPathOptions wall_path;
  GuardOptions guard;
  /** The line that the car is told to drive, in the order of driving; none: it is told none. z is not used: heights are
   * those of the map's road. */
  std::optional<std::vector<Eigen::Vector3d>> race_line_map_m;
};

}  // namespace raceloc
