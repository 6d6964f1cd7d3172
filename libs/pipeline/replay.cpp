#include "pipeline/replay.h"

#include <algorithm>
#include <memory>
#include <optional>
#include <utility>

#include "core/errors.h"
#include "core/labels.h"
#include "core/statistics.h"
#include "pipeline/annotated_log.h"
#include "pipeline/device_watch.h"
#include "pipeline/log_faults.h"
#include "pipeline/map_check.h"

namespace raceloc {

void LiveOptions::describe(OptionList& keys) {
  keys.add("disable_labels", disable_labels, "sources that are switched off, e.g. gps_*; empty: none");
  keys.add("disable_after_s", disable_after_s, atLeast(0), "they are heard this long before [s]");
  keys.add("output_gzip_level", output_gzip_level, between(0, 9),
           "compression of the annotated rawlog: 0 costs no time, 1 half the space and 40 ms a sweep");
  keys.add("map_hash", map_hash, "the map must have this content hash, md5:...; empty: any");
  keys.add("map_reach_m", map_reach_m, above(0),
           "first fixes that are all farther than this from the map's tiles are of another place [m]");
  keys.add(
      "stream", stream,
      "where each output goes as a line of JSON: udp://HOST:PORT, or tcp://HOST:PORT to listen there; empty: "
      "nowhere");
  keys.add("queue_length", queue_length, between(1, 100'000),
           "live, so many observations wait for the localizer; then the oldest scan is dropped");
  keys.add("silent_after_s", silent_after_s, above(0),
           "live, a sensor is named when nothing came for so long [s]");
}

ReplayOptions::ReplayOptions() {
  // Only motion waits to be put in order; what comes later finds its place in the localizer's history.
  localizer.matching.log.reorder_window_s = 0.05;
}

ReplayOptions ReplayOptions::fromIni(const std::string& path) {
  ReplayOptions options;
  IniFile ini(path);
  options.localizer.matching.load(ini);
  LocalizerOptions& localizer = options.localizer;
  ini.load("fusion", localizer.estimator.fusion);
  ini.load("gate", localizer.estimator.gate);
  ini.load("reliability", localizer.estimator.reliability);
  ini.load("recovery", localizer.estimator.recovery);
  ini.load("history", localizer.history);
  ini.load("integrity", localizer.integrity);
  ini.load("track_surface", localizer.surface);
  ini.load("localizer", localizer.policy);
  ini.load("search", localizer.search);
  ini.load("wall", localizer.wall);
  ini.load("wall_path", localizer.wall_path);
  ini.load("guard", localizer.guard);
  ini.load("trial", localizer.trial);
  ini.load("live", options.live);
  ini.rejectUnknownSections();
  return options;
}

std::string ReplayOptions::iniText() const {
  const EstimatorOptions& estimator = localizer.estimator;
  std::string text = localizer.matching.iniText();
  for (const auto& section :
       {raceloc::iniText("fusion", estimator.fusion), raceloc::iniText("gate", estimator.gate),
        raceloc::iniText("reliability", estimator.reliability),
        raceloc::iniText("recovery", estimator.recovery), raceloc::iniText("history", localizer.history),
        raceloc::iniText("integrity", localizer.integrity),
        raceloc::iniText("track_surface", localizer.surface), raceloc::iniText("localizer", localizer.policy),
        raceloc::iniText("search", localizer.search), raceloc::iniText("wall", localizer.wall),
        raceloc::iniText("wall_path", localizer.wall_path), raceloc::iniText("guard", localizer.guard),
        raceloc::iniText("trial", localizer.trial), raceloc::iniText("live", live)})
    text += "\n" + section;
  return text;
}

namespace {

/** What may have a say in decisions, in the order of the annotated log's columns. */
std::vector<std::string> sourcesOf(std::vector<std::string> receivers, const std::string& gps_labels) {
  std::vector<std::string> sources{kScanMatch};
  std::sort(receivers.begin(), receivers.end());
  for (const auto& label : receivers)
    if (matchesLabel(gps_labels, label)) sources.push_back(label);
  return sources;
}

/** A pattern that switches off nothing is a slip of the pen. */
void requireSomethingToDisable(const LogSummary& summary, const std::string& patterns) {
  std::vector<std::string> labels;
  for (const auto& device : summary.devices)  // one label can be of several classes
    if (std::find(labels.begin(), labels.end(), device.label) == labels.end()) labels.push_back(device.label);
  const auto unmatched = unmatchedPatterns(patterns, labels);
  if (!unmatched.empty())
    throw InputError("rawlog " + summary.path + ": nothing to disable is labelled " + listed(unmatched) +
                     " (labels in it: " + listed(labels) + ")");
}

/** Sums up outputs as they come. */
class Tally {
 public:
  explicit Tally(ReplayReport& report) : x_report(report) {}
  void add(const LocalizerOutput& output) {
    ++x_report.outputs;
    if (output.decision) {
      const GateDecision& decision = output.decision->decision;
      ++x_report.rule_counts[static_cast<int>(decision.rule)];
      if (decision.alarm) ++x_report.alarms;
    }
    ++x_report.state_counts[static_cast<int>(output.integrity.state)];
    if (!output.integrity.cause.empty()) ++x_report.causes[output.integrity.cause];
    if (!output.by_wheels) ++x_report.without_wheels;
    for (const auto& [fault, times] : output.faults) x_report.faults[fault] += times;
    if (output.walls) add(*output.walls);
    if (!output.scan_match) return;
    ++x_report.scans;
    if (!output.scan_match->trusted) return;
    ++x_report.trusted_matches;
    if (output.scan_match->took_s) x_times_s.add(*output.scan_match->took_s);
    x_residuals_m.add(output.scan_match->match.residual_m);
    x_shares.add(output.scan_match->match.inlier_share);
    x_iterations.add(output.scan_match->match.iterations);
  }
  void finish() {
    x_report.match_residual_m = x_residuals_m.at(0.5);
    x_report.match_inlier_share = x_shares.at(0.5);
    x_report.match_iterations = x_iterations.at(0.5);
    x_report.match_median_s = x_times_s.at(0.5);
    x_report.match_p99_s = x_times_s.at(0.99);
    x_report.match_max_s = x_times_s.max();
  }

 private:
  void add(const WallReport& report) {
    const auto isSeen = [](const std::optional<Wall>& wall) { return wall && wall->age_s == 0; };
    ++x_report.guard_counts[static_cast<int>(report.guard.state)];
    if (isSeen(report.walls.left)) ++x_report.walls_left;
    if (isSeen(report.walls.right)) ++x_report.walls_right;
    if (report.walls.verdict == ScanVerdict::ground_not_below)
      ++x_report.faults["LiDAR: the ground is not below it, its place on the car is not what the log says"];
  }

  ReplayReport& x_report;
  RunningQuantiles x_residuals_m, x_shares, x_iterations, x_times_s;
};

/** The loop of every run. */
ReplayReport localize(LogReader& reader, const MapFile& map, const std::string& map_path,
                      AnnotatedLog* annotated, const ReplayOptions& options, const GoOn& go_on,
                      const Listener& listen) {
  requireHash(map, map_path, options.live.map_hash);
  PlaceCheck place(map, map_path, options.live.map_reach_m);
  const DeviceOptions& device = options.localizer.matching.device;
  gpu::Context context(device.device, 0, device.threads);
  DeviceWatch watch(context, device.self_test_every_s);
  Localizer localizer(context, map, options.localizer);
  ReplayReport report{};
  Tally tally(report);
  std::optional<double> first_s;

  const auto hand = [&](const std::vector<LocalizerOutput>& outputs) {
    for (const auto& output : outputs) {
      tally.add(output);
      if (annotated) annotated->write(output);
      if (listen) listen(output);
    }
  };
  while (const auto sample = reader.next()) {
    if (!go_on(reader.progress())) break;
    const double stamp_s = stampOf(*sample);
    if (!first_s) first_s = stamp_s;
    report.recorded_s = std::max(report.recorded_s, stamp_s - *first_s);
    const bool disabled = stamp_s >= *first_s + options.live.disable_after_s &&
                          matchesLabel(options.live.disable_labels, labelOf(*sample));
    if (disabled) {
      ++report.disabled_samples;
      continue;
    }
    if (const auto* fix = std::get_if<GpsFix>(&*sample)) place.add(*fix);
    if (annotated) annotated->write(*sample);
    if (!localizer.isMatching()) watch.at(stamp_s);
    hand(localizer.add(*sample));
  }
  hand(localizer.finish());
  tally.finish();
  report.first_s = first_s.value_or(0);
  report.device_reason = context.reason();
  report.dropped_late = reader.droppedLate();
  report.start = localizer.startReport();
  report.passed_over = localizer.passedOver();
  report.tile_loads = localizer.tileLoads();
  report.searches = localizer.searches();
  report.resets = static_cast<std::size_t>(localizer.resets());
  return report;
}

/** Null when none is wanted. */
std::unique_ptr<AnnotatedLog> annotatedLog(const std::string& path, const GeodeticPoint& origin,
                                           const std::vector<std::string>& receivers,
                                           const ReplayOptions& options) {
  if (path.empty()) return nullptr;
  return std::make_unique<AnnotatedLog>(path, origin,
                                        sourcesOf(receivers, options.localizer.matching.log.gps_labels),
                                        options.live.output_gzip_level);
}

}  // namespace

GeodeticPoint originOf(const std::string& map_path) { return requireOrigin(MapFile(map_path), map_path); }

LogSummary requireScans(const std::string& log_path, const ReplayOptions& options,
                        const std::function<void(double)>& progress) {
  const LogOptions& log = options.localizer.matching.log;
  LogSummary summary = summarizeRawlog(log_path, progress);
  requireDevices(summary, log);
  requireOneClock(summary, log);
  requireSomethingToDisable(summary, options.live.disable_labels);
  return summary;
}

LogSummary requirePlayable(const std::string& log_path, const ReplayOptions& options,
                           const std::function<void(double)>& progress) {
  const LogOptions& log = options.localizer.matching.log;
  LogSummary summary = requireScans(log_path, options, progress);
  requireDevice(summary, "gps", log.gps_labels);
  requireDevice(summary, "vehicle", log.vehicle_labels);
  return summary;
}

ReplayReport replay(const LogSummary& log, const std::string& map_path, const std::string& output_path,
                    const ReplayOptions& options, const GoOn& go_on, const Listener& listen) {
  const LogOptions& log_options = options.localizer.matching.log;
  const MapFile map(map_path);
  const GeodeticPoint origin = requireOrigin(map, map_path);
  const auto annotated = annotatedLog(output_path, origin, log.gps_labels, options);
  LogReader reader(log.path, log_options, origin, Late::passed);
  ReplayReport report = localize(reader, map, map_path, annotated.get(), options, go_on, listen);
  report.faults.merge(logFaults(log, log_options, reader));
  if (!report.start)
    throw InputError(
        "rawlog " + log.path + ": no start among " + std::to_string(report.recorded_s) +
        " s: neither a scan match near a fix with a heading (from an INS pose, or two fixes at " +
        std::to_string(options.localizer.policy.min_course_speed_mps) +
        " m/s or more), nor such fixes for start_patience_s, by GPS labelled " + log_options.gps_labels +
        "; is the map of this place?");
  if (annotated) annotated->commit();
  return report;
}

ReplayReport localizeLive(const LiveInput& input, const std::string& map_path, const std::string& output_path,
                          const ReplayOptions& options, const Listener& listen) {
  const MapFile map(map_path);
  const GeodeticPoint origin = requireOrigin(map, map_path);
  const auto annotated = annotatedLog(output_path, origin, input.gps_labels, options);
  LogReader reader(input.next, options.localizer.matching.log, origin, input.header, Late::passed);
  ReplayReport report = localize(
      reader, map, map_path, annotated.get(), options, [](double) { return true; }, listen);
  report.faults.merge(stampFaults(reader));
  if (annotated) annotated->commit();
  return report;
}

namespace {

/** T_map_odom by the last pose, see OdometryReport. */
Pose levelled(const Pose& T_odom_last, const Level& last) {
  Pose T_map_odom = Pose::Identity();
  T_map_odom.linear() =
      Eigen::Quaterniond::FromTwoVectors(T_odom_last.linear() * last.up_body, Eigen::Vector3d::UnitZ())
          .toRotationMatrix();
  return T_map_odom;
}

}  // namespace

OdometryReport replayOdometry(const LogSummary& log, const ReplayOptions& options, const GoOn& go_on,
                              const std::function<void(const StampedPose&)>& listen) {
  const MatchingOptions& matching = options.localizer.matching;
  gpu::Context context(matching.device.device, 0, matching.device.threads);
  DeviceWatch watch(context, matching.device.self_test_every_s);
  OdometryStream stream = odometryStream(context, matching);
  LogReader reader(log.path, matching.log, std::nullopt, Late::passed);
  OdometryReport report{};
  Pose T_odom_last = Pose::Identity();
  const auto take = [&](const OdometryStep& step) {
    T_odom_last = step.T_odom_body;
    report.level = step.level;
    listen({step.stamp_s, step.T_odom_body});
  };
  while (auto sample = reader.next()) {
    if (!go_on(reader.progress())) break;
    report.recorded_s = std::max(report.recorded_s, stampOf(*sample) - log.first_s);
    if (stampOf(*sample) >= log.first_s + options.live.disable_after_s &&
        matchesLabel(options.live.disable_labels, labelOf(*sample)))
      continue;
    watch.at(stampOf(*sample));
    stream.add(std::move(*sample), take);
  }
  stream.finish(take);
  report.T_map_odom = report.level ? levelled(T_odom_last, *report.level) : Pose::Identity();
  const MotionCalibration& calibration = stream.history().calibration();
  report.device_reason = context.reason();
  report.odometry = stream.tally();
  report.odometry.faults.merge(logFaults(log, matching.log, reader));
  report.dropped_late = reader.droppedLate();
  report.calibration = calibration.mean();
  report.calibration_sigma = calibration.covariance().diagonal().cwiseSqrt();
  return report;
}

}  // namespace raceloc
