#include "odometry/vertical_velocity.h"

#include <Eigen/Cholesky>

namespace raceloc {

namespace {

constexpr double kGravity_mps2 = 9.81;
constexpr double kSample_s = 0.01;       // sigmas are of 100 Hz
constexpr double kForce_mps2 = 0.5;      // the accelerometer's, vibrations included
constexpr double kWalk_mps2 = 0.05;      // in a second: gravity, turned by a gyro that is 0.3 deg/s off
constexpr double kStart_mps = 1;         // as springs and pitch move it
constexpr double kStartTilt_mps2 = 2.5;  // gravity, 15 deg off

}  // namespace

void VerticalVelocity::start(const Eigen::Vector3d& velocity_mps) {
  x_mean << velocity_mps, 0, 0, kGravity_mps2;
  x_covariance.setZero();
  x_covariance.diagonal().head<3>().setConstant(kStart_mps * kStart_mps);
  x_covariance.diagonal().tail<3>().setConstant(kStartTilt_mps2 * kStartTilt_mps2);
}

void VerticalVelocity::predict(const Sample& to) {
  const double dt_s = to.stamp_s - x_last->stamp_s;
  Vector6d back = Vector6d::Zero();
  back.head<3>() = -0.5 * dt_s * (x_last->gyro_rps + to.gyro_rps);
  const Eigen::Matrix3d R_to_last = se3Exp(back).linear();
  Matrix6d F = Matrix6d::Zero();
  F.topLeftCorner<3, 3>() = F.bottomRightCorner<3, 3>() = R_to_last;
  F.topRightCorner<3, 3>() = -dt_s * R_to_last;
  x_mean = F * x_mean;
  x_mean.head<3>() += 0.5 * dt_s * (R_to_last * x_last->force_mps2 + to.force_mps2);
  x_covariance = F * x_covariance * F.transpose();
  x_covariance.diagonal().head<3>().array() += kForce_mps2 * kForce_mps2 * kSample_s * dt_s;
  x_covariance.diagonal().tail<3>().array() += kWalk_mps2 * kWalk_mps2 * dt_s;
}

double VerticalVelocity::add(const Sample& sample, const Eigen::Vector3d& p_body_imu_m,
                             const std::optional<OnRoad>& on_road) {
  constexpr double kUnknown_mps = 1000;  // at 100 Hz: any speed of a car
  const OnRoad road = on_road.value_or(OnRoad{0, 0, kUnknown_mps});
  const Eigen::Vector3d lever_mps = sample.gyro_rps.cross(p_body_imu_m);
  const Eigen::Vector3d road_mps = lever_mps + Eigen::Vector3d(road.ahead_mps, road.across_mps, 0);
  if (!x_last || sample.stamp_s - x_last->stamp_s > x_max_gap_s) {
    start(road_mps);
    x_last = sample;
    return 0;
  }
  predict(sample);
  const Eigen::Vector3d sigma_mps(road.ahead_sigma_mps, on_road ? x_across_sigma_mps : kUnknown_mps,
                                  x_out_of_road_sigma_mps);
  const Eigen::Vector3d variance = sigma_mps.cwiseAbs2() * (kSample_s / (sample.stamp_s - x_last->stamp_s));
  const Eigen::Matrix3d S = x_covariance.topLeftCorner<3, 3>() + Eigen::Matrix3d(variance.asDiagonal());
  const Eigen::Matrix<double, 6, 3> K = S.ldlt().solve(x_covariance.topRows<3>()).transpose();
  Matrix6d rest = Matrix6d::Identity();
  rest.leftCols<3>() -= K;
  x_mean += K * (road_mps - x_mean.head<3>());
  x_covariance = rest * x_covariance * rest.transpose() + K * variance.asDiagonal() * K.transpose();
  x_last = sample;
  return x_mean.z() - lever_mps.z();
}

}  // namespace raceloc
