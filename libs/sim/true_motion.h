/** \file
 * The true motion of the car over the last seconds. */
#pragma once

#include <deque>

#include "sim/race_car.h"

namespace raceloc {

/** States of a car, kept for a while, and the motion between them. Times are since the start. The track must outlive
 * it. */
class TrueMotion {
 public:
  TrueMotion(const Track& track, const CarOptions& car, double memory_s)
      : x_track(track), x_car(car), x_memory_s(memory_s) {}

  void add(const RaceCarState& state);  ///< one step after the one before

  /** \name At any time between the oldest and the newest state. \throws std::out_of_range beyond
   * @{ */
  [[nodiscard]] RaceCarState state(double time_s) const;  ///< interpolated linearly between steps
  [[nodiscard]] Pose T_map_body(double time_s) const;
  /** @} */

  /** \name Differences of poses kReach_s before and after: the true motion, averaged over that time.
   * @{ */
  static constexpr double kReach_s = 0.005;
  [[nodiscard]] Eigen::Vector3d gyro_body_rps(double time_s) const;
  [[nodiscard]] Eigen::Vector3d velocity_map_mps(double time_s, const Eigen::Vector3d& p_body_m) const;
  /** Acceleration less gravity of a point fixed in the body, in the body's axes: +9.81 on z at rest. */
  [[nodiscard]] Eigen::Vector3d specificForce_body_mps2(double time_s, const Eigen::Vector3d& p_body_m) const;
  /** @} */

 private:
  const Track& x_track;
  CarOptions x_car;
  double x_memory_s;
  std::deque<RaceCarState> x_states;
};

}  // namespace raceloc
