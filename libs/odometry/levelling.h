/** \file
 * Which way is up, from the accelerometer and the motion that the odometry measured. */
#pragma once

#include <algorithm>
#include <cmath>
#include <optional>

#include "core/options.h"
#include "odometry/motion_history.h"

namespace raceloc {

/** Section [level]. */
struct LevelOptions {
  double accelerometer_sigma_mps2 = 0.5;
  double accelerometer_bias_mps2 = 0.1;
  double start_tilt_deg = 15;
  double tilt_walk_deg = 0.05;
  void describe(OptionList& keys);
};

/** Roll and pitch against gravity, whatever the odometry's own frame has drifted to. */
struct Level {
  Eigen::Vector3d up_body;  ///< unit vector, against gravity
  double sigma_rad;         ///< of its direction, the worse of the two axes

  [[nodiscard]] double roll_rad() const { return std::atan2(up_body.y(), up_body.z()); }  ///< of R = Rz Ry Rx
  [[nodiscard]] double pitch_rad() const { return std::asin(-std::clamp(up_body.x(), -1.0, 1.0)); }
};

/** A Kalman filter over the velocity of the IMU and gravity, both in the odometry's frame, and the accelerometer's
 * bias:
 *   v' = R (f - b) + g,   g' = 0 but for the odometry's drift,   |g| = 9.81 m/s^2;
 * each measured motion tells the velocity. A turn in a bank is no tilt to it, as it would be to the accelerometer
 * alone. Source: reading.md section 5 ("gravity-aligned"); the model is that of inertial navigation, Groves,
 * Principles of GNSS (2013), Eq. (5.20), without the earth's turn. */
class Levelling {
 public:
  explicit Levelling(const LevelOptions& options);

  /** The next motion that was measured. Times follow each other; after a gap, or while the accelerometer is silent,
   * gravity goes on as it was, and the velocity starts again.
   * \param from_s begin of the motion \param R_odom_from attitude then */
  void add(double from_s, const Eigen::Matrix3d& R_odom_from, const BodyMotion& motion,
           const MotionHistory& history);

  /** Of the body with this attitude; none before the first second of accelerations. */
  [[nodiscard]] std::optional<Level> level(const Eigen::Matrix3d& R_odom_body) const;

 private:
  enum State { kVelocity = 0, kGravity = 3, kBias = 6, kStates = 9 };
  using StateMatrix = Eigen::Matrix<double, kStates, kStates>;
  /** x gets nearer to z = H x + noise of covariance R. */
  template <int N>
  void update(const Eigen::Matrix<double, N, 1>& z, const Eigen::Matrix<double, N, kStates>& H,
              const Eigen::Matrix<double, N, N>& R);

  LevelOptions x_options;
  Eigen::Matrix<double, kStates, 1> x_mean;
  StateMatrix x_covariance = StateMatrix::Zero();
  struct Instant {
    double stamp_s;
    Eigen::Matrix3d R_odom_body;
  };
  std::optional<Instant> x_last;  ///< of the velocity
  double x_felt_s = 0;            ///< so long the accelerometer has been heard
};

}  // namespace raceloc
