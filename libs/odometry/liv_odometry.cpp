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
/** What dead reckoning of one scan leaves open on every axis: 3 deg, 0.5 m. */
const Matrix6d kLost = (Vector6d() << 0.0027, 0.0027, 0.0027, 0.25, 0.25, 0.25).finished().asDiagonal();

/** Twist of a motion: for the next one when the wheels say nothing. */
Vector6d velocityOf(const BodyMotion& motion) {
  return motion.duration_s > 0 ? Vector6d(se3Log(motion.T_start_end) / motion.duration_s)
                               : Vector6d(Vector6d::Zero());
}

}  // namespace

MotionHistory::Rates LivOdometry::ratesOf(const Scan& scan, const MotionHistory& history,
                                          bool& by_wheels) const {
  const auto rates = history.ratesBetween(scan.stamp_s, endOfSweep(scan));
  by_wheels = rates.has_value();
  if (rates) return *rates;
  const Vector6d velocity = velocityOf(x_last_motion);
  return {velocity(3), velocity(2)};
}

OdometryStep LivOdometry::add(const Scan& scan, const MotionHistory& history) {
  OdometryStep step{};
  const auto rates = ratesOf(scan, history, step.by_wheels);
  DeskewedScan deskewed = deskew(scan, rates.speed_mps, rates.yaw_rate_rps, x_crop);
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
    step.trusted = step.match.trusted(x_gicp);
    const Pose T_odom_body = step.trusted ? step.match.T_target_source : T_guess;
    step.since_last = {duration_s, x_T_odom_body.inverse() * T_odom_body, step.match.covariance};
    if (!step.trusted)
      step.since_last.covariance = (wheels ? wheels->covariance : Matrix6d(Matrix6d::Zero())) + kLost;
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
  if (step.trusted ||
      step.restarted) {  // a scan at a doubtful pose would spoil the map for those that follow
    x_local_map.insert(viewOf(step.scan.cloud), step.scan.covariances.view(), toTransform(x_T_odom_body));
    const Eigen::Vector3d p = x_T_odom_body.translation();
    x_local_map.keepWithin({p.x(), p.y(), p.z()}, x_options.local_map_radius_m);
  }
  return step;
}

}  // namespace raceloc
