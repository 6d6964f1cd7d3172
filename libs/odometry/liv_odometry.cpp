#include "odometry/liv_odometry.h"

#include <algorithm>
#include <stdexcept>
#include <utility>

#include "registration/search.h"

namespace raceloc {

void OdometryOptions::describe(OptionList& keys) {
  keys.add("first_step_m", first_step_m, between(0, 50),
           "without wheel speed, the second scan is looked for this far around the first [m]");
  keys.add("scan_voxel_m", scan_voxel_m, above(0), "scans are thinned to one point a voxel of this edge [m]");
  keys.add("local_map_radius_m", local_map_radius_m, above(0),
           "the local map reaches this far from the car [m]");
  keys.add("key_scan_m", key_scan_m, atLeast(0),
           "a scan goes into the local map when the car has moved this far since the last one that did [m]");
  keys.add("covariance_scale", covariance_scale, atLeast(1),
           "as in [registration], of a match to the local map: the same LiDAR has seen it a moment before");
  keys.add("min_sigma_m", min_sigma_m, above(0), "likewise [m]");
  keys.add("min_sigma_deg", min_sigma_deg, above(0), "likewise [deg]");
}

namespace {

/** The local map is what the same LiDAR saw of the same surfaces a moment before, so that a match to it is surer than
 * one to a map of another day. */
GicpOptions toTheLocalMap(GicpOptions gicp, const OdometryOptions& options) {
  gicp.covariance_scale = options.covariance_scale;
  gicp.min_sigma_m = options.min_sigma_m;
  gicp.min_sigma_deg = options.min_sigma_deg;
  return gicp;
}

}  // namespace

LivOdometry::LivOdometry(gpu::Context& context, const OdometryOptions& options, const CropOptions& crop,
                         const CovarianceOptions& covariance, const GicpOptions& gicp,
                         const LevelOptions& level)
    : x_context(context),
      x_options(options),
      x_gicp(toTheLocalMap(gicp, options)),
      x_preparer(context, crop, options.scan_voxel_m, covariance),
      x_levelling(level),
      x_local_map(context, gicp.voxel_size_m) {}

namespace {

/** Scans without a match before the local map is given up and begun anew at the dead-reckoned pose. */
constexpr int kLostForGood = 10;
/** So many scans in a row may go into the local map by dead reckoning: without them the car would leave the map, and
 * never match again. */
constexpr int kMappedBlindly = 5;
/** Matches to one map share their errors from scan to scan: of what is learnt from them over seconds, they tell so many
 * times less, in variance, than of where the car is. */
constexpr double kShared = 5;
/** What dead reckoning of one scan leaves open on every axis: 3 deg, 0.5 m. */
const Matrix6d kLost = (Vector6d() << 0.0027, 0.0027, 0.0027, 0.25, 0.25, 0.25).finished().asDiagonal();

/** Twist of a motion: for the next one when the wheels say nothing. */
Vector6d velocityOf(const BodyMotion& motion) {
  return motion.duration_s > 0 ? Vector6d(se3Log(motion.T_start_end) / motion.duration_s)
                               : Vector6d(Vector6d::Zero());
}

/** What a match adds to a prediction: both are poses of the same instant, weighed by their covariances. A match that
 * contradicts the prediction beyond chance along the direction that it knows worst (a wall that looks the same
 * everywhere), or did not come to rest, does not count along it. */
struct Fused {
  Pose pose;
  Matrix6d covariance;  ///< right increment (rad, m)
};
Fused fused(const Pose& predicted, const Matrix6d& P, const Registration& match) {
  Matrix6d R = match.covariance;
  const Vector6d xi = se3Log(predicted.inverse() * match.T_target_source);
  Vector6d weak = Vector6d::Zero();
  weak.tail<3>() = match.weakest_direction;
  constexpr double kBeyondChance = 9;  // 3 sigma, squared
  const double off_m = weak.dot(xi);
  if (match.stop != gpu::Stop::converged || off_m * off_m > kBeyondChance * weak.dot((P + R) * weak)) {
    constexpr double kNothingKnown_m2 = 1e6;
    R += kNothingKnown_m2 * weak * weak.transpose();
  }
  const Matrix6d K = Eigen::LDLT<Matrix6d>(P + R).solve(P).transpose();
  const Matrix6d rest = Matrix6d::Identity() - K;
  return {predicted * se3Exp(K * xi), rest * P * rest.transpose() + K * R * K.transpose()};
}

}  // namespace

OdometryStep& LivOdometry::add(const Sweep& sweep, MotionHistory& history) {
  if (x_last_stamp_s && sweep.end_s <= *x_last_stamp_s)
    throw std::invalid_argument("LivOdometry: scans must come in order of time");
  CovarianceCloud scan;  // in the memory of the step before
  Cloud full_scan;
  if (x_step) {
    scan = std::move(x_step->scan);
    full_scan = std::move(x_step->full_scan);
  }
  OdometryStep& step = x_step.emplace();
  const auto poses = history.sweep(sweep.begin_s, sweep.end_s);
  step.by_wheels = poses && history.hasWheels(sweep.end_s);
  step.stamp_s = sweep.end_s;

  step.scan = x_preparer.prepare(
      sweep, poses ? *poses : steadySweep(velocityOf(x_last_motion), sweep.end_s - sweep.begin_s), &full_scan,
      std::move(scan));
  step.full_scan = std::move(full_scan);
  step.match.T_target_source = Pose::Identity();
  step.trusted = !step.scan.cloud.empty();
  if (x_last_stamp_s) {
    const double duration_s = step.stamp_s - *x_last_stamp_s;
    const auto predicted = history.between(*x_last_stamp_s, step.stamp_s);
    step.predicted = predicted;
    const Pose T_last_guess =
        predicted ? predicted->T_start_end : se3Exp(velocityOf(x_last_motion) * duration_s);
    const Pose T_guess = x_T_odom_body * T_last_guess;
    step.match = matched(step.scan, T_guess, predicted.has_value());
    step.trusted = predicted ? step.match.plausible(x_gicp) : step.match.trusted(x_gicp);
    Fused now{T_guess, (predicted ? predicted->covariance : Matrix6d(Matrix6d::Zero())) + kLost};
    if (step.trusted)
      now = predicted ? fused(T_guess, predicted->covariance, step.match)
                      : Fused{step.match.T_target_source, step.match.covariance};
    if (step.match.trusted(x_gicp))  // both ends have the match's error
      history.observe(*x_last_stamp_s, step.stamp_s, x_T_odom_body.inverse() * step.match.T_target_source,
                      2 * kShared * step.match.covariance);
    const Pose T_odom_body = now.pose;
    step.since_last = {duration_s, x_T_odom_body.inverse() * T_odom_body, now.covariance};
    x_levelling.add(*x_last_stamp_s, x_T_odom_body.linear(), step.since_last, history);
    x_ever_matched = x_ever_matched || step.trusted;
    x_T_odom_body = T_odom_body;
    x_last_motion = step.since_last;
  }
  step.T_odom_body = x_T_odom_body;
  step.level = x_levelling.level(x_T_odom_body.linear());
  x_last_stamp_s = step.stamp_s;

  x_lost_in_a_row = step.trusted ? 0 : x_lost_in_a_row + 1;
  if (x_lost_in_a_row >= kLostForGood && !step.scan.cloud.empty()) {
    x_local_map = gpu::VoxelMap(x_context, x_gicp.voxel_size_m);
    step.restarted = true;
    x_lost_in_a_row = 0;
  }
  extendMap(step, step.by_wheels && history.faults().empty());
  return step;
}

Registration LivOdometry::matched(const CovarianceCloud& scan, const Pose& T_guess, bool predicted) const {
  if (!predicted && !x_ever_matched) {
    SearchOptions around;
    around.radius_m = x_options.first_step_m;
    around.step_m = 0.75 * x_gicp.voxel_size_m;
    return alignWithSearch(x_context, scan, x_local_map, T_guess, x_gicp, around);
  }
  const auto believable = [&](const Registration& match) {
    return predicted ? match.plausible(x_gicp) : match.trusted(x_gicp);
  };
  Registration near = align(x_context, scan, x_local_map, T_guess, x_gicp);
  if (believable(near)) return near;
  // Pairs are looked for farther away, and the place that this gives is then matched as every other: a bad guess does
  // not lock the odometry out.
  constexpr int kFarthestVoxels = 27;
  GicpOptions farther = x_gicp;
  farther.neighbour_voxels = kFarthestVoxels;
  farther.max_distance_m = std::max(x_gicp.max_distance_m, 2 * x_gicp.voxel_size_m);
  const Registration far = align(x_context, scan, x_local_map, T_guess, farther);
  if (!far.trusted(farther)) return near;
  Registration there = align(x_context, scan, x_local_map, far.T_target_source, x_gicp);
  return believable(there) ? there : near;
}

void LivOdometry::extendMap(const OdometryStep& step, bool reckoned) {
  // A scan at a doubtful pose would spoil the map for those that follow.
  const bool placed = step.trusted || step.restarted || (reckoned && x_lost_in_a_row <= kMappedBlindly);
  const Eigen::Vector3d p = x_T_odom_body.translation();
  const bool moved = !x_last_key_m || (p - *x_last_key_m).norm() >= x_options.key_scan_m;
  if (!placed || step.scan.cloud.empty() || !(moved || step.restarted)) return;
  // Only what was never seen before is new: an average with later scans would creep with the error of each.
  x_local_map.fill(viewOf(step.scan.cloud), step.scan.covariances.view(), toTransform(x_T_odom_body));
  x_local_map.keepWithin({p.x(), p.y(), p.z()}, x_options.local_map_radius_m);
  x_last_key_m = p;
}

}  // namespace raceloc
