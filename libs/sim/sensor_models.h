/** \file
 * Sensors that measure the true motion, with their noise. Each takes the time of a measurement since the start and its
 * number; the same number of the same device with the same seed has the same noise. Stamps are
 * kStartStamp_s + time + the device's clock offset. */
#pragma once

#include <optional>

#include "core/samples.h"
#include "sim/sensor_options.h"
#include "sim/traffic.h"
#include "sim/true_motion.h"
#include "sim/world.h"

namespace raceloc {

/** 2023-11-14 22:13:20 UTC: every simulated race starts then, so that the same seed gives the same bytes. */
constexpr double kStartStamp_s = 1'700'000'000;

/** A LiDAR that sweeps: each column is cast from the pose that the car has when it fires. */
class LidarModel {
 public:
  LidarModel(const LidarOptions& options, std::string label, std::uint64_t seed);
  /** The sweep that begins at `begin_s` and lasts 1 / rate_hz; motion must be known to its end. Columns are
   * cast in parallel (TBB); the result does not depend on the number of threads. */
  [[nodiscard]] Scan sweep(const TrueMotion& motion, const World& world, const Traffic& traffic,
                           double begin_s, std::uint64_t number) const;

 private:
  LidarOptions x_options;
  std::string x_label;
  Noise x_range_noise, x_intensity_noise, x_loss;
  std::vector<Eigen::Vector3d> x_directions;  ///< lidar frame, column by column
};

/** A receiver: position of its antenna, velocity over ground, and with heading = body an INS pose of the
 * car. White noise, and a slow error that fix and pose share. */
class GpsModel {
 public:
  GpsModel(const GpsOptions& options, std::string label, std::uint64_t seed);
  struct Output {
    GpsFix fix;
    std::optional<InsPose> pose;
  };
  /** Numbers must be taken in order: the slow error walks. */
  [[nodiscard]] Output measure(const TrueMotion& motion, double time_s, std::uint64_t number);

 private:
  GpsOptions x_options;
  std::string x_label;
  Noise x_noise;
  Eigen::Vector3d x_drift_m;
};

class ImuModel {
 public:
  ImuModel(const ImuOptions& options, std::string label, std::uint64_t seed);
  [[nodiscard]] ImuSample measure(const TrueMotion& motion, double time_s, std::uint64_t number) const;
  [[nodiscard]] const Eigen::Vector3d& gyroBias_rps() const { return x_gyro_bias_rps; }
  [[nodiscard]] const Eigen::Vector3d& forceBias_mps2() const { return x_force_bias_mps2; }

 private:
  ImuOptions x_options;
  std::string x_label;
  Noise x_noise;
  Eigen::Vector3d x_gyro_bias_rps, x_force_bias_mps2;
};

/** Speed of the driven wheels, yaw rate and steering from the car's own electronics. */
class VehicleModel {
 public:
  VehicleModel(const VehicleOptions& options, std::string label, std::uint64_t seed);
  [[nodiscard]] MotionSample measure(const TrueMotion& motion, double time_s, std::uint64_t number) const;
  [[nodiscard]] double speedScale() const { return x_speed_scale; }
  [[nodiscard]] double yawRateBias_rps() const { return x_yaw_rate_bias_rps; }
  [[nodiscard]] double steeringOffset_rad() const { return x_steering_offset_rad; }

 private:
  VehicleOptions x_options;
  std::string x_label;
  Noise x_noise;
  double x_speed_scale, x_yaw_rate_bias_rps, x_steering_offset_rad;
};

}  // namespace raceloc
