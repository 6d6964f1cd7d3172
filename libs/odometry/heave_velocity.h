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
 * At 60 m/s a body that pitches by 0.2 deg moves along its z axis by 0.2 m/s. What is slower than
 *   sqrt(walk / (out_of_road_sigma * sqrt(0.01 s))) / 2 pi,
 * 0.07 Hz as shipped, is held back. Source: inertial navigation in body axes, e.g. Groves, Principles of GNSS (2013),
 * ch. 5, without the earth's turn; held to the road as in Dissanayake et al., IEEE TRA 17 (2001). */
class HeaveVelocity {
 public:
  /** Bodies swing at 1 to 4 Hz: what is missing for longer than a tenth of a swing is not known. */
  static constexpr double kSwingTenth_s = 0.035;

  /** White errors at 100 Hz of what it is held to, across the road and out of it. */
  HeaveVelocity(double lateral_sigma_mps, double out_of_road_sigma_mps)
      : x_lateral_sigma_mps(lateral_sigma_mps), x_out_of_road_sigma_mps(out_of_road_sigma_mps) {}

  struct Sample {
    double stamp_s;
    Eigen::Vector3d gyro_rps,
        force_mps2;  ///< in the body's axes; the specific force, about +9.81 on z at rest
    Eigen::Vector3d p_body_imu_m;
  };
  /** Velocity of the body's origin, in its axes. */
  struct OnRoad {
    double forward_mps, lateral_mps;
    double forward_sigma_mps;  ///< white at 100 Hz
  };
  /** The stamps of samples increase. When more than a swing's tenth is missing, or the IMU is another one, it starts
   * again. \return velocity of the body's origin along its z axis, at the sample [m/s]; 0 at a start */
  double add(const Sample& sample, const OnRoad& road);

  void forget() { x_last.reset(); }

 private:
  void start(const Sample& sample, const OnRoad& road);
  void predict(const Sample& to);

  double x_lateral_sigma_mps, x_out_of_road_sigma_mps;
  std::optional<Sample> x_last;
  Vector6d x_mean;  ///< v [m/s], s [m/s^2]
  Matrix6d x_covariance;
};

}  // namespace raceloc
