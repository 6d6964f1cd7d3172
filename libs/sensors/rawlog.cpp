#include "sensors/rawlog.h"

#include <mrpt/io/CFileGZOutputStream.h>
#include <mrpt/obs/CObservationComment.h>
#include <mrpt/obs/CObservationGPS.h>
#include <mrpt/obs/CObservationIMU.h>
#include <mrpt/obs/CObservationOdometry.h>
#include <mrpt/obs/CObservationPointCloud.h>
#include <mrpt/obs/CObservationRawDAQ.h>
#include <mrpt/obs/CObservationRobotPose.h>
#include <mrpt/obs/CObservationVelodyneScan.h>
#include <mrpt/serialization/CArchive.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <cstdint>
#include <limits>
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

namespace raceloc {

namespace {

using mrpt::obs::CObservation;
using mrpt::obs::CObservationComment;
using mrpt::obs::CObservationGPS;
using mrpt::obs::CObservationIMU;
using mrpt::obs::CObservationOdometry;
using mrpt::obs::CObservationPointCloud;
using mrpt::obs::CObservationRawDAQ;
using mrpt::obs::CObservationRobotPose;
using mrpt::obs::CObservationVelodyneScan;
using mrpt::obs::gnss::Message_NMEA_GGA;
using mrpt::obs::gnss::Message_NV_OEM6_BESTPOS;

constexpr std::size_t kMaxWaiting = 20'000;  // bounds the memory when stamps stand still
const std::string kPoseSuffix = "_pose";

// ---- The header

std::string originText(const GeodeticPoint& origin) {
  char text[200];
  std::snprintf(text, sizeof text,
                "[raceloc]\norigin_lat_deg = %.17g\norigin_lon_deg = %.17g\norigin_height_m = %.17g\n",
                origin.latitude_deg, origin.longitude_deg, origin.height_m);
  return text;
}

/** The origin in a header of ours; empty for any other comment. */
std::optional<GeodeticPoint> originIn(const CObservationComment& comment) {
  std::istringstream lines(comment.text);
  std::string line;
  if (!std::getline(lines, line) || line.rfind("[raceloc]", 0) != 0) return std::nullopt;
  GeodeticPoint origin{};
  for (auto [key, value] : {std::pair{"origin_lat_deg = ", &origin.latitude_deg},
                            std::pair{"origin_lon_deg = ", &origin.longitude_deg},
                            std::pair{"origin_height_m = ", &origin.height_m}}) {
    const std::string name = key;
    if (!std::getline(lines, line) || line.compare(0, name.size(), name) != 0) return std::nullopt;
    const char* begin = line.data() + name.size();
    if (std::from_chars(begin, line.data() + line.size(), *value).ec != std::errc()) return std::nullopt;
  }
  return origin;
}

// ---- GPS

/** Position of a GGA with a fix; heights above sea level are lifted to the ellipsoid by the undulation it
 * states. */
std::optional<GeodeticPoint> positionIn(const CObservation& observation) {
  const auto* gps = dynamic_cast<const CObservationGPS*>(&observation);
  if (gps == nullptr || !gps->hasMsgClass<Message_NMEA_GGA>()) return std::nullopt;
  const auto& gga = gps->getMsgByClass<Message_NMEA_GGA>().fields;
  const double undulation_m = gga.geoidal_distance;
  const GeodeticPoint point{gga.latitude_degrees, gga.longitude_degrees,
                            gga.altitude_meters + (std::isfinite(undulation_m) ? undulation_m : 0)};
  const bool usable = gga.fix_quality > 0 && std::isfinite(point.latitude_deg) &&
                      std::isfinite(point.longitude_deg) && std::isfinite(point.height_m) &&
                      std::abs(point.latitude_deg) <= 90;
  return usable ? std::optional(point) : std::nullopt;
}

double usualSigma_m(int fix_quality) {
  switch (fix_quality) {
    case 1:
    case 3:
      return 2.5;
    case 2:
      return 0.8;
    case 4:
      return 0.02;
    case 5:
      return 0.3;
    default:
      return 5;
  }
}

/** Sigmas along east, north and up at the antenna. */
Eigen::Vector3d sigmasOf(const CObservationGPS& gps) {
  if (gps.hasMsgClass<Message_NV_OEM6_BESTPOS>()) {
    const auto& best = gps.getMsgByClass<Message_NV_OEM6_BESTPOS>().fields;
    Eigen::Vector3d sigmas_m(best.lon_sigma, best.lat_sigma, best.hgt_sigma);
    if (sigmas_m.allFinite() && sigmas_m.minCoeff() > 0) return sigmas_m;
  }
  const auto& gga = gps.getMsgByClass<Message_NMEA_GGA>().fields;
  const double hdop = gga.thereis_HDOP && gga.HDOP > 0 ? gga.HDOP : 1;
  return usualSigma_m(gga.fix_quality) * hdop * Eigen::Vector3d(1, 1, 1.5);
}

std::optional<GpsFix> gpsFix(const CObservationGPS& gps, const std::optional<GeodeticPoint>& map_origin) {
  const auto position = positionIn(gps);
  if (!position || !map_origin) return std::nullopt;
  const Eigen::Matrix3d R_map_here = mapFromMap(*map_origin, *position).linear();
  const Eigen::Vector3d variances_m2 = sigmasOf(gps).cwiseAbs2();
  return GpsFix{
      fromMrptStamp(gps.timestamp),           gps.sensorLabel,
      toMap(*position, *map_origin),          R_map_here * variances_m2.asDiagonal() * R_map_here.transpose(),
      fromMrpt(gps.sensorPose).translation(), gps.getMsgByClass<Message_NMEA_GGA>().fields.fix_quality};
}

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

mrpt::obs::gnss::UTC_time timeOfDay(double stamp_s) {
  const double day_s = stamp_s - 86400 * std::floor(stamp_s / 86400);
  mrpt::obs::gnss::UTC_time time;
  time.hour = static_cast<std::uint8_t>(day_s / 3600);
  time.minute = static_cast<std::uint8_t>(std::fmod(day_s, 3600) / 60);
  time.sec = std::fmod(day_s, 60);
  return time;
}

// ---- Others

/** The receiver's label of an INS pose, empty for other poses (such as estimates). */
std::string receiverOf(const CObservationRobotPose& pose) {
  const std::string& label = pose.sensorLabel;
  const bool is_ins = label.size() > kPoseSuffix.size() &&
                      label.compare(label.size() - kPoseSuffix.size(), kPoseSuffix.size(), kPoseSuffix) == 0;
  return is_ins ? label.substr(0, label.size() - kPoseSuffix.size()) : "";
}

InsPose insPose(const CObservationRobotPose& pose, const GeodeticPoint& map_origin,
                const GeodeticPoint& log_origin) {
  // Moving to another map frame multiplies from the left: the covariance of a right increment stays.
  const Pose T_log_body = fromMrpt(pose.pose.mean);
  return {fromMrptStamp(pose.timestamp), receiverOf(pose), mapFromMap(map_origin, log_origin) * T_log_body,
          covarianceFromMrpt(T_log_body, pose.pose.cov.asEigen())};
}

bool isComplete(const CObservationIMU& imu) {
  return imu.has(mrpt::obs::IMU_WX) && imu.has(mrpt::obs::IMU_WY) && imu.has(mrpt::obs::IMU_WZ) &&
         imu.has(mrpt::obs::IMU_X_ACC) && imu.has(mrpt::obs::IMU_Y_ACC) && imu.has(mrpt::obs::IMU_Z_ACC);
}

ImuSample imuSample(const CObservationIMU& imu) {
  const Eigen::Matrix3d R_body_imu = fromMrpt(imu.sensorPose).linear();
  const auto read = [&](auto x, auto y, auto z) {
    return Eigen::Vector3d(imu.get(x), imu.get(y), imu.get(z));
  };
  return {fromMrptStamp(imu.timestamp), imu.sensorLabel,
          R_body_imu * read(mrpt::obs::IMU_WX, mrpt::obs::IMU_WY, mrpt::obs::IMU_WZ),
          R_body_imu * read(mrpt::obs::IMU_X_ACC, mrpt::obs::IMU_Y_ACC, mrpt::obs::IMU_Z_ACC)};
}

/** Label and kind under which an observation is counted. */
std::pair<std::string, std::string> deviceOf(const CObservation& o) {
  if (const auto* pose = dynamic_cast<const CObservationRobotPose*>(&o); pose && !receiverOf(*pose).empty())
    return {receiverOf(*pose), "ins_pose"};
  if (dynamic_cast<const CObservationPointCloud*>(&o) || dynamic_cast<const CObservationVelodyneScan*>(&o))
    return {o.sensorLabel, "lidar"};
  if (const auto* gps = dynamic_cast<const CObservationGPS*>(&o); gps && gps->hasMsgClass<Message_NMEA_GGA>())
    return {o.sensorLabel, "gps"};
  if (const auto* imu = dynamic_cast<const CObservationIMU*>(&o); imu && isComplete(*imu))
    return {o.sensorLabel, "imu"};
  if (const auto* wheel = dynamic_cast<const CObservationOdometry*>(&o); wheel && wheel->hasVelocities)
    return {o.sensorLabel, "vehicle"};
  return {o.sensorLabel, "other"};
}

std::string nameOf(const std::string& kind) {
  if (kind == "lidar") return "LiDAR";
  if (kind == "gps") return "GPS";
  if (kind == "ins_pose") return "INS pose";
  if (kind == "imu") return "IMU";
  return kind;
}

}  // namespace

void LogOptions::describe(OptionList& keys) {
  keys.add("lidar_labels", lidar_labels, "LiDARs to use: shell patterns, separated by blanks");
  keys.add("gps_labels", gps_labels, "GPS receivers to use, with their INS poses");
  keys.add("imu_labels", imu_labels, "IMUs to use");
  keys.add("vehicle_labels", vehicle_labels, "sources of speed, yaw rate and steering to use");
  keys.add("reorder_window_s", reorder_window_s, between(0, 60),
           "samples up to this late are put in order [s]");
}

LogSummary summarizeRawlog(const std::string& path) {
  RawlogObjects objects(path);
  LogSummary summary{
      path, {}, {}, std::numeric_limits<double>::infinity(), -std::numeric_limits<double>::infinity()};
  std::optional<GeodeticPoint> first_fix;
  DeviceTally tally;
  while (const auto observation = objects.next()) {
    if (const auto* comment = dynamic_cast<const CObservationComment*>(observation.get())) {
      if (!summary.origin) summary.origin = originIn(*comment);
      continue;
    }
    if (!first_fix) first_fix = positionIn(*observation);
    const auto [label, kind] = deviceOf(*observation);
    const double stamp_s = fromMrptStamp(observation->timestamp);
    tally.add(label, kind, stamp_s);
    summary.first_s = std::min(summary.first_s, stamp_s);
    summary.last_s = std::max(summary.last_s, stamp_s);
  }
  summary.devices = tally.devices();
  if (summary.devices.empty()) throw InputError("rawlog " + path + ": empty, it holds no observation");
  if (!summary.origin) summary.origin = first_fix;
  return summary;
}

void requireDevice(const LogSummary& summary, const std::string& kind, const std::string& patterns) {
  std::vector<std::string> labels;
  for (const auto& device : summary.devices) {
    if (device.kind != kind) continue;
    if (matchesLabel(patterns, device.label)) return;
    labels.push_back(device.label);
  }
  const std::string name = nameOf(kind);
  throw InputError("rawlog " + summary.path + ": no " + name + " observation labelled " + patterns + " (" +
                   name + " labels in it: " + listed(labels) + ")");
}

// ---- Reading

LogReader::LogReader(const std::string& path, const LogOptions& options,
                     std::optional<GeodeticPoint> map_origin)
    : x_options(options),
      x_objects(std::make_unique<RawlogObjects>(path)),
      x_map_origin(map_origin),
      x_newest_s(-std::numeric_limits<double>::infinity()),
      x_last_out_s(-std::numeric_limits<double>::infinity()) {}

LogReader::~LogReader() = default;

double LogReader::progress() const { return x_objects->progress(); }

bool LogReader::mayLeave() const {
  return !x_waiting.empty() && (x_newest_s - x_waiting.begin()->first > x_options.reorder_window_s ||
                                x_waiting.size() > kMaxWaiting);
}

std::optional<Sample> LogReader::next() {
  while (!x_at_end && !mayLeave()) {
    if (const auto observation = x_objects->next())
      take(*observation);
    else
      x_at_end = true;
  }
  if (x_waiting.empty()) return std::nullopt;
  auto first = x_waiting.extract(x_waiting.begin());
  x_last_out_s = first.key();
  return std::move(first.mapped());
}

namespace {

bool isFinite(const InsPose& s) { return s.T_map_body.matrix().allFinite() && s.covariance.allFinite(); }
bool isFinite(const ImuSample& s) {
  return s.gyro_body_rps.allFinite() && s.specific_force_body_mps2.allFinite();
}
bool isFinite(const MotionSample& s) { return std::isfinite(s.speed_mps) && std::isfinite(s.yaw_rate_rps); }

bool isFinite(const GpsFix& /*screened where it is read*/) { return true; }
bool isFinite(const Scan& /*its points are*/) { return true; }

}  // namespace

void LogReader::take(const CObservation& observation) {
  if (const auto* comment = dynamic_cast<const CObservationComment*>(&observation)) {
    if (!x_header_origin) x_header_origin = originIn(*comment);
    if (!x_map_origin) x_map_origin = x_header_origin;
    return;
  }
  if (!x_map_origin) x_map_origin = positionIn(observation);
  if (const auto* daq = dynamic_cast<const CObservationRawDAQ*>(&observation)) return joinSteering(*daq);

  auto sample = decoded(observation);
  if (!sample) return;
  const double stamp_s = stampOf(*sample);
  const bool sound = std::visit([](const auto& known) { return isFinite(known); }, *sample);
  if (!sound || observation.timestamp == INVALID_TIMESTAMP || stamp_s < x_last_out_s) {
    ++x_dropped;
    return;
  }
  x_newest_s = std::max(x_newest_s, stamp_s);
  x_waiting.emplace(stamp_s, std::move(*sample));
}

void LogReader::joinSteering(const CObservationRawDAQ& daq) {
  if (daq.AIN_double.size() != 2 || !matchesLabel(x_options.vehicle_labels, daq.sensorLabel)) return;
  const Steering steering{fromMrptStamp(daq.timestamp), daq.AIN_double[1]};
  const auto [begin, end] = x_waiting.equal_range(steering.stamp_s);
  for (auto waiting = begin; waiting != end; ++waiting)
    if (auto* motion = std::get_if<MotionSample>(&waiting->second);
        motion && motion->label == daq.sensorLabel)
      motion->steering_rad = steering.steering_rad;
  x_steering[daq.sensorLabel] = steering;
}

std::optional<Sample> LogReader::decoded(const CObservation& o) const {
  const auto [label, kind] = deviceOf(o);
  if (kind == "lidar") {
    if (!matchesLabel(x_options.lidar_labels, label)) return std::nullopt;
    auto scan = scanFromObservation(o);
    return scan ? std::optional<Sample>(std::move(*scan)) : std::nullopt;
  }
  if (kind == "gps" && matchesLabel(x_options.gps_labels, label)) {
    auto fix = gpsFix(dynamic_cast<const CObservationGPS&>(o), x_map_origin);
    return fix ? std::optional<Sample>(std::move(*fix)) : std::nullopt;
  }
  if (kind == "ins_pose" && x_header_origin && matchesLabel(x_options.gps_labels, label))
    return insPose(dynamic_cast<const CObservationRobotPose&>(o), *x_map_origin, *x_header_origin);
  if (kind == "imu" && matchesLabel(x_options.imu_labels, label))
    return imuSample(dynamic_cast<const CObservationIMU&>(o));
  if (kind == "vehicle" && matchesLabel(x_options.vehicle_labels, label)) {
    const auto& velocity = dynamic_cast<const CObservationOdometry&>(o).velocityLocal;
    MotionSample motion{fromMrptStamp(o.timestamp), label, velocity.vx, velocity.omega};
    if (const auto last = x_steering.find(label);
        last != x_steering.end() && last->second.stamp_s == motion.stamp_s)
      motion.steering_rad = last->second.steering_rad;
    return motion;
  }
  return std::nullopt;
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

CObservationRawDAQ daqOf(const MotionSample& motion, std::vector<double> values) {
  auto daq = observationAt<CObservationRawDAQ>(motion.stamp_s, motion.label);
  daq.AIN_channel_count = static_cast<std::uint16_t>(values.size());
  daq.AIN_double = std::move(values);
  return daq;
}

InputError cannotWrite(const std::string& path) {
  return InputError("output " + path +
                    ": cannot be written; check the folder, its rights and the space left");
}

}  // namespace

LogWriter::LogWriter(const std::string& path, const LogHeader& header, int gzip_level)
    : x_header(header), x_output(path), x_file(std::make_unique<mrpt::io::CFileGZOutputStream>()) {
  if (!x_file->open(x_output.temporaryPath(), gzip_level)) throw cannotWrite(path);
  CObservationComment comment;
  comment.timestamp = INVALID_TIMESTAMP;  // else the wall clock: same samples, same file
  comment.text = (header.origin ? originText(*header.origin) : "") + header.text;
  write(comment);
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
  const Eigen::Matrix3d R_map_here = mapFromMap(origin(), here).linear();
  const Eigen::Vector3f sigmas_m =
      (R_map_here.transpose() * fix.cov_map_m2 * R_map_here).diagonal().cwiseSqrt().cast<float>();

  Message_NMEA_GGA gga;
  gga.fields.UTCTime = timeOfDay(fix.stamp_s);
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

  auto o = observationAt<CObservationGPS>(fix.stamp_s, fix.label);
  o.has_satellite_timestamp = true;
  o.originalReceivedTimestamp = o.timestamp;
  o.sensorPose =
      mrpt::poses::CPose3D(fix.p_body_antenna_m.x(), fix.p_body_antenna_m.y(), fix.p_body_antenna_m.z());
  o.setMsg(gga);
  o.setMsg(best);
  write(o);
}

void LogWriter::writeSample(const InsPose& pose) {
  static_cast<void>(origin());
  auto o = observationAt<CObservationRobotPose>(pose.stamp_s, pose.label + kPoseSuffix);
  o.pose.mean = toMrpt(pose.T_map_body);
  o.pose.cov = covarianceToMrpt(pose.T_map_body, pose.covariance);
  write(o);
}

void LogWriter::writeSample(const ImuSample& imu) {
  auto o = observationAt<CObservationIMU>(imu.stamp_s, imu.label);
  o.set(mrpt::obs::IMU_WX, imu.gyro_body_rps.x());
  o.set(mrpt::obs::IMU_WY, imu.gyro_body_rps.y());
  o.set(mrpt::obs::IMU_WZ, imu.gyro_body_rps.z());
  o.set(mrpt::obs::IMU_X_ACC, imu.specific_force_body_mps2.x());
  o.set(mrpt::obs::IMU_Y_ACC, imu.specific_force_body_mps2.y());
  o.set(mrpt::obs::IMU_Z_ACC, imu.specific_force_body_mps2.z());
  write(o);
}

void LogWriter::writeSample(const MotionSample& motion) {
  if (motion.steering_rad) write(daqOf(motion, {motion.speed_mps, *motion.steering_rad}));
  auto o = observationAt<CObservationOdometry>(motion.stamp_s, motion.label);
  o.hasVelocities = true;
  o.velocityLocal = {motion.speed_mps, 0, motion.yaw_rate_rps};
  write(o);
}

void LogWriter::writeSample(const Scan& scan) { write(*toObservation(scan)); }

void LogWriter::writeVehicleAsDaq(const MotionSample& motion) {
  write(
      daqOf(motion, {motion.speed_mps, motion.steering_rad.value_or(std::numeric_limits<double>::quiet_NaN()),
                     motion.yaw_rate_rps}));
}

void LogWriter::commit() {
  // gzip buffers, and MRPT's close() hides whether the last bytes reached the disk: the trailer tells.
  const auto length = static_cast<std::uint32_t>(x_file->getPosition());
  x_file->close();
  if (statedGzipLength(x_output.temporaryPath()) != length) throw cannotWrite(x_output.path());
  x_output.commit();
}

}  // namespace raceloc
