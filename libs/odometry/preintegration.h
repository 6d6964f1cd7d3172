/** \file
 * Rates of the body, integrated once: the motion of an interval, with what noise and calibration do to it, so that a
 * new calibration needs no new integration. */
#pragma once

#include "core/types.h"

namespace raceloc {

/** Sigmas of rates are those of samples at 100 Hz: white noise of this density per variance. */
constexpr double kSample_s = 0.01;

/** What calibrates the sources of motion, as a vector. */
enum Calibration {
  kGyroBiasX,  ///< of the gyro in the body's axes [rad/s]: true = measured - bias
  kGyroBiasY,
  kGyroBiasZ,
  kWheelScale,      ///< true speed = (1 + scale - traction * force) * measured
  kTraction,        ///< slip of the driven wheels per force along the car [1 per m/s^2, at the load of 1 g]
  kSteeringOffset,  ///< of the road wheels [rad]: true = measured - offset
  kSideslip,  ///< angle from course to heading at the rear axle per lateral force [rad per m/s^2, at 1 g]
  kRise,      ///< slow angle from the body's x axis up to its course: minus the angle of attack [rad]
  kCalibrations
};
using CalibrationVector = Eigen::Matrix<double, kCalibrations, 1>;
using CalibrationMatrix = Eigen::Matrix<double, kCalibrations, kCalibrations>;
using CalibrationJacobian = Eigen::Matrix<double, 6, kCalibrations>;

/** How the body moves at an instant: its twist in its own axes, rotation [rad/s] before translation [m/s]. */
struct BodyRates {
  Vector6d twist = Vector6d::Zero();
  Vector6d noise_density = Vector6d::Zero();  ///< of white noise on the twist [(rad/s)^2 s, (m/s)^2 s]
  CalibrationJacobian J_calibration = CalibrationJacobian::Zero();  ///< d twist / d calibration
};

/** Motion over an interval. Tangents are those of right increments, T exp(xi).
 * Source: reading.md section 5; recursion of Forster et al., TRO 33 (2017), with the whole twist in the exponential:
 * exact for rates that are constant within a step. */
struct Preintegration {
  double duration_s = 0;
  Pose T_start_end = Pose::Identity();
  Matrix6d covariance = Matrix6d::Zero();                           ///< of the end pose, by noise alone
  CalibrationJacobian J_calibration = CalibrationJacobian::Zero();  ///< of the end pose

  /** The rates go on for another `step_s` >= 0. */
  void append(const BodyRates& rates, double step_s);

  /** As integrated with a calibration that differs by `change`, to first order. */
  [[nodiscard]] Pose corrected(const CalibrationVector& change) const {
    return T_start_end * se3Exp(J_calibration * change);
  }
};

}  // namespace raceloc
