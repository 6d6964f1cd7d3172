/** \file
 * How fast the body moves along its own z axis: springs and pitch, which no wheel tells. */
#pragma once

#include <optional>

#include "core/types.h"

namespace raceloc {

/** A Kalman filter over the velocity v of the IMU and the force s that it feels while nothing changes, gravity and
 * bias, both in the body's axes:
 *   v' = f - s - w x v,   s' = -w x s but for a walk.
 * It is held, loosely, to the velocity of the road: ahead as the wheels say, across by side-slip, and none out of it.
 * So it tells what is faster than about a third of a second: a body that pitches by 0.2 deg at 60 m/s moves along its z axis by
 * 0.2 m/s. Source: Groves, Principles of GNSS (2013), Eq. (5.45), without the earth's turn; held to the road as in
 * Dissanayake et al., IEEE TRA 17 (2001). */
class VerticalVelocity {
 public:
  /** White errors at 100 Hz. */
  struct Sigmas {
    double ahead_mps, across_mps, out_of_road_mps;
  };
  VerticalVelocity(const Sigmas& sigmas, double max_gap_s) : x_sigmas(sigmas), x_max_gap_s(max_gap_s) {}

  struct Sample {
    double stamp_s;
    Eigen::Vector3d gyro_rps, force_mps2;
  };
  /** Samples come in order of time; after a gap all starts again.
   * \param p_body_imu_m  the same in all samples
   * \param on_road_mps   velocity of the body's origin ahead and to the left; none if unknown
   * \return that along its z axis, at the sample [m/s] */
  double add(const Sample& sample, const Eigen::Vector3d& p_body_imu_m,
             const std::optional<Eigen::Vector2d>& on_road_mps);

  void forget() { x_last.reset(); }

 private:
  void start(const Eigen::Vector3d& velocity_mps);
  void predict(const Sample& to);

  Sigmas x_sigmas;
  double x_max_gap_s;
  std::optional<Sample> x_last;
  Vector6d x_mean;  ///< v, s
  Matrix6d x_covariance;
};

}  // namespace raceloc
