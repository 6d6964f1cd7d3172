/** \file
 * Localization of a whole log: what `raceloc-live` runs. */
#pragma once

#include <functional>
#include <map>
#include <optional>
#include <string>

#include "core/trajectory.h"
#include "pipeline/localizer.h"

namespace raceloc {

/** Section [live]. */
struct LiveOptions {
  std::string disable_labels;
  double disable_after_s = 1.0;
  int output_gzip_level = 0;
  std::string map_hash;
  double map_reach_m = 1000;
  void describe(OptionList& keys);
};

struct ReplayOptions {
  LocalizerOptions localizer;
  LiveOptions live;
  /** \throws InputError as IniFile does. */
  static ReplayOptions fromIni(const std::string& path);
  [[nodiscard]] std::string iniText() const;
};

/** What the car would have to know after a run. */
struct ReplayReport {
  std::string device_reason;
  double first_s, recorded_s;
  std::optional<StartReport> start;
  std::size_t scans, trusted_matches, outputs, alarms, resets, searches, disabled_samples, dropped_late,
      tile_loads, without_wheels, passed_over;
  std::size_t rule_counts[5];                 ///< decisions by GateRule; [0] is unused
  std::size_t state_counts[4];                ///< outputs by LocalizationState
  std::map<std::string, std::size_t> causes;  ///< outputs that were not ok, by cause
  FaultCounts faults;  ///< outputs that did without a source; scans that were passed over
  double match_residual_m, match_inlier_share, match_iterations;  ///< medians over the trusted matches
  double match_p99_s, match_median_s;  ///< wall time from a sweep's samples to its pose
  Trajectory trajectory;
};

/** Runs a log through the localizer, in order of its stamps, as fast as it goes.
 * \param output_path  annotated rawlog, see AnnotatedLog; empty: none
 * \throws InputError for a log or map that cannot be read, a map without georeference, of another hash or of another
 * place (see map_check.h), a log without a LiDAR of the configured label, without a GPS to start from, or one in which
 * no start was found. */
[[nodiscard]] ReplayReport replay(const std::string& log_path, const std::string& map_path,
                                  const std::string& output_path, const ReplayOptions& options,
                                  const std::function<void(double)>& progress);

/** What odometry without a map tells. */
struct OdometryReport {
  std::string device_reason;
  double recorded_s;
  OdometryTally odometry;
  std::size_t dropped_late;
  CalibrationVector calibration, calibration_sigma;
  Trajectory trajectory;       ///< in the frame of the first scan's body, turned level where that is known
  std::optional<Level> level;  ///< at the end; none without an accelerometer
};

/** LIV odometry of a log, without a map. \throws InputError for a log that cannot be read or has no scan of the
 * configured label. */
[[nodiscard]] OdometryReport replayOdometry(const std::string& log_path, const ReplayOptions& options,
                                            const std::function<void(double)>& progress);

}  // namespace raceloc
