#include "pipeline/localizer.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "cloud/deskew.h"
#include "core/labels.h"

namespace raceloc {

namespace {

constexpr char kScanMatch[] = "scan_match";

/** The same pose with another planar part: heading turned about the map's vertical, roll and pitch kept. */
Pose withPlanar(const Pose& T, double x_m, double y_m, double theta_rad) {
  Pose out = T;
  out.linear() = Eigen::AngleAxisd(wrapAngle(theta_rad - yawOf(T)), Eigen::Vector3d::UnitZ()) * T.linear();
  out.translation().x() = x_m;
  out.translation().y() = y_m;
  return out;
}

/** Raises a covariance to a floor: no receiver is believed to be better than sigma on any axis. */
Eigen::Matrix2d floored(const Eigen::Matrix2d& covariance, double sigma_m) {
  return covariance + sigma_m * sigma_m * Eigen::Matrix2d::Identity();
}

/** A match as a planar fix: the covariance of the right increment, turned into the map. */
PoseFix planarFix(const Registration& match) {
  const Eigen::Matrix3d R = match.T_target_source.linear();
  const Eigen::Matrix3d cov_p = R * match.covariance.bottomRightCorner<3, 3>() * R.transpose();
  const Eigen::Matrix3d cov_r = R * match.covariance.topLeftCorner<3, 3>() * R.transpose();
  return {kScanMatch,
          match.T_target_source.translation().head<2>(),
          cov_p.topLeftCorner<2, 2>(),
          HeadingKind::body,
          yawOf(match.T_target_source),
          std::sqrt(cov_r(2, 2))};
}

}  // namespace

void LocalizerPolicy::describe(OptionList& keys) {
  keys.add("map_radius_m", map_radius_m, above(0), "tiles within this distance of the car are held [m]");
  keys.add("max_fix_age_s", max_fix_age_s, above(0), "older fixes take no part in a decision [s]");
  keys.add("match_alive_s", match_alive_s, above(0),
           "without a trusted match for this long, fixes are decided on alone [s]");
  keys.add("min_course_speed_mps", min_course_speed_mps, above(0), "slower, two fixes give no course [m/s]");
  keys.add("course_sigma_deg", course_sigma_deg, above(0), "error of the course between two fixes [deg]");
  keys.add("gps_min_sigma_m", gps_min_sigma_m, above(0),
           "no fix is believed to be better than this per axis [m]");
  keys.add("dead_reckoning_period_s", dead_reckoning_period_s, above(0),
           "output by dead reckoning when nothing else came [s]");
  keys.add("start_patience_s", start_patience_s, above(0),
           "without a scan match near a fix for this long, the fix starts the filter alone [s]");
}

Localizer::Localizer(gpu::Context& context, const MapFile& map, const LocalizerOptions& options)
    : x_history(options.matching.motion, options.matching.calibration),
      x_context(context),
      x_queue(labelsNamed(options.matching.log.lidar_labels)),
      x_preparer(context, options.matching.crop, options.matching.odometry.scan_voxel_m,
                 options.matching.covariance),
      x_options(options),
      x_window(context, map, options.matching.registration.voxel_size_m, options.policy.map_radius_m) {}

std::vector<LocalizerOutput> Localizer::add(const Sample& sample) {
  std::vector<LocalizerOutput> outputs;
  std::visit([&](const auto& s) { take(s, outputs); }, sample);
  while (const Sweep* sweep = x_queue.pop(x_history, stampOf(sample))) process(*sweep, outputs);
  return outputs;
}

std::vector<LocalizerOutput> Localizer::finish() {
  std::vector<LocalizerOutput> outputs;
  while (const Sweep* sweep = x_queue.popAny()) process(*sweep, outputs);
  return outputs;
}

void Localizer::process(const Sweep& sweep, std::vector<LocalizerOutput>& outputs) {
  if (!started())
    tryStart(sweep, outputs);
  else if (sweep.end_s > x_stamp_s)
    outputs.push_back(matchSweep(sweep));
  else
    ++x_passed_over;
}

void Localizer::take(const ImuSample& sample, std::vector<LocalizerOutput>& /*outputs*/) {
  x_history.add(sample);
}

void Localizer::take(const InsPose& pose, std::vector<LocalizerOutput>& /*outputs*/) {
  x_receivers[pose.label].ins = pose;
}

void Localizer::take(const Scan& scan, std::vector<LocalizerOutput>& /*outputs*/) { x_queue.push(scan); }

void Localizer::take(const MotionSample& sample, std::vector<LocalizerOutput>& outputs) {
  x_history.add(sample);
  const bool overdue =
      started() && x_queue.empty() && sample.stamp_s - x_stamp_s >= x_options.policy.dead_reckoning_period_s;
  if (!overdue) return;
  predictTo(sample.stamp_s);
  outputs.push_back(output());
}

void Localizer::take(const GpsFix& fix, std::vector<LocalizerOutput>& outputs) {
  Receiver& receiver = x_receivers[fix.label];
  const auto body = bodyFix(fix, receiver);
  receiver.previous = fix;
  if (!started()) {
    if (body) considerStart(fix, *body);
    return;
  }
  constexpr std::size_t kMostWaiting = 64;  // 0.6 s of a 100 Hz receiver: longer than any sweep waits
  receiver.unused.push_back({fix.stamp_s, *body});
  if (receiver.unused.size() > kMostWaiting) receiver.unused.pop_front();

  const bool matching = x_last_match && fix.stamp_s - x_last_match->stamp_s < x_options.policy.match_alive_s;
  if (matching || !x_queue.empty() || fix.stamp_s <= x_stamp_s) return;
  predictTo(fix.stamp_s);
  outputs.push_back(decide(fix.stamp_s, takeFixes(), std::nullopt));
}

std::optional<PoseFix> Localizer::bodyFix(const GpsFix& fix, const Receiver& receiver) const {
  constexpr double kSameEpoch_s = 0.005, kCourseMemory_s = 1.5, kWorthlessCourse_rad = 0.3;
  constexpr double kBestHeading_rad = 1e-3;  // no INS is better, whatever it claims
  PoseFix body{
      fix.label, {}, floored(fix.cov_map_m2.topLeftCorner<2, 2>(), x_options.policy.gps_min_sigma_m)};
  Eigen::Matrix3d R_map_body = x_T_map_body.linear();
  if (receiver.ins && std::abs(receiver.ins->stamp_s - fix.stamp_s) < kSameEpoch_s) {
    R_map_body = receiver.ins->T_map_body.linear();
    body.heading = HeadingKind::body;
    body.heading_rad = yawOf(receiver.ins->T_map_body);
    body.heading_sigma_rad = std::max(kBestHeading_rad, std::sqrt(receiver.ins->covariance(2, 2)));
  } else if (receiver.previous && fix.stamp_s > receiver.previous->stamp_s &&
             fix.stamp_s - receiver.previous->stamp_s < kCourseMemory_s) {
    const Eigen::Vector2d moved_m = (fix.p_map_antenna_m - receiver.previous->p_map_antenna_m).head<2>();
    const double speed_mps = moved_m.norm() / (fix.stamp_s - receiver.previous->stamp_s);
    const Eigen::Vector2d across = Eigen::Vector2d(-moved_m.y(), moved_m.x()).normalized();
    const Eigen::Matrix3d both_m2 = fix.cov_map_m2 + receiver.previous->cov_map_m2;
    const double noise_rad = std::sqrt(across.dot(both_m2.topLeftCorner<2, 2>() * across)) / moved_m.norm();
    if (speed_mps > x_options.policy.min_course_speed_mps && noise_rad < kWorthlessCourse_rad) {
      body.heading = HeadingKind::course;
      body.heading_rad = std::atan2(moved_m.y(), moved_m.x());
      body.heading_sigma_rad = std::hypot(x_options.policy.course_sigma_deg * M_PI / 180, noise_rad);
      if (!started()) R_map_body = poseFromRpy(Eigen::Vector3d::Zero(), 0, 0, body.heading_rad).linear();
    }
  }
  if (!started() && body.heading == HeadingKind::none) return std::nullopt;
  body.p_map_m = (fix.p_map_antenna_m - R_map_body * fix.p_body_antenna_m).head<2>();
  return body;
}

void Localizer::considerStart(const GpsFix& fix, const PoseFix& body) {
  const Receiver& receiver = x_receivers[fix.label];
  Pose T = poseFromRpy(Eigen::Vector3d::Zero(), 0, 0, body.heading_rad);
  if (body.heading == HeadingKind::body) T.linear() = receiver.ins->T_map_body.linear();
  T.translation() = fix.p_map_antenna_m - T.linear() * fix.p_body_antenna_m;
  const double first_fix_s = x_start_place ? x_start_place->first_fix_s : fix.stamp_s;
  x_start_place = StartPlace{first_fix_s, fix.stamp_s, fix.label, T};
  if (fix.stamp_s - first_fix_s > x_options.policy.start_patience_s)
    start(fix.stamp_s, T, {fix.stamp_s, fix.label, false, 0});
}

void Localizer::tryStart(const Sweep& sweep, std::vector<LocalizerOutput>& outputs) {
  const double end_s = sweep.end_s;
  if (!x_start_place) return;
  // A sweep is looked at when its motion is known: the newest fix may be a little younger than its end.
  const double fix_s = x_start_place->stamp_s;
  const auto motion = x_history.between(std::min(fix_s, end_s), std::max(fix_s, end_s));
  if (!motion || motion->duration_s > x_options.policy.max_fix_age_s) return;
  const Pose T_fix_end = end_s >= fix_s ? motion->T_start_end : motion->T_start_end.inverse();
  const Pose T_guess = x_start_place->T_map_body * T_fix_end;
  if (!x_window.moveTo(T_guess.translation().head<2>())) return;

  const GicpOptions& gicp = x_options.matching.registration;
  const CovarianceCloud source = prepared(sweep);
  const Registration match =
      alignWithSearch(x_context, source, x_window.target(), T_guess, gicp, x_options.search);
  if (!match.trusted(gicp)) return;
  const double to_fix_m = (match.T_target_source.translation() - T_guess.translation()).head<2>().norm();
  start(end_s, match.T_target_source, {end_s, x_start_place->receiver, true, to_fix_m});
  outputs.push_back(decide(end_s, {planarFix(match)}, ScanMatch{match, true, source.cloud}));
}

void Localizer::start(double stamp_s, const Pose& T_map_body, StartReport report) {
  const CarState state = startState(T_map_body.translation().head<2>(), yawOf(T_map_body), x_options.fusion);
  x_filter.emplace(state, x_options.fusion, x_options.gate);
  x_stamp_s = stamp_s;
  x_T_map_body = T_map_body;
  x_start = std::move(report);
}

BodyMotion Localizer::motionBetween(double from_s, double to_s) const {
  if (const auto motion = x_history.between(from_s, to_s)) return *motion;
  const double duration_s = to_s - from_s;
  BodyMotion held{duration_s,
                  arc(x_last_rates.speed_mps * duration_s, x_last_rates.yaw_rate_rps * duration_s),
                  Matrix6d::Zero()};
  // Nobody brakes or steers harder than 1 g: half of it over the time, squared, along and across.
  held.covariance.block<2, 2>(3, 3) =
      std::pow(0.5 * 9.81 * duration_s * duration_s, 2) * Eigen::Matrix2d::Identity();
  return held;
}

void Localizer::predictTo(double stamp_s) {
  constexpr double kStep_s = 0.02;
  const double from_s = x_stamp_s, step_s_at_most = stamp_s - from_s;
  x_T_map_body = x_T_map_body * motionBetween(from_s, stamp_s).T_start_end;
  x_by_wheels = x_history.hasWheels(stamp_s) && x_history.between(from_s, stamp_s).has_value();
  const int steps = static_cast<int>(std::ceil(step_s_at_most / kStep_s));
  for (int i = 0; i < steps; ++i) {
    const double start_s = from_s + step_s_at_most * i / steps;
    const double end_s = i + 1 == steps ? stamp_s : from_s + step_s_at_most * (i + 1) / steps;
    if (const auto rates = x_history.ratesBetween(start_s, end_s)) x_last_rates = *rates;
    x_filter->predict(end_s - start_s, x_last_rates.speed_mps, x_last_rates.yaw_rate_rps);
  }
  x_stamp_s = stamp_s;
}

std::vector<PoseFix> Localizer::takeFixes() {
  std::vector<PoseFix> fixes;
  for (auto& [label, receiver] : x_receivers) {
    auto& waiting = receiver.unused;
    while (waiting.size() > 1 && waiting[1].stamp_s <= x_stamp_s) waiting.pop_front();
    if (waiting.empty() || waiting.front().stamp_s > x_stamp_s) continue;
    const double stamp_s = waiting.front().stamp_s;
    PoseFix body = std::move(waiting.front().body);
    waiting.pop_front();
    if (x_stamp_s - stamp_s > x_options.policy.max_fix_age_s) continue;

    const BodyMotion motion = motionBetween(stamp_s, x_stamp_s);
    const double turn_rad = yawOf(motion.T_start_end);
    const Eigen::Rotation2Dd R_map_then(x_filter->state().mean(2) - turn_rad);
    body.p_map_m += R_map_then * motion.T_start_end.translation().head<2>();
    body.cov_p_m2 += R_map_then.toRotationMatrix() * motion.covariance.block<2, 2>(3, 3) *
                     R_map_then.toRotationMatrix().transpose();
    body.heading_rad += turn_rad;
    fixes.push_back(std::move(body));
  }
  return fixes;
}

CovarianceCloud Localizer::prepared(const Sweep& sweep) {
  const auto poses = x_history.sweep(sweep.begin_s, sweep.end_s);
  Vector6d last = Vector6d::Zero();
  last(2) = x_last_rates.yaw_rate_rps;
  last(3) = x_last_rates.speed_mps;
  return x_preparer.prepare(sweep, poses ? *poses : steadySweep(last, sweep.end_s - sweep.begin_s));
}

LocalizerOutput Localizer::matchSweep(const Sweep& sweep) {
  predictTo(sweep.end_s);
  const CovarianceCloud source = prepared(sweep);

  std::vector<PoseFix> fixes = takeFixes();
  std::optional<ScanMatch> scan_match;
  if (x_window.moveTo(x_T_map_body.translation().head<2>())) {
    const Registration match =
        align(x_context, source, x_window.target(), x_T_map_body, x_options.matching.registration);
    scan_match = ScanMatch{match, match.trusted(x_options.matching.registration), source.cloud};
    if (scan_match->trusted) fixes.push_back(planarFix(match));
  }
  return decide(sweep.end_s, std::move(fixes), std::move(scan_match));
}

LocalizerOutput Localizer::decide(double stamp_s, std::vector<PoseFix> fixes,
                                  std::optional<ScanMatch> scan_match) {
  std::optional<GateDecision> decision;
  if (!fixes.empty()) decision = x_filter->correct(fixes);
  const auto believed = [&](const std::string& source) {
    return decision && std::any_of(decision->sources.begin(), decision->sources.end(),
                                   [&](const SourceVerdict& v) { return v.source == source && v.accepted; });
  };
  if (believed(kScanMatch)) {
    const Registration& match = scan_match->match;
    constexpr double kLongest_s =
        1;  // over longer, what calibration drifts counts more than what a match knows
    if (x_last_match && stamp_s - x_last_match->stamp_s < kLongest_s)
      x_history.observe(x_last_match->stamp_s, stamp_s,
                        x_last_match->T_map_body.inverse() * match.T_target_source,
                        x_last_match->covariance + match.covariance);
    x_T_map_body = match.T_target_source;
    x_last_match = BelievedMatch{stamp_s, match.T_target_source, match.covariance};
  }
  LocalizerOutput out = output();
  x_T_map_body = out.T_map_body;
  out.fixes = std::move(fixes);
  out.decision = std::move(decision);
  out.scan_match = std::move(scan_match);
  return out;
}

LocalizerOutput Localizer::output() {
  const CarState state = x_filter->state();
  const Pose T = withPlanar(x_T_map_body, state.mean(0), state.mean(1), state.mean(2));
  // Height, roll and pitch have the last match's errors; before the first one, what a start leaves open.
  constexpr double kUnknownHeight_m = 1.0, kUnknownTilt_rad = 0.1;
  Matrix6d covariance = x_last_match ? x_last_match->covariance : Matrix6d(Matrix6d::Zero());
  if (!x_last_match) {
    covariance.diagonal() << std::pow(kUnknownTilt_rad, 2), std::pow(kUnknownTilt_rad, 2), 0, 0, 0,
        std::pow(kUnknownHeight_m, 2);
  }
  const Eigen::Rotation2Dd R_body_map(-state.mean(2));
  const Eigen::Matrix2d R = R_body_map.toRotationMatrix();
  covariance.row(2).setZero();
  covariance.col(2).setZero();
  covariance.block<2, 6>(3, 0).setZero();
  covariance.block<6, 2>(0, 3).setZero();
  covariance(2, 2) = state.covariance(2, 2);
  covariance.block<2, 2>(3, 3) = R * state.covariance.topLeftCorner<2, 2>() * R.transpose();
  const Eigen::Vector2d cross = R * state.covariance.block<2, 1>(0, 2);
  covariance.block<2, 1>(3, 2) = cross;
  covariance.block<1, 2>(2, 3) = cross.transpose();
  FaultCounts faults = x_queue.takeFaults(x_stamp_s);
  for (const std::string& fault : x_history.faults()) ++faults[fault];
  for (const std::string& fault : x_window.takeFaults()) ++faults[fault];
  return {x_stamp_s, T, covariance, x_by_wheels, std::move(faults), {}, std::nullopt, std::nullopt, {}};
}

}  // namespace raceloc
