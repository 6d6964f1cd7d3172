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
  /** \param across_sigma_mps, out_of_road_sigma_mps  how loosely it is held, as white errors at 100 Hz */
  VerticalVelocity(double across_sigma_mps, double out_of_road_sigma_mps, double max_gap_s)
      : x_across_sigma_mps(across_sigma_mps),
        x_out_of_road_sigma_mps(out_of_road_sigma_mps),
        x_max_gap_s(max_gap_s) {}

  struct Sample {
    double stamp_s;
    Eigen::Vector3d gyro_rps, force_mps2;
  };
  /** Velocity of the body's origin. */
  struct OnRoad {
    double ahead_mps, across_mps;  ///< across: to the left
    double ahead_sigma_mps;        ///< white at 100 Hz
  };
  /** Samples come in order of time; after a gap all starts again.
   * \param p_body_imu_m  the same in all samples
   * \return velocity of the body's origin along its z axis, at the sample [m/s] */
  double add(const Sample& sample, const Eigen::Vector3d& p_body_imu_m, const std::optional<OnRoad>& on_road);

  void forget() { x_last.reset(); }

 private:
  void start(const Eigen::Vector3d& velocity_mps);
  void predict(const Sample& to);

  double x_across_sigma_mps, x_out_of_road_sigma_mps, x_max_gap_s;
  std::optional<Sample> x_last;
  Vector6d x_mean;  ///< v, s
  Matrix6d x_covariance;
};

}  // namespace raceloc
