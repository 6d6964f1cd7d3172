#include "sim/sensor_options.h"

#include <algorithm>
#include <iterator>

#include "core/labels.h"

namespace raceloc {

void MountedDeviceOptions::describeDevice(OptionList& keys) {
  keys.add("rate_hz", rate_hz, between(0.1, 1000), "messages a second [Hz]");
  keys.add("phase_s", phase_s, between(0, 10), "of the first message, after the start [s]");
  keys.add("latency_s", latency_s, between(0, 1), "from the end of the measurement to the log [s]");
  keys.add("clock_offset_s", clock_offset_s, between(-10, 10),
           "of the device's stamps against the true time [s]");
  keys.add("x_m", x_m, between(-10, 10), "ahead of the rear axle [m]");
  keys.add("y_m", y_m, between(-10, 10), "left of the car's middle [m]");
  keys.add("z_m", z_m, between(-10, 10), "above the rear axle [m]");
}

void LidarOptions::describe(OptionList& keys) {
  describeDevice(keys);
  keys.add("roll_deg", roll_deg, between(-180, 180), "mounting, about x [deg]");
  keys.add("pitch_deg", pitch_deg, between(-180, 180), "mounting, about y, nose down is positive [deg]");
  keys.add("yaw_deg", yaw_deg, between(-180, 180), "mounting, about z, to the left is positive [deg]");
  keys.add("beams", beams, between(1, 256), "lasers, one above the other");
  keys.add("columns", columns, between(1, 8192), "firings of all lasers in a sweep");
  keys.add("elevation_min_deg", elevation_min_deg, between(-90, 90), "of the lowest laser [deg]");
  keys.add("elevation_max_deg", elevation_max_deg, between(-90, 90), "of the highest laser [deg]");
  keys.add("azimuth_min_deg", azimuth_min_deg, between(-360, 360), "field of view, right end [deg]");
  keys.add("azimuth_max_deg", azimuth_max_deg, between(-360, 360), "field of view, left end [deg]");
  keys.add("clockwise", clockwise, "sweeps from left to right, seen from above");
  keys.add("min_range_m", min_range_m, between(0.1, 100), "nearer returns are lost [m]");
  keys.add("max_range_m", max_range_m, between(1, 1000), "farther ones too [m]");
  keys.add("range_at_10_percent_m", range_at_10_percent_m, between(1, 1000),
           "a surface of 10 % reflectivity is always seen up to here; beyond, the chance falls with its "
           "square [m]");
  keys.add("range_sigma_m", range_sigma_m, between(0, 5), "white noise of a range [m]");
  keys.add("range_bias_m", range_bias_m, between(-5, 5), "constant error of all ranges [m]");
  keys.add("dropout_share", dropout_share, between(0, 1), "returns that are lost for no reason");
  keys.add("intensity_sigma", intensity_sigma, between(0, 1), "white noise of the intensity, which is 0..1");
}

Pose LidarOptions::T_body_lidar() const {
  return poseFromRpy(p_body_m(), kDegree * roll_deg, kDegree * pitch_deg, kDegree * yaw_deg);
}

void GpsOptions::describe(OptionList& keys) {
  describeDevice(keys);
  keys.add("horizontal_sigma_m", horizontal_sigma_m, between(0, 100), "white noise of a fix, each axis [m]");
  keys.add("vertical_sigma_m", vertical_sigma_m, between(0, 100), "white noise of its height [m]");
  keys.add("drift_sigma_m", drift_sigma_m, between(0, 100), "slow error, each axis [m]");
  keys.add("drift_time_s", drift_time_s, between(0.1, 1e5), "that stays the same for about this long [s]");
  keys.add("covariance_factor", covariance_factor, between(0, 1e4), "claimed variance over the true one");
  keys.add("fix_quality", fix_quality, between(1, 6),
           "as in GGA: 1 single, 2 DGPS, 4 RTK fixed, 5 RTK float");
  keys.add<Heading>("heading", heading,
                    {{"none", Heading::none}, {"course", Heading::course}, {"body", Heading::body}},
                    "course: over ground, of the antenna; body: also an INS pose with the car's attitude");
  keys.add("velocity_sigma_mps", velocity_sigma_mps, between(0, 10),
           "white noise of the velocity, each axis [m/s]");
  keys.add("heading_sigma_deg", heading_sigma_deg, between(0, 180), "white noise of the INS heading [deg]");
  keys.add("attitude_sigma_deg", attitude_sigma_deg, between(0, 90),
           "white noise of INS roll and pitch [deg]");
}

void ImuOptions::describe(OptionList& keys) {
  describeDevice(keys);
  keys.add("gyro_sigma_dps", gyro_sigma_dps, between(0, 100), "white noise of a sample, each axis [deg/s]");
  keys.add("gyro_bias_sigma_dps", gyro_bias_sigma_dps, between(0, 100),
           "its bias, drawn once from the seed [deg/s]");
  keys.add("gyro_limit_dps", gyro_limit_dps, between(1, 1e5), "saturates beyond [deg/s]");
  keys.add("force_sigma_mps2", force_sigma_mps2, between(0, 100),
           "accelerometer: white noise of a sample, each axis [m/s^2]");
  keys.add("force_bias_sigma_mps2", force_bias_sigma_mps2, between(0, 100),
           "its bias, drawn once from the seed [m/s^2]");
  keys.add("force_limit_mps2", force_limit_mps2, between(1, 1e5), "saturates beyond [m/s^2]");
}

void VehicleOptions::describe(OptionList& keys) {
  describeDevice(keys);
  keys.add("speed_sigma_mps", speed_sigma_mps, between(0, 10), "white noise of the wheel speed [m/s]");
  keys.add("speed_scale_sigma", speed_scale_sigma, between(0, 0.5),
           "error of the wheels' circumference, drawn once from the seed, as a share");
  keys.add("yaw_rate_sigma_dps", yaw_rate_sigma_dps, between(0, 100),
           "white noise of the car's own yaw rate [deg/s]");
  keys.add("yaw_rate_bias_sigma_dps", yaw_rate_bias_sigma_dps, between(0, 100),
           "its bias, drawn once from the seed [deg/s]");
  keys.add("steering_sigma_deg", steering_sigma_deg, between(0, 45),
           "white noise of the steering, at the road wheels [deg]");
  keys.add("steering_offset_sigma_deg", steering_offset_sigma_deg, between(0, 45),
           "its offset, drawn once from the seed [deg]");
}

std::vector<DeviceName> CarFile::devices() const {
  std::vector<DeviceName> names;
  const auto list = [&](const auto& devices, const char* kind) {
    for (const auto& device : devices) names.push_back({device.first, kind});
  };
  list(lidars, "lidar");
  list(gps, "gps");
  list(imus, "imu");
  list(vehicles, "vehicle");
  return names;
}

std::vector<DeviceName> CarFile::devices(const std::string& patterns) const {
  const auto all = devices();
  std::vector<std::string> labels;
  labels.reserve(all.size());
  for (const auto& device : all) labels.push_back(device.label);
  if (const auto unmatched = unmatchedPatterns(patterns, labels); !unmatched.empty())
    throw InputError("car " + path + ": no device labelled " + unmatched.front() +
                     " (it has: " + listed(labels) + ")");
  std::vector<DeviceName> chosen;
  std::copy_if(all.begin(), all.end(), std::back_inserter(chosen),
               [&](const auto& device) { return matchesLabel(patterns, device.label); });
  if (chosen.empty())
    throw InputError("car " + path + ": no device is chosen (it has: " + listed(labels) + ")");
  return chosen;
}

CarFile readCarFile(const std::string& path) {
  IniFile ini(path);
  CarFile file;
  file.path = path;
  ini.load("car", file.car);
  ini.load("driver", file.driver);
  if (!(file.car.front_m < file.car.wheelbase_m))
    throw InputError("ini " + path + ", section [car]: front_m = " + std::to_string(file.car.front_m) +
                     ", but it must be less than wheelbase_m = " + std::to_string(file.car.wheelbase_m));
  const auto read = [&](const std::string& prefix, auto& devices) {
    for (const auto& section : ini.sections(prefix)) {
      auto& device = devices.emplace_back();
      device.first = section;
      ini.load(section, device.second);
    }
  };
  read("lidar_", file.lidars);
  read("gps_", file.gps);
  read("imu", file.imus);
  read("vehicle", file.vehicles);
  ini.rejectUnknownSections();
  for (const auto& [label, lidar] : file.lidars) {
    const auto section = "ini " + path + ", section [" + label + "]: ";
    if (lidar.elevation_min_deg > lidar.elevation_max_deg)
      throw InputError(section + "elevation_min_deg = " + std::to_string(lidar.elevation_min_deg) +
                       ", but it must be <= elevation_max_deg");
    if (!(lidar.azimuth_min_deg < lidar.azimuth_max_deg &&
          lidar.azimuth_max_deg - lidar.azimuth_min_deg <= 360))
      throw InputError(section + "azimuth_min_deg = " + std::to_string(lidar.azimuth_min_deg) +
                       ", but it must be less than azimuth_max_deg, by 360 at most");
    if (!(lidar.min_range_m < lidar.max_range_m))
      throw InputError(section + "min_range_m = " + std::to_string(lidar.min_range_m) +
                       ", but it must be less than max_range_m");
  }
  if (file.lidars.empty() && file.gps.empty() && file.imus.empty() && file.vehicles.empty())
    throw InputError("ini " + path +
                     ": no device; a device is a section [lidar_*], [gps_*], [imu] or [vehicle]");
  return file;
}

}  // namespace raceloc
