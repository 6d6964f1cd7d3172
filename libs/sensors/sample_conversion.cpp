#include "sensors/sample_conversion.h"

#include <mrpt/obs/CObservationGPS.h>
#include <mrpt/obs/CObservationIMU.h>
#include <mrpt/obs/CObservationOdometry.h>
#include <mrpt/obs/CObservationPointCloud.h>
#include <mrpt/obs/CObservationRawDAQ.h>
#include <mrpt/obs/CObservationRobotPose.h>
#include <mrpt/obs/CObservationVelodyneScan.h>

#include <cmath>
#include <cstdint>
#include <utility>

#include "sensors/gps_conversion.h"
#include "sensors/lidar_conversion.h"
#include "sensors/mrpt_stamp.h"
#include "sensors/pose_conversion.h"

namespace raceloc {

using mrpt::obs::CObservation;
using mrpt::obs::CObservationGPS;
using mrpt::obs::CObservationIMU;
using mrpt::obs::CObservationOdometry;
using mrpt::obs::CObservationPointCloud;
using mrpt::obs::CObservationRawDAQ;
using mrpt::obs::CObservationRobotPose;
using mrpt::obs::CObservationVelodyneScan;
using mrpt::obs::gnss::Message_NMEA_GGA;
using mrpt::obs::gnss::Message_NMEA_RMC;
using mrpt::obs::gnss::Message_NV_OEM6_BESTPOS;

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

namespace {

// ---- GPS

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

std::optional<GroundVelocity> velocityIn(const CObservationGPS& gps, const Pose& T_map_here) {
  if (!gps.hasMsgClass<Message_NMEA_RMC>()) return std::nullopt;
  const auto& rmc = gps.getMsgByClass<Message_NMEA_RMC>().fields;
  if (rmc.validity_char != 'A' || !std::isfinite(rmc.speed_knots) || !std::isfinite(rmc.direction_degrees))
    return std::nullopt;
  return GroundVelocity{rmc.speed_knots * kKnot_mps, courseOf(rmc.direction_degrees, T_map_here)};
}

std::optional<GpsFix> gpsFix(const CObservationGPS& gps, const std::optional<GeodeticPoint>& map_origin) {
  const auto position = positionIn(gps);
  if (!position || !map_origin) return std::nullopt;
  const Pose T_map_here = mapFromMap(*map_origin, *position);
  const Eigen::Matrix3d R_map_here = T_map_here.linear();
  const Eigen::Vector3d variances_m2 = sigmasOf(gps).cwiseAbs2();
  return GpsFix{fromMrptStamp(gps.timestamp),
                gps.sensorLabel,
                toMap(*position, *map_origin),
                R_map_here * variances_m2.asDiagonal() * R_map_here.transpose(),
                fromMrpt(gps.sensorPose).translation(),
                gps.getMsgByClass<Message_NMEA_GGA>().fields.fix_quality,
                velocityIn(gps, T_map_here)};
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
          R_body_imu * read(mrpt::obs::IMU_X_ACC, mrpt::obs::IMU_Y_ACC, mrpt::obs::IMU_Z_ACC),
          fromMrpt(imu.sensorPose).translation()};
}

bool isFinite(const InsPose& s) { return s.T_map_body.matrix().allFinite() && s.covariance.allFinite(); }
bool isFinite(const ImuSample& s) {
  return s.gyro_body_rps.allFinite() && s.specific_force_body_mps2.allFinite();
}
bool isFinite(const MotionSample& s) { return std::isfinite(s.speed_mps) && std::isfinite(s.yaw_rate_rps); }

bool isFinite(const GpsFix& /*screened where it is read*/) { return true; }
bool isFinite(const Scan& /*its points are*/) { return true; }

}  // namespace

Device deviceOf(const CObservation& o) {
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

double bearingOf(double course_rad, const Pose& T_map_here) {
  const double bearing_deg = (M_PI / 2 - course_rad + yawOf(T_map_here)) * 180 / M_PI;
  return bearing_deg - 360 * std::floor(bearing_deg / 360);
}

double courseOf(double bearing_deg, const Pose& T_map_here) {
  return std::remainder(M_PI / 2 - bearing_deg * M_PI / 180 + yawOf(T_map_here), 2 * M_PI);
}

std::optional<Sample> sampleIn(const CObservation& o, const MapFrames& frames) {
  const auto [label, kind] = deviceOf(o);
  if (kind == "lidar") {
    auto scan = scanFromObservation(o);
    return scan ? std::optional<Sample>(std::move(*scan)) : std::nullopt;
  }
  if (kind == "gps") {
    auto fix = gpsFix(dynamic_cast<const CObservationGPS&>(o), frames.map_origin);
    return fix ? std::optional<Sample>(std::move(*fix)) : std::nullopt;
  }
  if (kind == "ins_pose" && frames.header_origin)
    return insPose(dynamic_cast<const CObservationRobotPose&>(o), *frames.map_origin, *frames.header_origin);
  if (kind == "imu") return imuSample(dynamic_cast<const CObservationIMU&>(o));
  if (kind == "vehicle") {
    const auto& velocity = dynamic_cast<const CObservationOdometry&>(o).velocityLocal;
    return MotionSample{fromMrptStamp(o.timestamp), label, velocity.vx, velocity.omega};
  }
  return std::nullopt;
}

std::vector<std::shared_ptr<CObservation>> toObservations(const MotionSample& motion) {
  std::vector<std::shared_ptr<CObservation>> observations;
  if (motion.steering_rad) {
    auto daq = CObservationRawDAQ::Create();
    daq->AIN_double = {motion.speed_mps, *motion.steering_rad};
    daq->AIN_channel_count = static_cast<std::uint16_t>(daq->AIN_double.size());
    observations.push_back(std::move(daq));
  }
  auto wheels = CObservationOdometry::Create();
  wheels->hasVelocities = true;
  wheels->velocityLocal = {motion.speed_mps, 0, motion.yaw_rate_rps};
  observations.push_back(std::move(wheels));
  for (const auto& o : observations) {
    o->timestamp = toMrptStamp(motion.stamp_s);
    o->sensorLabel = motion.label;
  }
  return observations;
}

bool isSound(const CObservation& observation, const Sample& sample) {
  return observation.timestamp != INVALID_TIMESTAMP &&
         std::visit([](const auto& known) { return isFinite(known); }, sample);
}

}  // namespace raceloc
