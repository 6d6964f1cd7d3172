/** \file
 * The sensors of a car, as a car file describes them: one section a device, whose name is its label. */
#pragma once

#include <string>
#include <utility>
#include <vector>

#include "core/types.h"
#include "sim/car_options.h"
#include "sim/device_name.h"

namespace raceloc {

/** What all devices have. */
struct MountedDeviceOptions {
  double rate_hz = 10;
  double phase_s = 0;
  double latency_s = 0.01;
  double clock_offset_s = 0;
  double x_m = 0, y_m = 0, z_m = 0;
  [[nodiscard]] Eigen::Vector3d p_body_m() const { return {x_m, y_m, z_m}; }
  /** Adds the keys that all devices have. */
  void describeDevice(OptionList& keys);
};

/** Section [lidar_*]. */
struct LidarOptions : MountedDeviceOptions {
  double roll_deg = 0, pitch_deg = 0, yaw_deg = 0;
  int beams = 64, columns = 600;
  double elevation_min_deg = -15, elevation_max_deg = 15;
  double azimuth_min_deg = -60, azimuth_max_deg = 60;
  bool clockwise = false;
  double min_range_m = 1, max_range_m = 200;
  double range_at_10_percent_m = 120;
  double range_sigma_m = 0.02, range_bias_m = 0;
  double dropout_share = 0.005;
  double intensity_sigma = 0.02;
  void describe(OptionList& keys);
  [[nodiscard]] Pose T_body_lidar() const;
};

/** Which heading a receiver gives beside its position. */
enum class Heading { none, course, body };

/** Section [gps_*]. */
struct GpsOptions : MountedDeviceOptions {
  double horizontal_sigma_m = 0.01, vertical_sigma_m = 0.02;
  double drift_sigma_m = 0.015, drift_time_s = 60;
  double covariance_factor = 1;
  int fix_quality = 4;
  Heading heading = Heading::body;
  double velocity_sigma_mps = 0.03;
  double heading_sigma_deg = 0.1, attitude_sigma_deg = 0.1;
  void describe(OptionList& keys);
};

/** Section [imu*]. */
struct ImuOptions : MountedDeviceOptions {
  double gyro_sigma_dps = 0.1, gyro_bias_sigma_dps = 0.05, gyro_limit_dps = 300;
  double force_sigma_mps2 = 0.1, force_bias_sigma_mps2 = 0.05, force_limit_mps2 = 80;
  void describe(OptionList& keys);
};

/** Section [vehicle*]. */
struct VehicleOptions : MountedDeviceOptions {
  double speed_sigma_mps = 0.05, speed_scale_sigma = 0.003;
  double yaw_rate_sigma_dps = 0.2, yaw_rate_bias_sigma_dps = 0.1;
  double steering_sigma_deg = 0.05, steering_offset_sigma_deg = 0.1;
  void describe(OptionList& keys);
};

/** A car file. */
struct CarFile {
  std::string path;
  CarOptions car;
  DriverOptions driver;
  template <class Options>
  using Devices = std::vector<std::pair<std::string, Options>>;  ///< by label
  Devices<LidarOptions> lidars;
  Devices<GpsOptions> gps;
  Devices<ImuOptions> imus;
  Devices<VehicleOptions> vehicles;
  [[nodiscard]] std::vector<DeviceName> devices() const;  ///< all of them
  /** Those whose labels match one of the patterns, separated by blanks or commas. \throws InputError for a pattern
   * that no device matches: a slip of the keys would leave one out in silence. */
  [[nodiscard]] std::vector<DeviceName> devices(const std::string& patterns) const;
};

/** \throws InputError naming file, section, key and value; also for a file without any device. */
[[nodiscard]] CarFile readCarFile(const std::string& path);

}  // namespace raceloc
