/** \file
 * CSV logs of GPS, IMU and vehicle, by a column map in an ini file. */
#pragma once

#include <string>

#include "core/options.h"
#include "sensors/foreign_logs.h"

namespace raceloc {

/** How the stamps of a CSV file are written. */
enum class StampFormat { seconds, milliseconds, microseconds, nanoseconds, iso8601 };

/** What the three sections share. A section without `file` is not used. */
struct CsvFile {
  std::string file;  ///< relative to the folder of the import
  std::string label;
  std::string delimiter = ",";  ///< one character, or `tab`, or `blank`
  std::string stamp;            ///< column
  StampFormat stamp_format = StampFormat::seconds;
  void describe(OptionList& keys);
};

/** Section [gps]. */
struct CsvGps : CsvFile {
  CsvGps() { label = "gps"; }
  std::string latitude, longitude;  ///< columns [deg]
  std::string height;               ///< column [m above the ellipsoid]; empty: height_m
  double height_m = 0;
  std::string sigma;  ///< column [m]; empty: sigma_m
  double sigma_m = 2.5, vertical_ratio = 1.5;
  int fix_quality = 1;
  double antenna_x_m = 0, antenna_y_m = 0, antenna_z_m = 0;
  void describe(OptionList& keys);
};

/** Section [imu]. Columns are along the body's axes. */
struct CsvImu : CsvFile {
  CsvImu() { label = "imu"; }
  std::string gyro_x, gyro_y, gyro_z, accel_x, accel_y, accel_z;
  double gyro_scale = 1;   ///< to rad/s
  double accel_scale = 1;  ///< to m/s^2
  double imu_x_m = 0, imu_y_m = 0, imu_z_m = 0;
  void describe(OptionList& keys);
};

/** Section [vehicle]. Without a column for the yaw rate it comes from the single-track model without
 * sideslip, speed * tan(steering) / wheelbase. */
struct CsvVehicle : CsvFile {
  CsvVehicle() { label = "vehicle"; }
  std::string speed, yaw_rate, steering;  ///< columns; the last two may be empty
  double speed_scale = 1;                 ///< to m/s
  double yaw_rate_scale = 1;              ///< to rad/s, counter-clockwise positive
  double steering_scale = 1;              ///< to rad, left positive
  double steering_ratio = 1;              ///< steering wheel over road wheels
  double wheelbase_m = 0;                 ///< needed without a column for the yaw rate
  void describe(OptionList& keys);
};

struct CsvLog {
  std::string ini_path;
  std::string folder = ".";  ///< of the CSV files
  GpsNoise gps_noise;
};

/** Map origin: the first fix. Rows with an empty cell in a needed column are dropped and counted.
 * \throws InputError naming the file and line for a cell that is no number or time, a row with too few or too
 * many cells, a missing column (with the nearest name), or an ini whose sections use no file. */
[[nodiscard]] ImportSummary importLog(const CsvLog& source, const std::string& log_path,
                                      const ShareDone& done);

}  // namespace raceloc
