#pragma once

#include <optional>

#include "core/types.h"

namespace raceloc {

/** Antenna position at a key pose, interpolated between the receiver's fixes. */
struct KeyGps {
  Eigen::Vector3d p_map_antenna_m;
  Eigen::Matrix3d cov_map_m2;
  Eigen::Vector3d p_body_antenna_m;
};

/** Attitude at a key pose as a receiver's INS had it. */
struct KeyAttitude {
  Eigen::Matrix3d R_map_body;
  Eigen::Matrix3d covariance_rad2;  ///< right increment
};

/** One key pose: where the LiDAR odometry put it, and what else was known about it then. */
struct Keyframe {
  double stamp_s;
  Pose T_odom_body;
  BodyMotion since_last;  ///< from the key pose before, with its covariance; zero duration at the first
  std::optional<KeyGps> gps;
  std::optional<KeyAttitude> attitude;
};

}  // namespace raceloc
