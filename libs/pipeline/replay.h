/** \file
 * Localization of a log or of a live run: what `raceloc-live` runs. */
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
  std::string stream;
  int queue_length = 400;
  double silent_after_s = 1.0;
  void describe(OptionList& keys);
};

struct ReplayOptions {
  ReplayOptions();
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
  std::size_t guard_counts[4];                ///< sweeps by GuardState
  std::size_t walls_left, walls_right;        ///< sweeps in which one was seen
  std::map<std::string, std::size_t> causes;  ///< outputs that were not ok, by cause
  FaultCounts faults;  ///< outputs that did without a source; scans that were passed over
  double match_residual_m, match_inlier_share, match_iterations;  ///< medians over the trusted matches
  double match_max_s, match_p99_s, match_median_s;  ///< wall time of preparation and match of a sweep
};

/** Hears of each output while a run goes on. */
using Listener = std::function<void(const LocalizerOutput&)>;
/** Is told the share of a log that is done, 0..1. \return false: the log shall end here */
using GoOn = std::function<bool(double)>;

/** Looks a log through for what it has to hold before it is localized.
 * \param progress  as of summarizeRawlog()
 * \throws InputError for a log that cannot be read, one without a LiDAR, vehicle or GPS of the configured labels, with
 * several clocks, or without what shall be switched off. */
[[nodiscard]] LogSummary requirePlayable(const std::string& log_path, const ReplayOptions& options,
                                         const std::function<void(double)>& progress);
/** The same for odometry: neither vehicle nor GPS has to be there, if it is not named. */
[[nodiscard]] LogSummary requireScans(const std::string& log_path, const ReplayOptions& options,
                                      const std::function<void(double)>& progress);

/** Runs a log through the localizer, in order of its stamps, as fast as it goes.
 * \param log          of requirePlayable()
 * \param output_path  annotated rawlog, see AnnotatedLog; empty: none
 * \throws InputError for a log that cannot be read any more, a map that cannot be read, has no georeference, or is of
 * another hash or place (map_check.h), and for a log in which no start was found. */
[[nodiscard]] ReplayReport replay(const LogSummary& log, const std::string& map_path,
                                  const std::string& output_path, const ReplayOptions& options,
                                  const GoOn& go_on, const Listener& listen = {});

/** A run that goes on while its observations come. */
struct LiveInput {
  LogHeader header;                     ///< as that of the log of it
  std::vector<std::string> gps_labels;  ///< of the receivers that may come
  NextObservation next;                 ///< waits
};

/** Runs observations through the localizer as they come. replay() is the same loop behind the same LogReader: of a log
 * that holds the observations in the order in which `next` gave them, below the same header, it makes the same
 * estimates and the same annotated log, bit for bit. It may find no start: then the report has none.
 * \throws InputError for a map that cannot be read or has no georeference, and what `next` throws; what came before is
 * then in no file. */
[[nodiscard]] ReplayReport localizeLive(const LiveInput& input, const std::string& map_path,
                                        const std::string& output_path, const ReplayOptions& options,
                                        const Listener& listen);

/** Origin of a map's frame. \throws InputError if it cannot be read or has no georeference. */
[[nodiscard]] GeodeticPoint originOf(const std::string& map_path);

/** What odometry without a map tells. */
struct OdometryReport {
  std::string device_reason;
  double recorded_s;
  OdometryTally odometry;
  std::size_t dropped_late;
  CalibrationVector calibration, calibration_sigma;
  std::optional<Level> level;  ///< at the end; none without an accelerometer
  /** `odom` is the body's frame at the first scan, `map` that turned about its origin so that its z axis is up, as the
   * last pose knows it; the same where nothing tells. */
  Pose T_map_odom;
};

/** LIV odometry of a log, without a map.
 * \param log     of requireScans()
 * \param listen  hears of each T_odom_body as it comes
 * \throws InputError for a log that cannot be read any more. */
[[nodiscard]] OdometryReport replayOdometry(const LogSummary& log, const ReplayOptions& options,
                                            const GoOn& go_on,
                                            const std::function<void(const StampedPose&)>& listen);

}  // namespace raceloc
