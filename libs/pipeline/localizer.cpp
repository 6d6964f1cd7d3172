#include "pipeline/localizer.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <limits>
#include <utility>

#include "cloud/deskew.h"
#include "core/errors.h"
#include "core/labels.h"
#include "fusion/chi_square.h"
#include "fusion/measurement.h"
#include "pipeline/planar_control.h"
#include "sensors/gps_conversion.h"

namespace raceloc {

namespace {

/** The same pose with another planar part: heading turned about the map's vertical, roll and pitch kept. */
Pose withPlanar(const Pose& T, double x_m, double y_m, double theta_rad) {
  Pose out = T;
  out.linear() = Eigen::AngleAxisd(wrapAngle(theta_rad - yawOf(T)), Eigen::Vector3d::UnitZ()) * T.linear();
  out.translation().x() = x_m;
  out.translation().y() = y_m;
  return out;
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

/** A line with the heights of the map's road. \throws InputError if the map was nowhere driven along it */
ToldLine toldOn(const MapContent& content, const TrackSurface& surface,
                std::vector<Eigen::Vector3d> line_map_m) {
  for (std::size_t i = 0; i < line_map_m.size(); ++i) {
    const Eigen::Vector3d along_m = line_map_m[(i + 1) % line_map_m.size()] - line_map_m[i];
    const auto place = surface.at(line_map_m[i].head<2>(), std::atan2(along_m.y(), along_m.x()));
    line_map_m[i].z() =
        place && place->road ? place->road->height_m : std::numeric_limits<double>::quiet_NaN();
  }
  ToldLine line(line_map_m);
  const bool is_driven =
      std::any_of(content.key_poses.begin(), content.key_poses.end(),
                  [&](const KeyPose& key) { return !line.from(key.T_map_body, 0).empty(); });
  if (!is_driven)
    throw InputError(
        "race line: the map was nowhere driven along it; its points go in the order of driving, metres "
        "east and north of the map's origin");
  return line;
}

constexpr double kMatchMemory_s = 1;
constexpr double kStanding_mps = 0.5;  // slower, the way has no curvature to speak of
// Over longer, what calibration drifts counts more than what is known of the two ends.
constexpr double kLongestLesson_s = 1;

}  // namespace

const SourceVerdict* verdictOn(const LocalizerOutput& output, const std::string& source) {
  if (!output.decision) return nullptr;
  const auto& verdicts = output.decision->decision.sources;
  const auto found = std::find_if(verdicts.begin(), verdicts.end(),
                                  [&](const SourceVerdict& v) { return v.source == source; });
  return found == verdicts.end() ? nullptr : &*found;
}

Localizer::Localizer(gpu::Context& context, const MapFile& map, const LocalizerOptions& options)
    : x_receivers(options.policy),
      x_window(context, map, options.matching.registration.voxel_size_m, options.policy.map_radius_m),
      x_history(options.matching.motion, options.matching.calibration),
      x_context(context),
      x_queue(labelsNamed(options.matching.log.lidar_labels)),
      x_preparer(context, options.matching.crop, options.matching.odometry.scan_voxel_m,
                 options.matching.covariance),
      x_options(options),
      x_surface(map.content(), options.surface),
      x_walls(context, options.wall),
      x_guard(options.guard, options.wall_path),
      x_follower(options.wall_path),
      x_trial_engine(static_cast<unsigned>(options.trial.noise_seed)) {
  if (options.race_line_map_m) x_told = toldOn(map.content(), x_surface, *options.race_line_map_m);
  (void)Estimator(options.estimator);  // options that contradict each other are refused before the first fix
}

std::vector<LocalizerOutput> Localizer::add(const Sample& sample) {
  std::vector<LocalizerOutput> outputs;
  const double stamp_s = stampOf(sample);
  if (!std::isfinite(stamp_s)) {
    ++x_noted[labelOf(sample) + ": stamp is no number"];
    return outputs;
  }
  std::visit([&](const auto& s) { take(s); }, sample);
  x_now_s = std::max(x_now_s, stamp_s);
  if (x_job && x_now_s >= x_job->due_s) finishMatch();
  const bool due =
      std::holds_alternative<MotionSample>(sample) || stamp_s - x_stamp_s >= x_options.policy.output_period_s;
  if (started() && due && stamp_s > x_stamp_s) moveTo(stamp_s);
  processAll(x_now_s, [&] { return x_queue.pop(x_history, x_now_s); });
  publish(outputs);
  return outputs;
}

std::vector<LocalizerOutput> Localizer::finish() {
  std::vector<LocalizerOutput> outputs;
  const auto end = [&] {
    if (!x_job) return;
    if (x_job->due_s > x_stamp_s) moveTo(x_job->due_s);
    finishMatch();
    publish(outputs);
  };
  end();
  while (const Sweep* sweep = x_queue.popAny()) {
    if (started() && sweep->end_s > x_stamp_s) moveTo(sweep->end_s);
    processAll(x_stamp_s, [&] { return std::exchange(sweep, nullptr); });
    publish(outputs);
    end();
  }
  return outputs;
}

template <class Next>
void Localizer::processAll(double now_s, const Next& next) {
  while (!x_job) {
    const Sweep* sweep = next();
    if (!sweep) return;
    if (!started())
      tryStart(*sweep);
    else if (sweep->end_s > x_start->stamp_s &&
             sweep->end_s + x_options.history.lag_s > x_stamp_s + x_options.policy.match_delay_s)
      beginMatch(*sweep, now_s);
    else
      ++x_passed_over;
    if (x_job && now_s >= x_job->due_s) finishMatch();
  }
}

void Localizer::take(const ImuSample& sample) { x_history.add(sample); }

void Localizer::take(const InsPose& pose) {
  const bool is_sound = pose.T_map_body.matrix().allFinite() && pose.covariance(2, 2) > 0;
  if (is_sound)
    x_receivers.take(pose);
  else
    ++x_noted[pose.label + ": an INS pose without a value"];
}

void Localizer::take(const Scan& scan) { x_queue.push(scan); }

void Localizer::take(const MotionSample& sample) { x_history.add(sample); }

void Localizer::take(const GpsFix& fix) {
  if (!fix.p_map_antenna_m.allFinite() || !fix.cov_map_m2.allFinite() || !fix.p_body_antenna_m.allFinite()) {
    ++x_noted[fix.label + ": a fix that is no number"];
    return;
  }
  auto car = x_receivers.take(fix, carMotion());
  if (!car) return;
  if (!started()) startByFix();
  if (started()) enter(fix.stamp_s, std::move(*car));
}

void Localizer::startByFix() {
  const auto& place = x_receivers.place();
  if (!place || place->stamp_s - place->first_fix_s <= x_options.policy.start_patience_s) return;
  start(place->stamp_s, place->T_map_body, {place->stamp_s, place->receiver, false, 0});
}

CarMotion Localizer::carMotion() const {
  if (!started()) return {std::nullopt, x_last_rates.yaw_rate_rps, 0};
  return {x_T_map_body.linear(), x_last_rates.yaw_rate_rps, x_fusion->newestControl().slip_rad};
}

void Localizer::enter(double stamp_s, PoseFix fix) {
  const std::string source = fix.source;
  fix.p_map_m += trialNoise(source, stamp_s);
  const Acceptance acceptance = x_fusion->add(TimedFix{stamp_s, std::move(fix)});
  switch (acceptance) {
    case Acceptance::taken:
      break;
    case Acceptance::late:
      ++x_noted[source + (weekRollovers(x_stamp_s - stamp_s) > 0
                              ? ": the week number of its GPS time has rolled over"
                              : ": fixes that came too late")];
      return;
    case Acceptance::ahead:
      ++x_noted[source + ": fixes ahead of the car's clock"];
      return;
    case Acceptance::repeated:
      ++x_noted[source + ": fixes that were there already"];
      return;
    case Acceptance::unsound:
      ++x_noted[source + ": fixes with a value that is none"];
      return;
  }
  noteDecisions();
}

void Localizer::noteDecisions() {
  if (x_fusion->made().empty()) return;
  x_new_decision = x_fusion->made().back();
  x_new_decisions.push_back(x_fusion->made());
}

Eigen::Vector2d Localizer::trialNoise(const std::string& source, double stamp_s) {
  const TrialOptions& trial = x_options.trial;
  if (!matchesLabel(trial.noise_labels, source) || stamp_s < x_start->stamp_s + trial.noise_after_s)
    return Eigen::Vector2d::Zero();
  std::normal_distribution<double> normal(0, trial.noise_m);
  const double east_m = normal(x_trial_engine), north_m = normal(x_trial_engine);
  return {east_m, north_m};
}

std::optional<Pose> Localizer::placeAt(double stamp_s) const {
  const auto& place = x_receivers.place();
  if (!place) return std::nullopt;
  // A sweep is looked at when its motion is known: the newest fix may be a little younger than its end.
  const double fix_s = place->stamp_s;
  const auto motion = x_history.between(std::min(fix_s, stamp_s), std::max(fix_s, stamp_s));
  if (!motion || motion->duration_s > x_options.policy.max_fix_age_s) return std::nullopt;
  return place->T_map_body * (stamp_s >= fix_s ? motion->T_start_end : motion->T_start_end.inverse());
}

std::optional<Registration> Localizer::search(const CovarianceCloud& source, const Pose& T_guess,
                                              const std::optional<Eigen::Matrix2d>& claim_m2) {
  if (!x_window.moveTo(T_guess.translation().head<2>())) return std::nullopt;
  const GicpOptions& gicp = x_options.matching.registration;
  const Registration best =
      alignWithSearch(x_context, source, x_window.target(), T_guess, gicp, x_options.search);
  const double limit = chiSquareLimit(x_options.estimator.reliability.confirm_false_alarm, 2);
  if (claim_m2 && limit * claim_m2->trace() < std::pow(x_options.search.step_m, 2)) {
    // Of places that look alike, a sure fix tells which, and also where it is along the weakest direction of one that has
    // not come to rest. Where another looks better, it is the fix that lies.
    const Registration here = align(x_context, source, x_window.target(), T_guess, gicp);
    const Eigen::Vector2d off_m = (here.T_target_source.translation() - T_guess.translation()).head<2>();
    constexpr double kAlike = 0.8;
    if (here.plausible(gicp) && (!best.trusted(gicp) || fitOf(here) > kAlike * fitOf(best)) &&
        squaredMahalanobis(off_m, *claim_m2 + planarFix(here).cov_p_m2) <= limit)
      return here;
  }
  if (!best.trusted(gicp)) return std::nullopt;
  return best;
}

void Localizer::tryStart(const Sweep& sweep) {
  const double end_s = sweep.end_s;
  const auto T_guess = placeAt(end_s);
  if (!T_guess) return;
  const CovarianceCloud source = x_preparer.prepare(sweep, motionOf(sweep));
  const auto match = search(source, *T_guess, x_receivers.place()->cov_p_m2);
  if (!match) return;
  const double to_fix_m = (match->T_target_source.translation() - T_guess->translation()).head<2>().norm();
  start(end_s, match->T_target_source, {end_s, x_receivers.place()->receiver, true, to_fix_m});
  enter(end_s, planarFix(*match));
  believe(end_s, *match);
  x_new_match = ScanMatch{end_s, match->T_target_source, *match, true, source.cloud, {}};
}

void Localizer::start(double stamp_s, const Pose& T_map_body, StartReport report) {
  const CarState state =
      startState(T_map_body.translation().head<2>(), yawOf(T_map_body), x_options.estimator.fusion);
  if (const auto rates = x_history.ratesBetween(stamp_s, stamp_s)) x_last_rates = *rates;
  x_fusion.emplace(x_options.estimator, x_options.history, state,
                   Control{stamp_s, x_last_rates.speed_mps, x_last_rates.yaw_rate_rps});
  x_stamp_s = stamp_s;
  x_published_s = -HUGE_VAL;
  x_T_map_body = T_map_body;
  x_start = std::move(report);
}

Pose Localizer::motionBetween(double from_s, double to_s) const {
  if (const auto motion = x_history.between(from_s, to_s)) return motion->T_start_end;
  const double duration_s = to_s - from_s;
  return arc(x_last_rates.speed_mps * duration_s, x_last_rates.yaw_rate_rps * duration_s);
}

void Localizer::moveTo(double stamp_s) {
  constexpr double kUnknownSpeed_mps = 5;  // a speed that is only held: braked at 1 g for half a second
  const Pose T_map_next = x_T_map_body * motionBetween(x_stamp_s, stamp_s);
  if (const auto rates = x_history.ratesBetween(x_stamp_s, stamp_s)) x_last_rates = *rates;
  x_by_wheels = x_history.hasWheels(stamp_s) && x_history.between(x_stamp_s, stamp_s).has_value();

  Control control = planarControl(stamp_s, stamp_s - x_stamp_s, x_T_map_body, T_map_next);
  if (!x_by_wheels) control.speed_sigma_mps = kUnknownSpeed_mps;
  (void)x_fusion->add(control);  // it is in order, and all of it finite
  noteDecisions();
  x_stamp_s = stamp_s;
  x_T_map_body = T_map_next;
  x_T_map_body = poseAt(stamp_s, x_fusion->newest().car);
  teachByEstimate();
}

Pose Localizer::poseAt(double stamp_s, const CarState& car) const {
  Pose T = stamp_s < x_stamp_s ? Pose(x_T_map_body * motionBetween(stamp_s, x_stamp_s).inverse())
                               : Pose(x_T_map_body * motionBetween(x_stamp_s, stamp_s));
  const bool matched = x_last_match && stamp_s - x_last_match->stamp_s < kMatchMemory_s;
  if (!matched && x_height_above_road_m) {
    const auto place = x_surface.at(car.mean.head<2>(), car.mean(2), T.translation().z());
    if (place && place->road) {
      T.linear() = standingOn(place->road->up_map, car.mean(2));
      T.translation().z() = place->road->height_m + *x_height_above_road_m;
    }
  }
  return withPlanar(T, car.mean(0), car.mean(1), car.mean(2));
}

SweepPoses Localizer::motionOf(const Sweep& sweep) const {
  if (const auto poses = x_history.sweep(sweep.begin_s, sweep.end_s)) return *poses;
  Vector6d last = Vector6d::Zero();
  last(2) = x_last_rates.yaw_rate_rps;
  last(3) = x_last_rates.speed_mps;
  return steadySweep(last, sweep.end_s - sweep.begin_s);
}

void Localizer::beginMatch(const Sweep& sweep, double now_s) {
  using Clock = std::chrono::steady_clock;
  const double end_s = sweep.end_s;
  const Pose T_guess = poseAt(end_s, x_fusion->at(end_s).car);
  const bool has_tiles = x_window.moveTo(T_guess.translation().head<2>());
  const Pose T_last_now = x_last_sweep_s ? motionBetween(*x_last_sweep_s, end_s) : Pose(Pose::Identity());
  x_last_sweep_s = end_s;
  // The sweep stays as it is until the next one leaves the queue, which is after this job.
  auto work = [this, &sweep, T_begin_at = motionOf(sweep), T_guess, has_tiles, T_last_now] {
    const auto begin = Clock::now();
    SweepResult result;
    result.source = x_preparer.prepare(sweep, T_begin_at, &x_whole_scan);
    if (has_tiles)
      result.match =
          align(x_context, result.source, x_window.target(), T_guess, x_options.matching.registration);
    result.took_s = std::chrono::duration<double>(Clock::now() - begin).count();
    result.walls = x_walls.detect(x_whole_scan, sweep.end_s, T_last_now);
    return result;
  };
  x_job = SweepJob{end_s, now_s + x_options.policy.match_delay_s, T_last_now.translation().norm(),
                   std::async(std::launch::async, std::move(work))};
}

void Localizer::finishMatch() {
  SweepJob job = *std::exchange(x_job, std::nullopt);
  SweepResult result = job.result.get();
  const WallScan walls = result.walls;
  takeMatch(job.end_s, std::move(result));
  guard(job.end_s, job.moved_m, walls);
}

void Localizer::takeMatch(double end_s, SweepResult result) {
  const GicpOptions& gicp = x_options.matching.registration;
  std::optional<Registration>& match = result.match;
  bool trusted = match && match->trusted(gicp);
  if (!trusted && ++x_failed_matches >= x_options.policy.search_after) {
    x_failed_matches = 0;
    ++x_searches;
    const auto T_place = placeAt(end_s);
    const Pose T_guess = T_place ? *T_place : poseAt(end_s, x_fusion->at(end_s).car);
    const auto claim_m2 = T_place ? std::optional(x_receivers.place()->cov_p_m2) : std::nullopt;
    if (const auto found = search(result.source, T_guess, claim_m2)) {
      match = found;
      trusted = true;
    }
  }
  if (!match) return;  // no tile of the map is here
  if (trusted) {
    enter(end_s, planarFix(*match));
    const auto believed = [&](const DatedDecision& dated) {
      return dated.stamp_s >= end_s &&
             std::any_of(dated.decision.sources.begin(), dated.decision.sources.end(),
                         [](const SourceVerdict& v) { return v.source == kScanMatch && v.accepted; });
    };
    const auto& made = x_fusion->made();
    if (std::any_of(made.begin(), made.end(), believed)) {
      believe(end_s, *match);
      x_failed_matches = 0;
    } else {
      x_failed_matches =
          x_options.policy.search_after;  // found elsewhere: two keys are to turn, without a pause
    }
  }
  x_new_match = ScanMatch{end_s,   poseAt(end_s, x_fusion->at(end_s).car), *match,
                          trusted, std::move(result.source.cloud),         result.took_s};
}

void Localizer::guard(double end_s, double moved_m, const WallScan& walls) {
  const EstimatorState now = x_fusion->at(end_s);
  const Pose T_map_body = poseAt(end_s, now.car);
  const LocalizationState state = integrityOf(now, T_map_body).state;
  const bool is_localized = state == LocalizationState::ok || state == LocalizationState::degraded;
  const auto rates = x_history.ratesBetween(end_s, end_s).value_or(x_last_rates);
  const double speed_mps = std::max(0.0, rates.speed_mps);
  const double curvature_per_m = speed_mps > kStanding_mps ? rates.yaw_rate_rps / speed_mps : 0;
  const Path tracked = is_localized ? trackedFrom(T_map_body, speed_mps) : Path();
  GuardOutput decided = x_guard.update({end_s, is_localized, walls, tracked, speed_mps, curvature_per_m});
  if (decided.path) {
    const double course_rad = now.car.mean(3) + x_fusion->newestControl().slip_rad;
    decided.path->points = x_follower.follow(*walls.on(decided.path->side), decided.path->gap_m, speed_mps,
                                             curvature_per_m, course_rad, moved_m);
  } else {
    x_follower.restart();
  }
  x_new_walls = WallReport{walls, std::move(decided), x_walls.cells(), x_walls.clusters()};
}

Path Localizer::trackedFrom(const Pose& T_map_body, double speed_mps) const {
  if (!x_told) return {};
  constexpr double kSlow_mps = 10;  // slower, a tracker looks as far ahead as at this speed: never at 0 m
  const WallPathOptions& lengths = x_options.wall_path;
  return trackedPath(x_told->from(T_map_body, std::max(lengths.min_length_m, lengths.horizon_s * speed_mps)),
                     x_options.policy.line_lookahead_s * std::max(speed_mps, kSlow_mps));
}

void Localizer::teach(const KnownPose& from, const KnownPose& to) {
  x_history.observe(from.stamp_s, to.stamp_s, from.T_map_body.inverse() * to.T_map_body,
                    from.covariance + to.covariance);
}

void Localizer::teachByEstimate() {
  constexpr double kEvery_s = 0.5, kJustConfirmed_s = 0.1;
  const EstimatorState& now = x_fusion->newest();
  const bool has_match = x_last_match && x_stamp_s - x_last_match->stamp_s < kMatchMemory_s;
  const bool is_alone = now.stamp_s - now.confirmed_s > x_options.estimator.recovery.alone_s;
  if (has_match || is_alone || !x_by_wheels || now.resets != x_lesson_resets) {
    x_last_lesson.reset();
    x_lesson_resets = now.resets;
    return;
  }
  const bool is_due = !x_last_lesson || x_stamp_s - x_last_lesson->stamp_s >= kEvery_s;
  if (!is_due || now.stamp_s - now.confirmed_s > kJustConfirmed_s) return;
  const KnownPose here{x_stamp_s, x_T_map_body, covarianceOf(now.car)};
  if (x_last_lesson) teach(*x_last_lesson, here);
  x_last_lesson = here;
}

void Localizer::believe(double stamp_s, const Registration& match) {
  const KnownPose now{stamp_s, match.T_target_source, match.covariance};
  if (x_last_match && stamp_s - x_last_match->stamp_s < kLongestLesson_s) teach(*x_last_match, now);
  x_last_match = now;
  const Pose& T = match.T_target_source;
  if (const auto place = x_surface.at(T.translation().head<2>(), yawOf(T), T.translation().z());
      place && place->road)
    x_height_above_road_m = T.translation().z() - place->road->height_m;
  x_T_map_body = stamp_s < x_stamp_s ? Pose(T * motionBetween(stamp_s, x_stamp_s)) : T;
  x_T_map_body = poseAt(x_stamp_s, x_fusion->newest().car);
}

Matrix6d Localizer::covarianceOf(const CarState& car) const {
  constexpr double kUnknownHeight_m = 1.0, kUnknownTilt_rad = 0.1;
  Matrix6d covariance = x_last_match ? x_last_match->covariance : Matrix6d(Matrix6d::Zero());
  if (!x_last_match) {
    covariance.diagonal() << std::pow(kUnknownTilt_rad, 2), std::pow(kUnknownTilt_rad, 2), 0, 0, 0,
        std::pow(kUnknownHeight_m, 2);
  }
  const Eigen::Rotation2Dd R_body_map(-car.mean(2));
  const Eigen::Matrix2d R = R_body_map.toRotationMatrix();
  covariance.row(2).setZero();
  covariance.col(2).setZero();
  covariance.block<2, 6>(3, 0).setZero();
  covariance.block<6, 2>(0, 3).setZero();
  covariance(2, 2) = car.covariance(2, 2);
  covariance.block<2, 2>(3, 3) = R * car.covariance.topLeftCorner<2, 2>() * R.transpose();
  const Eigen::Vector2d cross = R * car.covariance.block<2, 1>(0, 2);
  covariance.block<2, 1>(3, 2) = cross;
  covariance.block<1, 2>(2, 3) = cross.transpose();
  return covariance;
}

Integrity Localizer::integrityOf(const EstimatorState& state, const Pose& T_map_body) const {
  std::optional<double> gap_m;
  if (const auto place =
          x_surface.at(state.car.mean.head<2>(), state.car.mean(2), T_map_body.translation().z())) {
    if (place->gap_left_m) gap_m = place->gap_left_m;
    if (place->gap_right_m) gap_m = std::min(gap_m.value_or(HUGE_VAL), *place->gap_right_m);
  }
  return assess(state, gap_m, x_options.estimator, x_options.integrity);
}

void Localizer::publish(std::vector<LocalizerOutput>& outputs) {
  if (!started() || !(x_stamp_s > x_published_s)) return;
  x_published_s = x_stamp_s;
  const EstimatorState& now = x_fusion->newest();
  const CarState& car = now.car;
  const Pose T = poseAt(x_stamp_s, car);

  FaultCounts faults = std::exchange(x_noted, {});
  faults.merge(x_queue.takeFaults(x_stamp_s));
  const std::vector<std::string> motion_faults = x_history.faults();
  for (const std::string& fault : motion_faults) ++faults[fault];
  for (const std::string& fault : x_window.takeFaults()) ++faults[fault];

  Integrity integrity = integrityOf(now, T);
  const auto degrade = [&](const std::string& cause) {
    if (integrity.state != LocalizationState::ok) return;
    integrity.state = LocalizationState::degraded;
    integrity.cause = cause;
  };
  if (x_window.isDegraded()) degrade("a tile of the map near the car is damaged");
  if (!motion_faults.empty()) degrade(motion_faults.front());
  const Control& control = x_fusion->newestControl();
  outputs.push_back({x_stamp_s, T, covarianceOf(car), control.speed_mps, control.yaw_rate_rps, x_by_wheels,
                     std::move(faults), std::move(integrity), std::exchange(x_new_decision, std::nullopt),
                     std::exchange(x_new_decisions, {}), std::exchange(x_new_match, std::nullopt),
                     std::exchange(x_new_walls, std::nullopt)});
}

}  // namespace raceloc
