#include "sensors/csv_log.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <random>

#include "core/errors.h"
#include "sensors/gps_conversion.h"
#include "sensors/text_input.h"

namespace raceloc {

void CsvFile::describe(OptionList& keys) {
  keys.add("file", file, "CSV file with a line of column names first; empty: none");
  keys.add("label", label, "of the device in the rawlog");
  keys.add("delimiter", delimiter, "between cells: one character, tab or blank");
  keys.add("stamp", stamp, "column of the time");
  keys.add("stamp_format", stamp_format,
           {{"s", StampFormat::seconds},
            {"ms", StampFormat::milliseconds},
            {"us", StampFormat::microseconds},
            {"ns", StampFormat::nanoseconds},
            {"iso8601", StampFormat::iso8601}},
           "since the epoch in UTC, or 2025-09-05T00:27:38.589Z");
}

void CsvGps::describe(OptionList& keys) {
  CsvFile::describe(keys);
  keys.add("latitude", latitude, "column [deg]");
  keys.add("longitude", longitude, "column [deg]");
  keys.add("height", height, "column of the height above the ellipsoid [m]; empty: height_m");
  keys.add("height_m", height_m, between(-1000, 10000), "height where there is no column [m]");
  keys.add("sigma", sigma, "column of the horizontal standard deviation [m]; empty: sigma_m");
  keys.add("sigma_m", sigma_m, above(0), "standard deviation where there is no column [m]");
  keys.add("vertical_ratio", vertical_ratio, above(0), "vertical over horizontal standard deviation");
  keys.add("fix_quality", fix_quality, between(1, 8),
           "as in NMEA GGA: 1 single, 2 DGPS, 4 RTK fixed, 5 RTK float");
  keys.add("antenna_x_m", antenna_x_m, between(-20, 20), "antenna in the body, forward [m]");
  keys.add("antenna_y_m", antenna_y_m, between(-20, 20), "left [m]");
  keys.add("antenna_z_m", antenna_z_m, between(-20, 20), "up [m]");
}

void CsvImu::describe(OptionList& keys) {
  CsvFile::describe(keys);
  keys.add("gyro_x", gyro_x, "column, about the body's x (forward)");
  keys.add("gyro_y", gyro_y, "column, about y (left)");
  keys.add("gyro_z", gyro_z, "column, about z (up)");
  keys.add("gyro_scale", gyro_scale, between(-1e6, 1e6), "times a cell gives rad/s");
  keys.add("accel_x", accel_x, "column of the specific force along x");
  keys.add("accel_y", accel_y, "column, along y");
  keys.add("accel_z", accel_z, "column, along z");
  keys.add("accel_scale", accel_scale, between(-1e6, 1e6), "times a cell gives m/s^2");
  keys.add("imu_x_m", imu_x_m, between(-20, 20), "IMU in the body, forward [m]");
  keys.add("imu_y_m", imu_y_m, between(-20, 20), "left [m]");
  keys.add("imu_z_m", imu_z_m, between(-20, 20), "up [m]");
}

void CsvVehicle::describe(OptionList& keys) {
  CsvFile::describe(keys);
  keys.add("speed", speed, "column");
  keys.add("speed_scale", speed_scale, between(-1e6, 1e6), "times a cell gives m/s");
  keys.add("yaw_rate", yaw_rate, "column; empty: from speed, steering and wheelbase_m");
  keys.add("yaw_rate_scale", yaw_rate_scale, between(-1e6, 1e6), "times a cell gives rad/s, left positive");
  keys.add("steering", steering, "column; may be empty");
  keys.add("steering_scale", steering_scale, between(-1e6, 1e6), "times a cell gives rad, left positive");
  keys.add("steering_ratio", steering_ratio, above(0),
           "steering wheel over road wheels; 1: the column is road wheels");
  keys.add("wheelbase_m", wheelbase_m, atLeast(0), "between the axles [m]; needed without a yaw_rate column");
}

namespace {

/** Rows of a CSV file, read strictly. */
class CsvRows {
 public:
  CsvRows(const CsvFile& file, const std::string& folder)
      : x_path(folder + "/" + file.file), x_delimiter(delimiterOf(file)), x_lines(readLines("csv", x_path)) {
    if (x_lines.empty()) throw InputError("csv " + x_path + ": empty, it needs a line of column names");
    x_columns = split(x_lines[0], x_delimiter);
  }

  [[nodiscard]] const std::string& path() const { return x_path; }

  /** Index of a column; `key` is the one of the ini that names it. */
  [[nodiscard]] std::size_t column(const std::string& key, const std::string& name) const {
    if (name.empty()) throw InputError("csv " + x_path + ": the ini names no column for " + key);
    const auto found = std::find(x_columns.begin(), x_columns.end(), name);
    if (found != x_columns.end()) return static_cast<std::size_t>(found - x_columns.begin());
    const std::string nearest = nearestName(name, x_columns);
    throw InputError(
        "csv " + x_path + ": no column " + name + " for " + key +
        (nearest.empty() ? " (columns: " + listed(x_columns) + ")" : "; did you mean " + nearest + "?"));
  }

  /** Calls `use(where, cells)` with the cells of the given columns in each row that has them all.
   * \return how many rows were dropped for an empty cell */
  template <class Use>
  std::size_t forEach(const std::vector<std::size_t>& wanted, const Use& use) const {
    std::size_t dropped = 0;
    for (std::size_t i = 1; i < x_lines.size(); ++i) {
      if (x_lines[i].empty()) continue;
      const auto cells = split(x_lines[i], x_delimiter);
      const std::string where = "csv " + x_path + ", line " + std::to_string(i + 1);
      if (cells.size() != x_columns.size())
        throw InputError(where + ": " + std::to_string(cells.size()) + " cells, but there are " +
                         std::to_string(x_columns.size()) + " column names");
      std::vector<std::string> row;
      row.reserve(wanted.size());
      for (const std::size_t column : wanted) row.push_back(cells[column]);
      if (std::any_of(row.begin(), row.end(), [](const auto& cell) { return cell.empty(); }))
        ++dropped;
      else
        use(where, row);
    }
    return dropped;
  }

 private:
  static char delimiterOf(const CsvFile& file) {
    if (file.delimiter == "tab") return '\t';
    if (file.delimiter == "blank") return ' ';
    if (file.delimiter.size() == 1) return file.delimiter[0];
    throw InputError("csv " + file.file + ": delimiter " + file.delimiter +
                     " must be one character, tab or blank");
  }

  std::string x_path;
  char x_delimiter;
  std::vector<std::string> x_lines, x_columns;
};

double numberIn(const std::string& where, const std::string& cell) {
  const auto number = parseNumber(cell);
  if (!number) throw InputError(where + ": not a number: " + cell);
  return *number;
}

double stampIn(const std::string& where, const std::string& cell, StampFormat format) {
  if (format == StampFormat::iso8601) {
    const auto time_s = parseCivilTime(cell);
    if (!time_s) throw InputError(where + ": not a time like 2025-09-05T00:27:38.589Z: " + cell);
    return *time_s;
  }
  const double number = numberIn(where, cell);
  switch (format) {
    case StampFormat::milliseconds:
      return number * 1e-3;
    case StampFormat::microseconds:
      return number * 1e-6;
    case StampFormat::nanoseconds:
      return number * 1e-9;
    default:
      return number;
  }
}

/** What the sections are read into. */
struct Gathered {
  std::vector<Sample> samples;
  ImportSummary summary;
  void noteDropped(std::size_t rows, const CsvFile& file) {
    if (rows > 0)
      summary.notes.push_back(std::to_string(rows) + " rows of " + file.file + " not used for " + file.label +
                              ": a cell is empty");
  }
};

void readGps(const CsvGps& gps, const CsvLog& source, Gathered& gathered) {
  const CsvRows rows(gps, source.folder);
  std::vector<std::size_t> columns{rows.column("stamp", gps.stamp), rows.column("latitude", gps.latitude),
                                   rows.column("longitude", gps.longitude)};
  if (!gps.height.empty()) columns.push_back(rows.column("height", gps.height));
  if (!gps.sigma.empty()) columns.push_back(rows.column("sigma", gps.sigma));
  std::mt19937_64 engine(source.gps_noise.seed);
  std::normal_distribution<double> noise(0, 1);
  auto& origin = gathered.summary.origin;
  const auto dropped =
      rows.forEach(columns, [&](const std::string& where, const std::vector<std::string>& row) {
        const GeodeticPoint position{numberIn(where, row[1]), numberIn(where, row[2]),
                                     gps.height.empty() ? gps.height_m : numberIn(where, row[3])};
        if (std::abs(position.latitude_deg) > 90 || std::abs(position.longitude_deg) > 180)
          throw InputError(where + ": latitude or longitude is out of range");
        const double sigma_m = gps.sigma.empty() ? gps.sigma_m : numberIn(where, row.back());
        if (!(sigma_m > 0)) throw InputError(where + ": the standard deviation must be > 0: " + row.back());
        if (!origin) origin = position;
        const double east = noise(engine);
        const double north = noise(engine);
        const Eigen::Vector3d sigmas_m = sigma_m * Eigen::Vector3d(1, 1, gps.vertical_ratio);
        gathered.samples.emplace_back(
            GpsFix{stampIn(where, row[0], gps.stamp_format), gps.label,
                   toMap(position, *origin) + source.gps_noise.sigma_m * Eigen::Vector3d(east, north, 0),
                   sigmas_m.cwiseAbs2().asDiagonal(),
                   Eigen::Vector3d(gps.antenna_x_m, gps.antenna_y_m, gps.antenna_z_m), gps.fix_quality});
      });
  gathered.noteDropped(dropped, gps);
}

void readImu(const CsvImu& imu, const CsvLog& source, Gathered& gathered) {
  const CsvRows rows(imu, source.folder);
  const std::vector<std::size_t> columns{
      rows.column("stamp", imu.stamp),     rows.column("gyro_x", imu.gyro_x),
      rows.column("gyro_y", imu.gyro_y),   rows.column("gyro_z", imu.gyro_z),
      rows.column("accel_x", imu.accel_x), rows.column("accel_y", imu.accel_y),
      rows.column("accel_z", imu.accel_z)};
  const auto dropped =
      rows.forEach(columns, [&](const std::string& where, const std::vector<std::string>& row) {
        const auto vector = [&](std::size_t i) {
          return Eigen::Vector3d(numberIn(where, row[i]), numberIn(where, row[i + 1]),
                                 numberIn(where, row[i + 2]));
        };
        gathered.samples.emplace_back(ImuSample{stampIn(where, row[0], imu.stamp_format), imu.label,
                                                imu.gyro_scale * vector(1), imu.accel_scale * vector(4),
                                                Eigen::Vector3d(imu.imu_x_m, imu.imu_y_m, imu.imu_z_m)});
      });
  gathered.noteDropped(dropped, imu);
}

void readVehicle(const CsvVehicle& vehicle, const CsvLog& source, Gathered& gathered) {
  const CsvRows rows(vehicle, source.folder);
  const bool has_yaw_rate = !vehicle.yaw_rate.empty();
  const bool has_steering = !vehicle.steering.empty();
  if (!has_yaw_rate && !(has_steering && vehicle.wheelbase_m > 0))
    throw InputError("ini " + source.ini_path +
                     ", section [vehicle]: needs yaw_rate, or steering and a wheelbase_m > 0 to compute it");
  std::vector<std::size_t> columns{rows.column("stamp", vehicle.stamp), rows.column("speed", vehicle.speed)};
  if (has_yaw_rate) columns.push_back(rows.column("yaw_rate", vehicle.yaw_rate));
  if (has_steering) columns.push_back(rows.column("steering", vehicle.steering));
  const auto dropped =
      rows.forEach(columns, [&](const std::string& where, const std::vector<std::string>& row) {
        MotionSample motion{stampIn(where, row[0], vehicle.stamp_format), vehicle.label,
                            vehicle.speed_scale * numberIn(where, row[1]), 0};
        if (has_steering)
          motion.steering_rad = vehicle.steering_scale / vehicle.steering_ratio * numberIn(where, row.back());
        motion.yaw_rate_rps = has_yaw_rate
                                  ? vehicle.yaw_rate_scale * numberIn(where, row[2])
                                  : motion.speed_mps * std::tan(*motion.steering_rad) / vehicle.wheelbase_m;
        gathered.samples.emplace_back(motion);
      });
  gathered.noteDropped(dropped, vehicle);
  if (!has_yaw_rate)
    gathered.summary.notes.push_back("yaw rate of " + vehicle.label +
                                     " computed from speed, steering and wheelbase");
}

}  // namespace

ImportSummary importLog(const CsvLog& source, const std::string& log_path, const ShareDone& done) {
  CsvGps gps;
  CsvImu imu;
  CsvVehicle vehicle;
  IniFile ini(source.ini_path);
  ini.load("gps", gps);
  ini.load("imu", imu);
  ini.load("vehicle", vehicle);
  ini.rejectUnknownSections();

  Gathered gathered;
  if (!gps.file.empty()) readGps(gps, source, gathered);
  if (!imu.file.empty()) readImu(imu, source, gathered);
  if (!vehicle.file.empty()) readVehicle(vehicle, source, gathered);
  if (gathered.samples.empty())
    throw InputError("ini " + source.ini_path +
                     ": nothing to import; give [gps], [imu] or [vehicle] a file with rows");
  std::stable_sort(gathered.samples.begin(), gathered.samples.end(),
                   [](const Sample& a, const Sample& b) { return stampOf(a) < stampOf(b); });

  ImportLog log(log_path, {gathered.summary.origin, "// imported from CSV\n"});
  for (std::size_t i = 0; i < gathered.samples.size(); ++i) {
    log.write(gathered.samples[i]);
    done(static_cast<double>(i + 1) / static_cast<double>(gathered.samples.size()));
  }
  gathered.summary.devices = log.commit();
  return gathered.summary;
}

}  // namespace raceloc
