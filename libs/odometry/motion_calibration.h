/** \file
 * What is wrong with the sources of motion, learnt from scan matches on the way. */
#pragma once

#include "core/options.h"
#include "odometry/preintegration.h"

namespace raceloc {

/** Section [calibration]. */
struct CalibrationOptions {
  double gyro_bias_sigma_dps = 0.3;
  double gyro_bias_walk_dps = 0.005;
  double wheel_scale_sigma = 0.02;
  double wheel_scale_walk = 0.0003;
  double traction_per_mps2 = 0.005;
  double traction_sigma_per_mps2 = 0.005;
  double traction_walk_per_mps2 = 0.0003;
  double steering_offset_sigma_deg = 1.0;
  double steering_offset_walk_deg = 0.01;
  double sideslip_deg_per_mps2 = 0.1;
  double sideslip_sigma_deg_per_mps2 = 0.15;
  double sideslip_walk_deg_per_mps2 = 0.01;
  double rise_sigma_deg = 0.3;
  double rise_walk_deg = 0.1;
  void describe(OptionList& keys);
};

/** A Kalman filter over the calibration; each scan match that is believed is a measurement of the motion that had been
 * pre-integrated. Source: reading.md section 5. */
class MotionCalibration {
 public:
  explicit MotionCalibration(const CalibrationOptions& options);

  [[nodiscard]] const CalibrationVector& mean() const { return x_mean; }
  [[nodiscard]] const CalibrationMatrix& covariance() const { return x_covariance; }

  /** \param motion pre-integrated with mean() \param T_start_end measured over the same interval
   * \param covariance of the measurement, right increment (rad, m), positive definite
   * \return false, and nothing is learnt, if the two contradict each other beyond chance */
  bool observe(const Preintegration& motion, const Pose& T_start_end, const Matrix6d& covariance);

 private:
  CalibrationVector x_mean = CalibrationVector::Zero();
  CalibrationMatrix x_covariance = CalibrationMatrix::Zero();
  CalibrationVector x_walk_density;  ///< of the random walks, per second
  double x_rise_forgotten_per_s;     ///< so that its sigma, unobserved, stays that of the start
};

}  // namespace raceloc
