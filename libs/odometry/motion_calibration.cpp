#include "odometry/motion_calibration.h"

#include <cmath>

namespace raceloc {

void CalibrationOptions::describe(OptionList& keys) {
  keys.add("gyro_bias_sigma_dps", gyro_bias_sigma_dps, above(0),
           "of the gyro, each axis, at the start [deg/s]");
  keys.add("gyro_bias_walk_dps", gyro_bias_walk_dps, above(0), "and how it wanders [deg/s in a second]");
  keys.add("wheel_scale_sigma", wheel_scale_sigma, above(0),
           "share by which the wheel speed is off, at the start");
  keys.add("wheel_scale_walk", wheel_scale_walk, above(0), "and how it wanders [in a second]");
  keys.add("traction_per_mps2", traction_per_mps2, atLeast(0),
           "slip of the driven wheels against the force along the car, at the load of 1 g [1 per m/s^2], at "
           "the start ...");
  keys.add("traction_sigma_per_mps2", traction_sigma_per_mps2, above(0), "... its error [1 per m/s^2]");
  keys.add("traction_walk_per_mps2", traction_walk_per_mps2, above(0),
           "and how it wanders [1 per m/s^2 in a second]");
  keys.add("steering_offset_sigma_deg", steering_offset_sigma_deg, above(0),
           "of the road wheels, at the start [deg]");
  keys.add("steering_offset_walk_deg", steering_offset_walk_deg, above(0),
           "and how it wanders [deg in a second]");
  keys.add(
      "sideslip_deg_per_mps2", sideslip_deg_per_mps2, atLeast(0),
      "of the rear axle against the lateral force, at the load of 1 g [deg per m/s^2], at the start ...");
  keys.add("sideslip_sigma_deg_per_mps2", sideslip_sigma_deg_per_mps2, above(0),
           "... its error [deg per m/s^2]");
  keys.add("sideslip_walk_deg_per_mps2", sideslip_walk_deg_per_mps2, above(0),
           "and how it wanders [deg per m/s^2 in a second]");
  keys.add("rise_sigma_deg", rise_sigma_deg, above(0),
           "slow angle from the body's x axis up to its course, as it may be at any time [deg]");
  keys.add("rise_walk_deg", rise_walk_deg, above(0), "and how it wanders [deg in a second]");
}

MotionCalibration::MotionCalibration(const CalibrationOptions& o) {
  const double bias_rps = kDegree * o.gyro_bias_sigma_dps, bias_walk_rps = kDegree * o.gyro_bias_walk_dps;
  CalibrationVector sigma, walk;
  sigma << bias_rps, bias_rps, bias_rps, o.wheel_scale_sigma, o.traction_sigma_per_mps2,
      kDegree * o.steering_offset_sigma_deg, kDegree * o.sideslip_sigma_deg_per_mps2,
      kDegree * o.rise_sigma_deg;
  walk << bias_walk_rps, bias_walk_rps, bias_walk_rps, o.wheel_scale_walk, o.traction_walk_per_mps2,
      kDegree * o.steering_offset_walk_deg, kDegree * o.sideslip_walk_deg_per_mps2, kDegree * o.rise_walk_deg;
  x_mean(kTraction) = o.traction_per_mps2;
  x_mean(kSideslip) = kDegree * o.sideslip_deg_per_mps2;
  x_covariance = sigma.cwiseAbs2().asDiagonal();
  x_walk_density = walk.cwiseAbs2();
  x_rise_forgotten_per_s = std::pow(o.rise_walk_deg / o.rise_sigma_deg, 2) / 2;
}

bool MotionCalibration::observe(const Preintegration& motion, const Pose& T_start_end,
                                const Matrix6d& covariance) {
  const double rise_kept = std::exp(-x_rise_forgotten_per_s * motion.duration_s);
  x_mean(kRise) *= rise_kept;
  x_covariance.row(kRise) *= rise_kept;
  x_covariance.col(kRise) *= rise_kept;
  x_covariance.diagonal() += motion.duration_s * x_walk_density;
  const Vector6d r = se3Log(motion.T_start_end.inverse() * T_start_end);
  const CalibrationJacobian& H = motion.J_calibration;
  const Matrix6d noise = motion.covariance + covariance;
  const Eigen::LDLT<Matrix6d> S(H * x_covariance * H.transpose() + noise);
  constexpr double kBeyondChance = 22.5;  // chi squared, 6 degrees of freedom, 1 in 1000
  if (!(r.dot(S.solve(r)) < kBeyondChance)) return false;
  const Eigen::Matrix<double, kCalibrations, 6> K = S.solve(H * x_covariance).transpose();
  const CalibrationMatrix rest = CalibrationMatrix::Identity() - K * H;
  x_mean += K * r;
  x_covariance = rest * x_covariance * rest.transpose() + K * noise * K.transpose();
  return true;
}

}  // namespace raceloc
