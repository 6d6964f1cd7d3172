/** \file
 * Trajectories whose errors are known by hand. */
#pragma once

#include <cmath>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "eval/trajectory_errors.h"

namespace raceloc::test {

inline constexpr double kRounding_m = 1e-9;  // double at 100 m, a few operations

/** A circle of 50 m radius, driven to the left at 10 m/s, heading along it; `left_m` towards its centre. */
inline StampedPose onCircle(double stamp_s, double left_m = 0) {
  const double angle_rad = stamp_s * 10 / 50;
  const double radius_m = 50 - left_m;
  return {stamp_s, poseFromRpy({radius_m * std::sin(angle_rad), 50 - radius_m * std::cos(angle_rad), 2}, 0, 0,
                               wrapAngle(angle_rad))};
}

/** East along x at 10 m/s. */
inline StampedPose onStraight(double stamp_s) {
  return {stamp_s, poseFromRpy({10 * stamp_s, 0, 0}, 0, 0, 0)};
}

inline TrajectoryFile file(const std::string& path, std::vector<StampedPose> poses) {
  return {path, 0, {std::nullopt, std::move(poses)}};
}

template <class At>
TrajectoryFile sampled(const std::string& path, double from_s, double to_s, double step_s, At at) {
  std::vector<StampedPose> poses;
  const int last = static_cast<int>(std::lround((to_s - from_s) / step_s));
  for (int i = 0; i <= last; ++i) poses.push_back(at(from_s + i * step_s));
  return file(path, poses);
}

inline TrajectoryFile moved(TrajectoryFile file, const Pose& T) {
  for (auto& pose : file.trajectory.poses) pose.T_map_body = T * pose.T_map_body;
  return file;
}

inline TrajectoryFile straight(const std::string& path) { return sampled(path, 0, 10, 0.1, onStraight); }

}  // namespace raceloc::test
