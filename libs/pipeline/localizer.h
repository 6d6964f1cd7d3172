/** \file
 * One sample at a time to poses and verdicts: scan match against the map, GPS/INS, dead reckoning, gate,
 * filter. */
#pragma once

#include <raceloc/gpu/context.h>

#include <deque>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "fusion/fusion_filter.h"
#include "fusion/integrity.h"
#include "map/tile_query.h"
#include "odometry/scan_queue.h"
#include "pipeline/matching_options.h"
#include "registration/search.h"

namespace raceloc {

/** Section [localizer]. */
struct LocalizerPolicy {
  double map_radius_m = 100;
  double max_fix_age_s = 0.3;
  double match_alive_s = 0.5;
  double min_course_speed_mps = 3.0;
  double course_sigma_deg = 2.0;
  double gps_min_sigma_m = 0.1;
  double dead_reckoning_period_s = 0.25;
  double start_patience_s = 3.0;
  void describe(OptionList& keys);
};

struct LocalizerOptions {
  MatchingOptions matching;
  FusionOptions fusion;
  GateOptions gate;
  LocalizerPolicy policy;
  SearchOptions search;
};

/** How the filter came by its first pose. */
struct StartReport {
  double stamp_s;
  std::string receiver;   ///< whose fix it started from
  bool by_match;          ///< a scan match found the car near the fix; false: the fix alone
  double match_to_fix_m;  ///< horizontal distance between the two; 0 without a match
};

/** One sweep, of one LiDAR or several, held against the map. */
struct ScanMatch {
  Registration match;
  bool trusted;
  Cloud scan_body;  ///< de-skewed, thinned: for pictures
};

/** The estimate at one instant, and why it is what it is. */
struct LocalizerOutput {
  double stamp_s;
  Pose T_map_body;
  Matrix6d covariance;  ///< right increment (rad, m); height, roll and pitch from the last trusted match
  bool by_wheels;       ///< false: speed and yaw rate were missing and the last ones went on
  FaultCounts faults;   ///< of sources and scans, since the last output
  std::vector<PoseFix> fixes;            ///< what the sources said, carried forward to stamp_s
  std::optional<GateDecision> decision;  ///< none: dead reckoning, no source was due
  std::optional<ScanMatch> scan_match;   ///< when a sweep was matched
  Integrity integrity;
};

/** Localization on a map. Samples come in order of time; outputs are in order of time.
 *
 * A decision is taken at the end of each sweep, from its match and of each receiver the newest fix younger than
 * max_fix_age_s, carried forward by dead reckoning; each fix is used once. When no sweep waits and no match was
 * believed for match_alive_s, each fix is decided on alone, at its own stamp.
 * Start: a fix with a heading (the receiver's INS, or the course between two fixes at speed) says where to look, and
 * a scan match found around it says where the car is; only when no match is found for start_patience_s does the fix
 * start the filter alone. Before that there is no output. Source: reading.md sections 1, 2 and 6. */
class Localizer {
 public:
  /** Keeps references to context and map. \throws InputError if the gate's options contradict each other. */
  Localizer(gpu::Context& context, const MapFile& map, const LocalizerOptions& options);

  [[nodiscard]] std::vector<LocalizerOutput> add(const Sample& sample);
  [[nodiscard]] std::vector<LocalizerOutput> finish();  ///< what still waits, at the end of the stream

  [[nodiscard]] bool started() const { return x_filter.has_value(); }
  [[nodiscard]] const std::optional<StartReport>& startReport() const { return x_start; }
  [[nodiscard]] std::size_t passedOver() const {
    return x_passed_over;
  }  ///< sweeps that ended before the estimate's time
  [[nodiscard]] std::size_t tileLoads() const { return x_window.rebuilds(); }

 private:
  struct TimedFix {
    double stamp_s;
    PoseFix body;
  };
  struct Receiver {
    std::deque<TimedFix> unused;     ///< that no decision has seen, in order of time; the last ones only
    std::optional<GpsFix> previous;  ///< the one before: for the course
    std::optional<InsPose> ins;      ///< newest
  };

  void take(const GpsFix& fix, std::vector<LocalizerOutput>& outputs);
  void take(const InsPose& pose, std::vector<LocalizerOutput>& outputs);
  void take(const ImuSample& sample, std::vector<LocalizerOutput>& outputs);
  void take(const MotionSample& sample, std::vector<LocalizerOutput>& outputs);
  void take(const Scan& scan, std::vector<LocalizerOutput>& outputs);

  /** The body's pose by a fix, from its antenna and heading; none while the filter waits for a heading to
   * start. */
  [[nodiscard]] std::optional<PoseFix> bodyFix(const GpsFix& fix, const Receiver& receiver) const;
  /** Keeps the fix as the place to look for the car; starts from it alone when patience is at an end. */
  void considerStart(const GpsFix& fix, const PoseFix& body);
  /** Looks for the car around the fix of considerStart(). */
  void tryStart(const Sweep& sweep, std::vector<LocalizerOutput>& outputs);
  void start(double stamp_s, const Pose& T_map_body, StartReport report);
  /** The car's motion by its wheels; where they say nothing, at the last speed and yaw rate. */
  [[nodiscard]] BodyMotion motionBetween(double from_s, double to_s) const;
  /** Dead reckoning to a later instant. */
  void predictTo(double stamp_s);
  [[nodiscard]] LocalizerOutput decide(double stamp_s, std::vector<PoseFix> fixes,
                                       std::optional<ScanMatch> scan_match);
  [[nodiscard]] LocalizerOutput matchSweep(const Sweep& sweep);
  void process(const Sweep& sweep, std::vector<LocalizerOutput>& outputs);
  [[nodiscard]] CovarianceCloud prepared(const Sweep& sweep);
  /** Of each receiver the newest unused fix that is not newer than the filter's time, carried forward to it,
   * if it is young enough; it and all older ones count as used. */
  [[nodiscard]] std::vector<PoseFix> takeFixes();
  [[nodiscard]] LocalizerOutput output();

  struct StartPlace {
    double first_fix_s;  ///< when waiting began
    double stamp_s;
    std::string receiver;
    Pose T_map_body;
  };
  struct BelievedMatch {
    double stamp_s;
    Pose T_map_body;
    Matrix6d covariance;
  };
  // What is aligned to 16 bytes comes first: less padding.
  std::optional<FusionFilter> x_filter;
  /** Planar part from the filter, the rest from the last trusted match. */
  Pose x_T_map_body = Pose::Identity();
  std::optional<StartPlace> x_start_place;
  std::optional<BelievedMatch> x_last_match;
  MotionHistory x_history;
  gpu::Context& x_context;
  double x_stamp_s = 0;  ///< the filter's time
  std::size_t x_passed_over = 0;
  MotionHistory::Rates x_last_rates{0, 0};
  std::map<std::string, Receiver> x_receivers;
  std::optional<StartReport> x_start;
  ScanQueue x_queue;
  SweepPreparer x_preparer;
  LocalizerOptions x_options;
  TileWindow x_window;
  bool x_by_wheels = true;
};

}  // namespace raceloc
