/** \file
 * What a log holds, one value per message: everything after the reader speaks these and never MRPT. */
#pragma once

#include <optional>
#include <string>
#include <variant>
#include <vector>

#include "core/types.h"

namespace raceloc {

/** Speed and course over ground, as NMEA RMC has them. */
struct GroundVelocity {
  double speed_mps;
  double course_rad;  ///< direction of travel, 0 = east, counter-clockwise
};

/** One GNSS fix, already in the map frame. Built whole: no field has a default that could be believed. */
struct GpsFix {
  double stamp_s;                    ///< receiver time [s since the epoch, UTC]
  std::string label;                 ///< of the receiver, e.g. `gps_left`
  Eigen::Vector3d p_map_antenna_m;   ///< antenna position
  Eigen::Matrix3d cov_map_m2;        ///< its covariance, symmetric positive definite
  Eigen::Vector3d p_body_antenna_m;  ///< lever arm
  int fix_quality;  ///< as in NMEA GGA: 1 single, 2 DGPS, 4 RTK fixed, 5 RTK float, 6 dead reckoning
  std::optional<GroundVelocity> velocity = std::nullopt;  ///< of the antenna; when the receiver has it
};

/** Attitude and position as a receiver's own INS reports them. */
struct InsPose {
  double stamp_s;
  std::string label;  ///< the receiver's label, without the suffix `_pose`
  Pose T_map_body;
  Matrix6d covariance;  ///< right increment: rotation [rad], then translation [m]
};

/** Inertial measurement, turned into the body's axes (not moved to its origin). */
struct ImuSample {
  double stamp_s;
  std::string label;
  Eigen::Vector3d gyro_body_rps;
  Eigen::Vector3d specific_force_body_mps2;  ///< about +9.81 on z at rest
  Eigen::Vector3d p_body_imu_m;
};

/** Speed and turn of the car, from its own electronics. */
struct MotionSample {
  double stamp_s;
  std::string label;
  double speed_mps;                                   ///< forward, of the rear axle
  double yaw_rate_rps;                                ///< counter-clockwise
  std::optional<double> steering_rad = std::nullopt;  ///< road wheels, left positive; when the log has it
};

/** One sweep of one LiDAR, in the sensor's own frame. */
struct Scan {
  double stamp_s;     ///< start of the sweep
  std::string label;  ///< of the device, e.g. `lidar_front`
  Pose T_body_lidar;
  Cloud cloud;                ///< lidar frame
  std::vector<float> time_s;  ///< of each point, since stamp_s; empty when the log has none
  std::vector<float> ring;    ///< laser number of each point; empty when the log has none
};

using Sample = std::variant<GpsFix, InsPose, ImuSample, MotionSample, Scan>;

[[nodiscard]] inline double stampOf(const Sample& sample) {
  return std::visit([](const auto& s) { return s.stamp_s; }, sample);
}
[[nodiscard]] inline const std::string& labelOf(const Sample& sample) {
  return std::visit([](const auto& s) -> const std::string& { return s.label; }, sample);
}

}  // namespace raceloc
