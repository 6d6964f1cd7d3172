/** \file
 * One sample at a time to poses and verdicts: scan match against the map, GPS/INS, dead reckoning, gate,
 * filter. */
#pragma once

#include <raceloc/gpu/context.h>

#include <future>
#include <limits>
#include <optional>
#include <random>
#include <string>
#include <vector>

#include "map/tile_query.h"
#include "odometry/scan_queue.h"
#include "pipeline/localizer_options.h"
#include "pipeline/receivers.h"
#include "wall/tracked_path.h"
#include "wall/wall_follower.h"

namespace raceloc {

/** The scan match among the sources of a decision. */
constexpr char kScanMatch[] = "scan_match";

/** How the filter came by its first pose. */
struct StartReport {
  double stamp_s;
  std::string receiver;   ///< whose fix it started from
  bool by_match;          ///< a scan match found the car near the fix; false: the fix alone
  double match_to_fix_m;  ///< horizontal distance between the two; 0 without a match
};

/** One sweep, of one LiDAR or several, held against the map. */
struct ScanMatch {
  double stamp_s;   ///< end of the sweep
  Pose T_map_body;  ///< the estimate then, after the decision
  Registration match;
  bool trusted;
  Cloud scan_body;  ///< de-skewed, thinned: for pictures
  /** Wall time of preparation and match on the other thread, the one value that no two runs share; none at the start. */
  std::optional<double> took_s;
};

/** What stands beside the car at the end of a sweep, and who should steer. */
struct WallReport {
  WallScan walls;
  GuardOutput guard;
  gpu::StandingCells cells;            ///< what is not ground, body frame
  std::vector<std::int32_t> clusters;  ///< one of each cell
};

/** The estimate at one instant, and why it is what it is. */
struct LocalizerOutput {
  double stamp_s;
  Pose T_map_body;
  Matrix6d
      covariance;  ///< right increment (rad, m); height, roll and pitch from the last trusted match or the road
  double speed_mps, yaw_rate_rps;
  bool by_wheels;      ///< false: speed and yaw rate were missing and the last ones went on
  FaultCounts faults;  ///< of sources and scans, since the last output
  Integrity integrity;
  std::optional<DatedDecision> decision;  ///< the newest since the last output
  /** All of them, in the order in which they were made, each add() after the other (FusionHistory::made()): what comes late
   * makes decisions anew. */
  std::vector<std::vector<DatedDecision>> decisions;
  std::optional<ScanMatch> scan_match;  ///< the newest since the last output
  std::optional<WallReport> walls;      ///< likewise
};

/** What the newest decision of an output says of a source; null if it had no say. */
[[nodiscard]] const SourceVerdict* verdictOn(const LocalizerOutput& output, const std::string& source);

/** Localization on a map. Samples come in the order of their arrival; outputs are in order of time.
 *
 * Output: at each sample of the car's own motion, and at any other one output_period_s after the last, extrapolated to
 * its stamp. What the motion does in the plane follows from the car's attitude, so that on a bank neither speed nor yaw
 * rate are too small. Fixes of receivers and scan matches go into a history of fixed lag as they come (history.h).
 * A sweep is prepared, matched and looked through for walls on another thread, while outputs go on. What it tells
 * enters the history when the samples' time is match_delay_s past the one at which the sweep was whole: so the same log gives
 * the same bits, however long a match takes; only when it takes longer, the outputs wait for it,
 * as they do for the start and for a search. Walls and guard are of the sweep's end.
 * Start: a fix with a heading (the receiver's INS, or the course between two fixes at speed) says where to look, and
 * a scan match found around it says where the car is; only when no match is found for start_patience_s does the fix
 * start the filter alone. Before that there is no output. After search_after matches in a row that are not trusted, the
 * car is looked for around the newest fix of a receiver in the same way; what is found counts like any match.
 * Attitude and height are those of the last believed match, moved on by the gyro; after kMatchMemory_s those of the
 * map's road. At each sweep the walls beside the car are looked for in the sweep alone, and the guard says whether to
 * drive along one: it looks along the line that the car is told (LocalizerOptions::race_line_map_m) while that is localized, else
 * along the arc that it drives. Source: reading.md sections 1, 2, 6 and 7. */
class Localizer {
 public:
  /** Keeps references to context and map; the context is its own while it is matching. \throws InputError
   * if the gate's options contradict each other, or for a race line along which the map was nowhere driven. */
  Localizer(gpu::Context& context, const MapFile& map, const LocalizerOptions& options);

  /** Both throw what a match threw. */
  [[nodiscard]] std::vector<LocalizerOutput> add(const Sample& sample);
  [[nodiscard]] std::vector<LocalizerOutput> finish();  ///< what still waits, at the end of the stream

  [[nodiscard]] bool started() const { return x_fusion.has_value(); }
  /** Whether the context is in use by a match. */
  [[nodiscard]] bool isMatching() const { return x_job.has_value(); }
  [[nodiscard]] const std::optional<StartReport>& startReport() const { return x_start; }
  /** Sweeps that ended before the start, or before the lag. */
  [[nodiscard]] std::size_t passedOver() const { return x_passed_over; }
  [[nodiscard]] std::size_t tileLoads() const { return x_window.rebuilds(); }
  [[nodiscard]] int resets() const { return started() ? x_fusion->newest().resets : 0; }  ///< by two keys
  [[nodiscard]] std::size_t searches() const {
    return x_searches;
  }  ///< for the car, after matches had failed

 private:
  struct KnownPose {
    double stamp_s;
    Pose T_map_body;
    Matrix6d covariance;
  };

  void take(const GpsFix& fix);
  void take(const InsPose& pose);
  void take(const ImuSample& sample);
  void take(const MotionSample& sample);
  void take(const Scan& scan);
  void noteDecisions();  ///< those that the last add() to the history made

  /** What is known of the car's motion while a receiver speaks. */
  [[nodiscard]] CarMotion carMotion() const;
  /** Starts from the receivers' newest fix alone, when patience is at an end. */
  void startByFix();
  /** Where the receivers' newest fix with a heading says that the car is at an instant. */
  [[nodiscard]] std::optional<Pose> placeAt(double stamp_s) const;
  /** Looks for the car around a place. Of a place that claims to be known better than the search's step, the match that starts
   * there wins if it is as near as both claim: stretches of a track look alike. */
  [[nodiscard]] std::optional<Registration> search(const CovarianceCloud& source, const Pose& T_guess,
                                                   const std::optional<Eigen::Matrix2d>& claim_m2);
  /** Looks for the car around the receivers' newest fix. */
  void tryStart(const Sweep& sweep);
  void start(double stamp_s, const Pose& T_map_body, StartReport report);
  /** What another thread makes of a sweep. */
  struct SweepResult {
    CovarianceCloud source;
    std::optional<Registration> match;  ///< none: no tile of the map is there
    WallScan walls;
    double took_s;
  };
  struct SweepJob {
    double end_s, due_s;
    double moved_m;  ///< since the end of the sweep before
    std::future<SweepResult> result;
  };
  void beginMatch(const Sweep& sweep, double now_s);
  void finishMatch();
  void takeMatch(double end_s, SweepResult result);
  void guard(double end_s, double moved_m, const WallScan& walls);
  /** What a localized car is about to drive, body frame; empty: it is told no line, or is nowhere near it. */
  [[nodiscard]] Path trackedFrom(const Pose& T_map_body, double speed_mps) const;
  /** A fix goes into the history; what becomes of it is noted. */
  void enter(double stamp_s, PoseFix fix);
  [[nodiscard]] Eigen::Vector2d trialNoise(const std::string& source, double stamp_s);
  void believe(double stamp_s, const Registration& match);
  /** The motion between two known poses, for the calibration. */
  void teach(const KnownPose& from, const KnownPose& to);
  /** While there is no match, the estimate that the receivers hold tells what is wrong with speed and yaw rate: not
   * independent of them, but they move it little over the time of a lesson. */
  void teachByEstimate();
  /** Of the right increment (rad, m): height, roll and pitch have the last match's errors; before the first one, what a
   * start leaves open. */
  [[nodiscard]] Matrix6d covarianceOf(const CarState& car) const;

  /** The car's motion by its wheels; where they say nothing, at the last speed and yaw rate. */
  [[nodiscard]] Pose motionBetween(double from_s, double to_s) const;
  /** The car's attitude, height and control go on to a later instant. */
  void moveTo(double stamp_s);
  /** The estimate with an attitude and height as last known, at an instant of the history. */
  [[nodiscard]] Pose poseAt(double stamp_s, const CarState& car) const;
  /** How the car moved while the sweep was taken, or is likely to have. */
  [[nodiscard]] SweepPoses motionOf(const Sweep& sweep) const;
  [[nodiscard]] Integrity integrityOf(const EstimatorState& state, const Pose& T_map_body) const;
  /** Sweeps whose motion is known, one after the other. \param next  gives them */
  template <class Next>
  void processAll(double now_s, const Next& next);
  void publish(std::vector<LocalizerOutput>& outputs);

  // What is aligned to 16 bytes comes first: less padding.
  std::optional<FusionHistory> x_fusion;
  Pose x_T_map_body = Pose::Identity();  ///< at x_stamp_s: attitude and height as last known
  Receivers x_receivers;
  TileWindow x_window;
  std::optional<KnownPose> x_last_match;   ///< that was believed
  std::optional<KnownPose> x_last_lesson;  ///< of teachByEstimate()
  std::optional<ScanMatch> x_new_match;
  std::optional<DatedDecision> x_new_decision;
  std::vector<std::vector<DatedDecision>> x_new_decisions;
  std::optional<WallReport> x_new_walls;
  MotionHistory x_history;
  gpu::Context& x_context;
  double x_stamp_s = 0;                                       ///< of the newest control
  double x_now_s = -std::numeric_limits<double>::infinity();  ///< newest stamp of the stream
  double x_published_s = 0;                                   ///< of the newest output
  std::size_t x_passed_over = 0, x_searches = 0;
  MotionHistory::Rates x_last_rates{0, 0};
  std::optional<double> x_height_above_road_m;  ///< of the rear axle
  std::optional<double> x_last_sweep_s;         ///< end of the one before
  std::optional<StartReport> x_start;
  ScanQueue x_queue;
  SweepPreparer x_preparer;
  LocalizerOptions x_options;
  TrackSurface x_surface;
  WallDetector x_walls;
  Guard x_guard;
  WallFollower x_follower;
  std::optional<ToldLine> x_told;
  Cloud x_whole_scan;
  FaultCounts x_noted;
  std::mt19937 x_trial_engine;
  int x_failed_matches = 0;  ///< in a row
  int x_lesson_resets = 0;   ///< of the estimate that teaches
  bool x_by_wheels = true;
  std::optional<SweepJob> x_job;  ///< last: it uses the others, and ends before they do
};

}  // namespace raceloc
