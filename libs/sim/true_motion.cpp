#include "sim/true_motion.h"

#include <algorithm>
#include <stdexcept>

namespace raceloc {

void TrueMotion::add(const RaceCarState& state) {
  x_states.push_back(state);
  while (x_states.back().time_s - x_states.front().time_s > x_memory_s) x_states.pop_front();
}

RaceCarState TrueMotion::state(double time_s) const {
  if (x_states.size() < 2 || time_s < x_states.front().time_s - 1e-9 ||
      time_s > x_states.back().time_s + 1e-9)
    throw std::out_of_range("TrueMotion: no state at this time");
  const double steps = (time_s - x_states.front().time_s) / RaceCar::kStep_s;
  const auto i = std::min(static_cast<std::size_t>(std::max(0.0, steps)), x_states.size() - 2);
  const RaceCarState &a = x_states[i], &b = x_states[i + 1];
  const double share = (time_s - a.time_s) / (b.time_s - a.time_s);
  RaceCarState x = a;
  for (auto member : {&RaceCarState::time_s, &RaceCarState::s_m, &RaceCarState::n_m,
                      &RaceCarState::heading_rad, &RaceCarState::forward_mps, &RaceCarState::leftward_mps,
                      &RaceCarState::yaw_rate_rps, &RaceCarState::steering_rad, &RaceCarState::pitch_rad,
                      &RaceCarState::roll_rad, &RaceCarState::heave_m, &RaceCarState::forward_mps2,
                      &RaceCarState::leftward_mps2, &RaceCarState::wheel_slip})
    x.*member = (1 - share) * a.*member + share * b.*member;
  return x;
}

Pose TrueMotion::T_map_body(double time_s) const { return bodyPose(x_track, x_car, state(time_s)); }

Eigen::Vector3d TrueMotion::gyro_body_rps(double time_s) const {
  const Eigen::Matrix3d R_before = T_map_body(time_s - kReach_s).linear();
  const Eigen::AngleAxisd turn(
      Eigen::Matrix3d(R_before.transpose() * T_map_body(time_s + kReach_s).linear()));
  return turn.angle() / (2 * kReach_s) * turn.axis();
}

Eigen::Vector3d TrueMotion::velocity_map_mps(double time_s, const Eigen::Vector3d& p_body_m) const {
  return (T_map_body(time_s + kReach_s) * p_body_m - T_map_body(time_s - kReach_s) * p_body_m) /
         (2 * kReach_s);
}

Eigen::Vector3d TrueMotion::specificForce_body_mps2(double time_s, const Eigen::Vector3d& p_body_m) const {
  const Pose T = T_map_body(time_s);
  const Eigen::Vector3d acceleration_map_mps2 =
      (T_map_body(time_s + kReach_s) * p_body_m - 2 * (T * p_body_m) +
       T_map_body(time_s - kReach_s) * p_body_m) /
      (kReach_s * kReach_s);
  return T.linear().transpose() * (acceleration_map_mps2 + Eigen::Vector3d(0, 0, kGravity_mps2));
}

}  // namespace raceloc
