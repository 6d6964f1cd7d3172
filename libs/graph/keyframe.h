#pragma once

#include <optional>
#include <string>
#include <vector>

#include "core/types.h"

namespace raceloc {

/** Antenna position at a key pose, interpolated between the receiver's fixes. */
struct KeyGps {
  std::string receiver;
  Eigen::Vector3d p_map_antenna_m;
  Eigen::Matrix3d cov_map_m2;
  Eigen::Vector3d p_body_antenna_m;
  bool refused = false;  ///< no graph takes it
};

/** Attitude at a key pose as a receiver's INS had it. */
struct KeyAttitude {
  Eigen::Matrix3d R_map_body;
  Eigen::Matrix3d covariance_rad2;  ///< right increment
};

/** Which way is up at a key pose, by the accelerometer. */
struct KeyLevel {
  Eigen::Vector3d up_body;  ///< unit vector
  double sigma_rad;
};

/** One key pose: where the LiDAR odometry put it, and what else was known about it then. */
struct Keyframe {
  double stamp_s;
  Pose T_odom_body;
  BodyMotion since_last;  ///< LiDAR odometry from the key pose before; zero duration where a drive begins
  std::optional<BodyMotion> reckoned = std::nullopt;  ///< the same motion by gyro and wheels alone
  std::vector<KeyGps> gps = {};                       ///< one a receiver
  std::vector<KeyAttitude> attitudes = {};
  std::optional<KeyLevel> level = std::nullopt;
};

/** Whether a key pose is the first of its drive: no odometry leads to it. */
[[nodiscard]] inline bool beginsDrive(const Keyframe& k) { return !(k.since_last.duration_s > 0); }

}  // namespace raceloc
