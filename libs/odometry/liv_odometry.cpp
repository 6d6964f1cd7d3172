#include "odometry/liv_odometry.h"

#include <stdexcept>
#include <utility>

#include "cloud/voxel_grid.h"
#include "registration/search.h"

namespace raceloc {

void OdometryOptions::describe(OptionList& keys) {
  keys.add("first_step_m", first_step_m, between(0, 50),
           "without wheel speed, the second scan is looked for this far around the first [m]");
  keys.add("scan_voxel_m", scan_voxel_m, above(0), "scans are thinned to one point a voxel of this edge [m]");
  keys.add("local_map_radius_m", local_map_radius_m, above(0),
           "the local map reaches this far from the car [m]");
}

LivOdometry::LivOdometry(gpu::Context& context, const OdometryOptions& options, const CropOptions& crop,
                         const CovarianceOptions& covariance, const GicpOptions& gicp)
    : x_context(context),
      x_options(options),
      x_crop(crop),
      x_covariance(covariance),
      x_gicp(gicp),
      x_local_map(context, gicp.voxel_size_m) {}

namespace {

/** Scans without a match before the local map is given up and begun anew at the dead-reckoned pose. */
constexpr int kLostForGood = 10;
/** So many scans in a row may go into the local map by dead reckoning: without them the car would leave the map, and never match
 * again. */
constexpr int kMappedBlindly = 5;
/** What dead reckoning of one scan leaves open on every axis: 3 deg, 0.5 m. */
const Matrix6d kLost = (Vector6d() << 0.0027, 0.0027, 0.0027, 0.25, 0.25, 0.25).finished().asDiagonal();

/** Twist of a motion: for the next one when the wheels say nothing. */
Vector6d velocityOf(const BodyMotion& motion) {
  return motion.duration_s > 0 ? Vector6d(se3Log(motion.T_start_end) / motion.duration_s)
                               : Vector6d(Vector6d::Zero());
}

/** What a match adds to a prediction: both are poses of the same instant, weighed by their covariances. A match that
 * contradicts the prediction beyond chance along the direction that it knows worst (a wall that looks the same everywhere),
 * or did not come to rest, does not count along it. */
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

OdometryStep LivOdometry::add(const Sweep& sweep, MotionHistory& history) {
  OdometryStep step{};
  const auto poses = history.sweep(sweep.begin_s, sweep.end_s);
  step.by_wheels = poses.has_value();
  DeskewedScan deskewed = deskew(
      sweep, poses ? *poses : steadySweep(velocityOf(x_last_motion), sweep.end_s - sweep.begin_s), x_crop);
  step.stamp_s = deskewed.stamp_s;
  if (x_last_stamp_s && step.stamp_s <= *x_last_stamp_s)
    throw std::invalid_argument("LivOdometry: scans must come in order of time");

  step.scan =
      withCovariances(x_context, voxelGrid(x_context, deskewed.cloud, x_options.scan_voxel_m), x_covariance);
  step.full_scan = std::move(deskewed.cloud);
  step.match.T_target_source = Pose::Identity();
  step.trusted = !step.scan.cloud.empty();
  if (x_last_stamp_s) {
    const double duration_s = step.stamp_s - *x_last_stamp_s;
    const auto wheels = history.between(*x_last_stamp_s, step.stamp_s);
    const Pose T_last_guess = wheels ? wheels->T_start_end : se3Exp(velocityOf(x_last_motion) * duration_s);
    const Pose T_guess = x_T_odom_body * T_last_guess;
    const bool speed_unknown = !wheels && !x_ever_matched;
    SearchOptions around;
    around.radius_m = x_options.first_step_m;
    around.step_m = 0.75 * x_gicp.voxel_size_m;
    step.match = speed_unknown ? alignWithSearch(x_context, step.scan, x_local_map, T_guess, x_gicp, around)
                               : align(x_context, step.scan, x_local_map, T_guess, x_gicp);
    step.trusted = wheels ? step.match.plausible(x_gicp) : step.match.trusted(x_gicp);
    Fused now{T_guess, (wheels ? wheels->covariance : Matrix6d(Matrix6d::Zero())) + kLost};
    if (step.trusted && wheels) {
      now = fused(T_guess, wheels->covariance, step.match);
      if (step.match.stop == gpu::Stop::converged)  // both ends have the match's error
        history.observe(*x_last_stamp_s, step.stamp_s, x_T_odom_body.inverse() * step.match.T_target_source,
                        2 * step.match.covariance);
    } else if (step.trusted) {
      now = {step.match.T_target_source, step.match.covariance};
    }
    const Pose T_odom_body = now.pose;
    step.since_last = {duration_s, x_T_odom_body.inverse() * T_odom_body, now.covariance};
    x_ever_matched = x_ever_matched || step.trusted;
    x_T_odom_body = T_odom_body;
    x_last_motion = step.since_last;
  }
  step.T_odom_body = x_T_odom_body;
  x_last_stamp_s = step.stamp_s;

  x_lost_in_a_row = step.trusted ? 0 : x_lost_in_a_row + 1;
  if (x_lost_in_a_row == kLostForGood && !step.scan.cloud.empty()) {
    x_local_map = gpu::VoxelMap(x_context, x_gicp.voxel_size_m);
    step.restarted = true;
    x_lost_in_a_row = 0;
  }
  // A scan at a doubtful pose would spoil the map for those that follow.
  const bool reckoned = step.by_wheels && history.faults().empty() && x_lost_in_a_row <= kMappedBlindly;
  if (step.trusted || step.restarted || (reckoned && !step.scan.cloud.empty())) {
    x_local_map.insert(viewOf(step.scan.cloud), step.scan.covariances.view(), toTransform(x_T_odom_body));
    const Eigen::Vector3d p = x_T_odom_body.translation();
    x_local_map.keepWithin({p.x(), p.y(), p.z()}, x_options.local_map_radius_m);
  }
  return step;
}

}  // namespace raceloc
