/** \file
 * Faults as a user writes them: one section [fault_*] each, of a fault ini or of the comment block of a log.
 * \code
 * [fault_01]
 * kind = gps_step
 * labels = gps_left
 * from_s = 20
 * to_s = 40
 * east_m = 5
 * \endcode */
#pragma once

#include <limits>
#include <string>
#include <vector>

#include "core/options.h"
#include "sim/device_name.h"

namespace raceloc {

enum class FaultKind {
  gps_noise,
  gps_step,
  gps_ramp,
  gps_vibration,
  gps_outage,
  gps_frozen,
  gps_covariance,
  gps_rtk_flapping,
  gps_heading_flip,
  message_late,
  message_duplicated,
  message_shuffled,
  stamp_jump,
  lidar_off,
  lidar_thinned,
  lidar_spray,
  lidar_sector_blocked,
  lidar_times_scaled,
  lidar_times_reversed,
  lidar_times_absent,
  lidar_nan,
  lidar_ground_only,
  imu_bias_step,
  imu_frozen,
  imu_saturated,
  wheel_lock,
  wheel_spin,
  vehicle_frozen,
  steering_offset
};

/** Every kind, as declared. */
[[nodiscard]] const std::vector<FaultKind>& faultKinds();
/** As in an ini: the enumerator's name. */
[[nodiscard]] std::string nameOf(FaultKind kind);

/** One fault: what it does, to which devices, when. The parameters of other kinds are there but not read. */
struct Fault {
  std::string section = "fault_01";  ///< its name in the ini; also the name of its random numbers
  FaultKind kind = FaultKind::gps_noise;
  std::string labels = "*";  ///< shell patterns (core/labels.h); of a GPS, its INS poses are meant too
  double from_s = 0;         ///< stamps since the start of the log [s], this one included ...
  double to_s = 0;           ///< ... up to this one, excluded; 0: to the end of the log

  double sigma_m = 5;                    ///< gps_noise
  bool shared = false;                   ///< gps_noise
  double east_m = 5;                     ///< gps_step
  double north_m = 0;                    ///< gps_step
  double up_m = 0;                       ///< gps_step
  double rate_mps = 0.5;                 ///< gps_ramp
  double direction_deg = 0;              ///< gps_ramp
  double gain_m_per_mps2 = 0.1;          ///< gps_vibration
  double time_constant_s = 0.5;          ///< gps_vibration
  double claimed_sigma_m = 0.01;         ///< gps_covariance
  double period_s = 2;                   ///< gps_rtk_flapping
  double float_sigma_m = 0.5;            ///< gps_rtk_flapping
  double delay_s = 0.3;                  ///< message_late
  double again_after_s = 0;              ///< message_duplicated
  double window_s = 0.2;                 ///< message_shuffled
  double jump_s = 0.5;                   ///< stamp_jump
  double lost_share = 0.5;               ///< lidar_thinned
  double spray_share = 0.1;              ///< lidar_spray
  double min_m = 1;                      ///< lidar_spray
  double max_m = 30;                     ///< lidar_spray
  double sector_from_deg = -30;          ///< lidar_sector_blocked
  double sector_to_deg = 30;             ///< lidar_sector_blocked
  double time_factor = 0;                ///< lidar_times_scaled
  double nan_share = 0.1;                ///< lidar_nan
  double height_m = 0;                   ///< lidar_ground_only
  double gyro_x_dps = 0;                 ///< imu_bias_step
  double gyro_y_dps = 0;                 ///< imu_bias_step
  double gyro_z_dps = 1;                 ///< imu_bias_step
  double accelerometer_x_mps2 = 0;       ///< imu_bias_step
  double accelerometer_y_mps2 = 0;       ///< imu_bias_step
  double accelerometer_z_mps2 = 0;       ///< imu_bias_step
  double gyro_limit_dps = 10;            ///< imu_saturated
  double accelerometer_limit_mps2 = 12;  ///< imu_saturated
  double spin_factor = 1.2;              ///< wheel_spin
  double offset_deg = 2;                 ///< steering_offset

  /** The keys of all kinds and those of its own; so `kind` must be right before the section is loaded. */
  void describe(OptionList& keys);

  /** Where `to_s` ends it [s]. */
  [[nodiscard]] double end_s() const { return to_s > 0 ? to_s : std::numeric_limits<double>::infinity(); }
};

/** All faults of an ini, in order of the names of their sections.
 * \throws InputError naming file, section, key and value: a kind that there is not (with the nearest that
 * there is), a key that the kind does not have, a value out of its range, an end that is not after the start,
 * a section that is no fault, or no fault at all. */
[[nodiscard]] std::vector<Fault> readFaults(const std::string& ini_path);

/** For the header of a log: every key with its value and meaning, readable again by readFaults(). */
[[nodiscard]] std::string iniText(const std::vector<Fault>& faults);

/** \throws InputError if a fault has a label or pattern that fits none of the `devices` that its kind can be for
 * (`message_*` and `stamp_jump`: all of them), naming file, section, the pattern and the labels to choose from. */
void requireDevices(const std::vector<Fault>& faults, const std::string& ini_path,
                    const std::vector<DeviceName>& devices);

}  // namespace raceloc
