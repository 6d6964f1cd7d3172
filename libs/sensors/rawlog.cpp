#include "sensors/rawlog.h"

#include <mrpt/io/CFileGZOutputStream.h>
#include <mrpt/obs/CObservationComment.h>
#include <mrpt/obs/CObservationGPS.h>
#include <mrpt/obs/CObservationIMU.h>
#include <mrpt/obs/CObservationOdometry.h>
#include <mrpt/obs/CObservationPointCloud.h>
#include <mrpt/obs/CObservationRawDAQ.h>
#include <mrpt/obs/CObservationRobotPose.h>
#include <mrpt/serialization/CArchive.h>
#include <mrpt/system/datetime.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <iomanip>
#include <limits>
#include <map>
#include <sstream>
#include <stdexcept>
#include <utility>

#include "core/labels.h"
#include "sensors/gps_conversion.h"
#include "sensors/gzip_length.h"
#include "sensors/lidar_conversion.h"
#include "sensors/mrpt_stamp.h"
#include "sensors/pose_conversion.h"
#include "sensors/rawlog_objects.h"
#include "sensors/sample_conversion.h"

namespace raceloc {

namespace {

using mrpt::obs::CObservation;
using mrpt::obs::CObservationComment;
using mrpt::obs::CObservationGPS;
using mrpt::obs::CObservationIMU;
using mrpt::obs::CObservationRawDAQ;
using mrpt::obs::CObservationRobotPose;
using mrpt::obs::gnss::Message_NMEA_GGA;
using mrpt::obs::gnss::Message_NMEA_RMC;
using mrpt::obs::gnss::Message_NV_OEM6_BESTPOS;

// ---- GPS

mrpt::obs::gnss::nv_oem6_position_type::nv_position_type_t novatelType(int fix_quality) {
  using namespace mrpt::obs::gnss::nv_oem6_position_type;
  switch (fix_quality) {
    case 2:
      return PSRDIFF;
    case 4:
      return NARROW_INT;
    case 5:
      return NARROW_FLOAT;
    case 6:
      return PROPAGATED;
    default:
      return SINGLE;
  }
}

/** Of NMEA RMC. */
char modeOf(int fix_quality) {
  if (fix_quality == 6) return 'E';
  return fix_quality == 2 || fix_quality == 4 || fix_quality == 5 ? 'D' : 'A';
}

mrpt::obs::gnss::UTC_time timeOfDay(const mrpt::system::TTimeParts& utc) {
  mrpt::obs::gnss::UTC_time time;
  time.hour = utc.hour;
  time.minute = utc.minute;
  time.sec = utc.second;
  return time;
}

std::string nameOf(const std::string& kind) {
  if (kind == "lidar") return "LiDAR";
  if (kind == "gps") return "GPS";
  if (kind == "ins_pose") return "INS pose";
  if (kind == "imu") return "IMU";
  return kind;
}

std::vector<std::string> labelsIn(const LogSummary& summary, const std::string& kind) {
  std::vector<std::string> labels;
  for (const auto& device : summary.devices)
    if (device.kind == kind) labels.push_back(device.label);
  return labels;
}

}  // namespace

void LogOptions::describe(OptionList& keys) {
  keys.add("lidar_labels", lidar_labels,
           "LiDARs to use, several merged: shell patterns, separated by blanks; one that is named in full is "
           "missed when it never delivers");
  keys.add("gps_labels", gps_labels, "GPS receivers to use, with their INS poses");
  keys.add("imu_labels", imu_labels, "IMUs to use");
  keys.add("vehicle_labels", vehicle_labels, "sources of speed, yaw rate and steering to use");
  keys.add("reorder_window_s", reorder_window_s, between(0, 60),
           "samples up to this late are put in order [s]");
}

LogSummary summarizeRawlog(const std::string& path, const std::function<void(double)>& progress) {
  RawlogObjects objects(path);
  LogSummary summary{
      path, {}, {}, std::numeric_limits<double>::infinity(), -std::numeric_limits<double>::infinity(),
      {},   {}};
  std::optional<GeodeticPoint> first_fix;
  DeviceTally tally;
  while (const auto observation = objects.next()) {
    if (progress) progress(objects.progress());
    if (const auto* comment = dynamic_cast<const CObservationComment*>(observation.get())) {
      const LogHeader header = headerIn(*comment);
      if (!summary.origin) summary.origin = header.origin;
      summary.gps_labels = gpsLabelsIn(header);
      continue;
    }
    if (const auto position = positionIn(*observation)) {
      if (!first_fix) first_fix = position;
      summary.fixes_earth_m.extend(toEarth(*position));
    }
    const auto [label, kind] = deviceOf(*observation);
    const double stamp_s = fromMrptStamp(observation->timestamp);
    tally.add(label, kind, stamp_s);
    if (observation->timestamp == INVALID_TIMESTAMP) continue;
    summary.first_s = std::min(summary.first_s, stamp_s);
    summary.last_s = std::max(summary.last_s, stamp_s);
  }
  summary.devices = tally.devices();
  if (summary.devices.empty()) throw InputError("rawlog " + path + ": empty, it holds no observation");
  if (!summary.origin) summary.origin = first_fix;
  for (auto& label : labelsIn(summary, "gps")) summary.gps_labels.push_back(std::move(label));
  std::sort(summary.gps_labels.begin(), summary.gps_labels.end());
  summary.gps_labels.erase(std::unique(summary.gps_labels.begin(), summary.gps_labels.end()),
                           summary.gps_labels.end());
  return summary;
}

void requireOneClock(const LogSummary& summary, const LogOptions& options) {
  const std::map<std::string, std::string> patterns{{"lidar", options.lidar_labels},
                                                    {"gps", options.gps_labels},
                                                    {"ins_pose", options.gps_labels},
                                                    {"imu", options.imu_labels},
                                                    {"vehicle", options.vehicle_labels}};
  const auto isUsed = [&](const DeviceSummary& device) {
    const auto pattern = patterns.find(device.kind);
    return pattern != patterns.end() && matchesLabel(pattern->second, device.label);
  };
  double first_s = std::numeric_limits<double>::infinity(), last_s = -first_s;
  for (const auto& device : summary.devices) {
    if (device.kind != "lidar" || !isUsed(device)) continue;
    first_s = std::min(first_s, device.first_s);
    last_s = std::max(last_s, device.last_s);
  }
  constexpr double kApart_s = 60;
  for (const auto& device : summary.devices) {
    const double before_s = first_s - device.last_s, after_s = device.first_s - last_s;
    if (!isUsed(device) || std::max(before_s, after_s) < kApart_s) continue;
    std::ostringstream line;
    line << "rawlog " << summary.path << ": " << nameOf(device.kind) << " " << device.label << " is stamped "
         << std::fixed << std::setprecision(1) << std::max(before_s, after_s) << " s "
         << (before_s > 0 ? "before the first" : "after the last") << " scan: "
         << (weekRollovers(before_s) > 0 ? "the week number of its GPS time has rolled over"
                                         : "its clock is not the LiDAR's")
         << "; mend its stamps, or leave it out by its labels in section "
            "[log]";
    throw InputError(line.str());
  }
}

void requireDevice(const LogSummary& summary, const std::string& kind, const std::string& patterns) {
  const auto labels = labelsIn(summary, kind);
  if (std::any_of(labels.begin(), labels.end(),
                  [&](const auto& label) { return matchesLabel(patterns, label); }))
    return;
  throw InputError("rawlog " + summary.path + ": no " + nameOf(kind) + " observation labelled " + patterns +
                   " (" + nameOf(kind) + " labels in it: " + listed(labels) + ")");
}

void requireDevices(const LogSummary& summary, const LogOptions& options) {
  requireDevice(summary, "lidar", options.lidar_labels);
  if (options.gps_labels != "*") requireDevice(summary, "gps", options.gps_labels);
  if (options.vehicle_labels != "*") requireDevice(summary, "vehicle", options.vehicle_labels);
  if (options.imu_labels != "*" && !options.imu_labels.empty())
    requireDevice(summary, "imu", options.imu_labels);
}

std::vector<std::string> missingDevices(const LogSummary& summary, const LogOptions& options) {
  std::vector<std::string> missing;
  const auto look = [&](const std::string& kind, const std::string& patterns) {
    if (patterns == "*") return;
    const auto labels = labelsIn(summary, kind);
    for (const auto& pattern : unmatchedPatterns(patterns, labels))
      missing.push_back(nameOf(kind) + " " + pattern + ": not in the log, which has " + listed(labels));
  };
  look("lidar", options.lidar_labels);
  look("gps", options.gps_labels);
  look("imu", options.imu_labels);
  look("vehicle", options.vehicle_labels);
  return missing;
}

// ---- Reading

LogReader::LogReader(const std::string& path, const LogOptions& options,
                     std::optional<GeodeticPoint> map_origin, Late late)
    : x_options(options),
      x_file(std::make_unique<RawlogObjects>(path)),
      x_next([file = x_file.get()] { return file->next(); }),
      x_map_origin(map_origin),
      x_order(options.reorder_window_s, late) {}

LogReader::LogReader(NextObservation observations, const LogOptions& options, const GeodeticPoint& map_origin,
                     const LogHeader& header, Late late)
    : x_options(options),
      x_next(std::move(observations)),
      x_map_origin(map_origin),
      x_header_origin(header.origin),
      x_order(options.reorder_window_s, late) {}

LogReader::~LogReader() = default;

double LogReader::progress() const { return x_file ? x_file->progress() : 0; }

std::optional<Sample> LogReader::next() {
  for (;;) {
    if (auto sample = x_order.next()) return sample;
    if (x_at_end) return std::nullopt;
    if (const auto observation = x_next()) {
      take(*observation);
    } else {
      x_at_end = true;
      x_order.end();
    }
  }
}

void LogReader::take(const CObservation& observation) {
  if (const auto* comment = dynamic_cast<const CObservationComment*>(&observation)) {
    if (!x_header_origin) x_header_origin = headerIn(*comment).origin;
    if (!x_map_origin) x_map_origin = x_header_origin;
    return;
  }
  if (!x_map_origin) x_map_origin = positionIn(observation);
  if (const auto* daq = dynamic_cast<const CObservationRawDAQ*>(&observation)) return joinSteering(*daq);
  if (!isWanted(observation)) return;

  auto sample = sampleIn(observation, {x_map_origin, x_header_origin});
  if (!sample) return;
  if (auto* motion = std::get_if<MotionSample>(&*sample))
    if (const auto last = x_steering.find(motion->label);
        last != x_steering.end() && last->second.stamp_s == motion->stamp_s)
      motion->steering_rad = last->second.steering_rad;
  if (isSound(observation, *sample))
    x_order.add(std::move(*sample));
  else
    ++x_unsound;
}

bool LogReader::isWanted(const CObservation& observation) const {
  const auto [label, kind] = deviceOf(observation);
  if (kind == "lidar") return matchesLabel(x_options.lidar_labels, label);
  if (kind == "gps" || kind == "ins_pose") return matchesLabel(x_options.gps_labels, label);
  if (kind == "imu") return matchesLabel(x_options.imu_labels, label);
  return kind == "vehicle" && matchesLabel(x_options.vehicle_labels, label);
}

void LogReader::joinSteering(const CObservationRawDAQ& daq) {
  if (daq.AIN_double.size() != 2 || !matchesLabel(x_options.vehicle_labels, daq.sensorLabel)) return;
  const Steering steering{fromMrptStamp(daq.timestamp), daq.AIN_double[1]};
  x_order.forEachAt(steering.stamp_s, [&](Sample& sample) {
    if (auto* motion = std::get_if<MotionSample>(&sample); motion && motion->label == daq.sensorLabel)
      motion->steering_rad = steering.steering_rad;
  });
  x_steering[daq.sensorLabel] = steering;
}

// ---- Writing

namespace {

/** Fills what all observations share. */
template <class Observation>
Observation observationAt(double stamp_s, const std::string& label) {
  Observation o;
  o.timestamp = toMrptStamp(stamp_s);
  o.sensorLabel = label;
  return o;
}

}  // namespace

LogWriter::LogWriter(const std::string& path, const LogHeader& header, int gzip_level)
    : x_header(header), x_output(path), x_file(std::make_unique<mrpt::io::CFileGZOutputStream>()) {
  if (!x_file->open(x_output.temporaryPath(), gzip_level)) throw cannotWrite(path);
  write(toObservation(header));
}

LogWriter::~LogWriter() = default;

const GeodeticPoint& LogWriter::origin() const {
  if (!x_header.origin) throw std::invalid_argument("LogWriter: GPS and INS need an origin in the header");
  return *x_header.origin;
}

void LogWriter::write(const mrpt::serialization::CSerializable& annotation) {
  try {
    mrpt::serialization::archiveFrom(*x_file) << annotation;
  } catch (const std::exception&) {
    throw cannotWrite(x_output.path());
  }
}

void LogWriter::write(const Sample& sample) {
  std::visit([this](const auto& s) { writeSample(s); }, sample);
}

void LogWriter::writeSample(const GpsFix& fix) {
  const GeodeticPoint here = fromMap(fix.p_map_antenna_m, origin());
  const Pose T_map_here = mapFromMap(origin(), here);
  const Eigen::Matrix3d R_map_here = T_map_here.linear();
  const Eigen::Vector3f sigmas_m =
      (R_map_here.transpose() * fix.cov_map_m2 * R_map_here).diagonal().cwiseSqrt().cast<float>();
  auto o = observationAt<CObservationGPS>(fix.stamp_s, fix.label);
  o.has_satellite_timestamp = true;
  o.originalReceivedTimestamp = o.timestamp;
  o.sensorPose =
      mrpt::poses::CPose3D(fix.p_body_antenna_m.x(), fix.p_body_antenna_m.y(), fix.p_body_antenna_m.z());
  mrpt::system::TTimeParts utc;
  mrpt::system::timestampToParts(o.timestamp, utc);

  Message_NMEA_GGA gga;
  gga.fields.UTCTime = timeOfDay(utc);
  gga.fields.latitude_degrees = here.latitude_deg;
  gga.fields.longitude_degrees = here.longitude_deg;
  gga.fields.altitude_meters = here.height_m;
  gga.fields.geoidal_distance = 0;
  gga.fields.orthometric_altitude = here.height_m;
  gga.fields.corrected_orthometric_altitude = here.height_m;
  gga.fields.fix_quality = static_cast<std::uint8_t>(fix.fix_quality);

  Message_NV_OEM6_BESTPOS best;
  best.fields.position_type = novatelType(fix.fix_quality);
  best.fields.solution_stat = mrpt::obs::gnss::nv_oem6_solution_status::SOL_COMPUTED;
  best.fields.lat = here.latitude_deg;
  best.fields.lon = here.longitude_deg;
  best.fields.hgt = here.height_m;
  best.fields.lon_sigma = sigmas_m.x();
  best.fields.lat_sigma = sigmas_m.y();
  best.fields.hgt_sigma = sigmas_m.z();
  o.setMsg(gga);
  o.setMsg(best);
  if (fix.velocity) {
    Message_NMEA_RMC rmc;
    rmc.fields.UTCTime = gga.fields.UTCTime;
    rmc.fields.date_day = utc.day;
    rmc.fields.date_month = utc.month;
    rmc.fields.date_year = static_cast<std::uint8_t>(utc.year % 100);
    rmc.fields.validity_char = 'A';
    rmc.fields.positioning_mode = modeOf(fix.fix_quality);
    rmc.fields.latitude_degrees = here.latitude_deg;
    rmc.fields.longitude_degrees = here.longitude_deg;
    rmc.fields.speed_knots = fix.velocity->speed_mps / kKnot_mps;
    rmc.fields.direction_degrees = bearingOf(fix.velocity->course_rad, T_map_here);
    o.setMsg(rmc);
  }
  write(o);
}

void LogWriter::writeSample(const InsPose& pose) {
  static_cast<void>(origin());
  writePose(pose.stamp_s, pose.label + kPoseSuffix, pose.T_map_body, pose.covariance);
}

void LogWriter::writeSample(const ImuSample& imu) {
  auto o = observationAt<CObservationIMU>(imu.stamp_s, imu.label);
  o.sensorPose = mrpt::poses::CPose3D(imu.p_body_imu_m.x(), imu.p_body_imu_m.y(), imu.p_body_imu_m.z());
  o.set(mrpt::obs::IMU_WX, imu.gyro_body_rps.x());
  o.set(mrpt::obs::IMU_WY, imu.gyro_body_rps.y());
  o.set(mrpt::obs::IMU_WZ, imu.gyro_body_rps.z());
  o.set(mrpt::obs::IMU_X_ACC, imu.specific_force_body_mps2.x());
  o.set(mrpt::obs::IMU_Y_ACC, imu.specific_force_body_mps2.y());
  o.set(mrpt::obs::IMU_Z_ACC, imu.specific_force_body_mps2.z());
  write(o);
}

void LogWriter::writeSample(const MotionSample& motion) {
  for (const auto& observation : toObservations(motion)) write(*observation);
}

void LogWriter::writeSample(const Scan& scan) { write(*toObservation(scan)); }

void LogWriter::writeVehicleAsDaq(const MotionSample& motion) {
  auto daq = observationAt<CObservationRawDAQ>(motion.stamp_s, motion.label);
  daq.AIN_double = {motion.speed_mps, motion.steering_rad.value_or(std::numeric_limits<double>::quiet_NaN()),
                    motion.yaw_rate_rps};
  daq.AIN_channel_count = static_cast<std::uint16_t>(daq.AIN_double.size());
  write(daq);
}

void LogWriter::writePose(double stamp_s, const std::string& label, const Pose& T_map_body,
                          const Matrix6d& covariance) {
  auto o = observationAt<CObservationRobotPose>(stamp_s, label);
  o.pose.mean = toMrpt(T_map_body);
  o.pose.cov = covarianceToMrpt(T_map_body, covariance);
  write(o);
}

void LogWriter::finish() {
  if (!x_file) return;
  // gzip buffers, and MRPT's close() hides whether the last bytes reached the disk: the trailer tells.
  const auto length = static_cast<std::uint32_t>(x_file->getPosition());
  x_file->close();
  x_file.reset();
  if (statedGzipLength(x_output.temporaryPath()) != length) throw cannotWrite(x_output.path());
}

void LogWriter::commit() {
  finish();
  x_output.commit();
}

}  // namespace raceloc
