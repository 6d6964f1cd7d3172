#include "odometry/heave_velocity.h"

#include <Eigen/Cholesky>

#include "odometry/preintegration.h"

namespace raceloc {

namespace {

constexpr double kForce_mps2 = 0.5;      // of the accelerometer, white at 100 Hz, vibrations included
constexpr double kWalk_mps2 = 0.05;      // in a second: gravity, turned by a gyro that is 0.3 deg/s off
constexpr double kStart_mps = 1;         // as springs and pitch move the body
constexpr double kStartTilt_mps2 = 2.5;  // gravity, 15 deg off

Eigen::Vector3d leverVelocity_mps(const HeaveVelocity::Sample& sample) {
  return sample.gyro_rps.cross(sample.p_body_imu_m);
}

}  // namespace

void HeaveVelocity::start(const Sample& sample, const OnRoad& road) {
  x_mean << leverVelocity_mps(sample) + Eigen::Vector3d(road.forward_mps, road.lateral_mps, 0), 0, 0,
      kGravity_mps2;
  x_covariance.setZero();
  x_covariance.diagonal() << std::pow(road.forward_sigma_mps, 2),
      Eigen::Vector2d::Constant(kStart_mps * kStart_mps),
      Eigen::Vector3d::Constant(kStartTilt_mps2 * kStartTilt_mps2);
}

void HeaveVelocity::predict(const Sample& to) {
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

double HeaveVelocity::add(const Sample& sample, const OnRoad& road) {
  if (!x_last || sample.stamp_s - x_last->stamp_s > kSwingTenth_s ||
      sample.p_body_imu_m != x_last->p_body_imu_m) {
    start(sample, road);
    x_last = sample;
    return 0;
  }
  predict(sample);
  const Eigen::Vector3d lever_mps = leverVelocity_mps(sample);
  const Eigen::Vector3d road_mps = lever_mps + Eigen::Vector3d(road.forward_mps, road.lateral_mps, 0);
  const Eigen::Vector3d variance =
      Eigen::Vector3d(road.forward_sigma_mps, x_lateral_sigma_mps, x_out_of_road_sigma_mps).cwiseAbs2() *
      (kSample_s / (sample.stamp_s - x_last->stamp_s));
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
