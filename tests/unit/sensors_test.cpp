/** \file
 * libs/sensors against values known from elsewhere, bad input, and real recordings where they are. */
#include <gmock/gmock.h>
#include <mrpt/io/CFileGZOutputStream.h>
#include <mrpt/maps/CPointsMapXYZI.h>
#include <mrpt/obs/CObservationComment.h>
#include <mrpt/obs/CObservationGPS.h>
#include <mrpt/obs/CObservationIMU.h>
#include <mrpt/obs/CObservationOdometry.h>
#include <mrpt/obs/CObservationPointCloud.h>
#include <mrpt/obs/CObservationRawDAQ.h>
#include <mrpt/obs/CObservationRobotPose.h>
#include <mrpt/serialization/CArchive.h>
#include <unistd.h>

#include <cmath>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <limits>
#include <sstream>
#include <stdexcept>

#include "core/errors.h"
#include "core/trajectory.h"
#include "sensors/csv_log.h"
#include "sensors/foreign_logs.h"
#include "sensors/gps_conversion.h"
#include "sensors/kitti.h"
#include "sensors/lidar_conversion.h"
#include "sensors/message_reader.h"
#include "sensors/mrpt_stamp.h"
#include "sensors/pcd_folder.h"
#include "sensors/pose_conversion.h"
#include "sensors/rawlog.h"
#include "sensors/rawlog_objects.h"
#include "sensors/text_input.h"
#include "sensors/velodyne_pcap.h"
#include "support/complaint.h"

/** For the leak sanitizer: MRPT's Velodyne driver keeps 136 bytes of libpcap's for each capture. */
// NOLINTNEXTLINE(bugprone-reserved-identifier): the sanitizer's name for it
extern "C" const char* __lsan_default_suppressions() { return "leak:libpcap.so"; }

namespace raceloc {
namespace {

namespace fs = std::filesystem;
using ::testing::AllOf;
using ::testing::Contains;
using ::testing::ElementsAre;
using ::testing::Field;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

const fs::path kRoot = RACELOC_ROOT;
const fs::path kRecordings = kRoot / "../shared/data";
const fs::path kKittiDrive = kRoot / "build/data/kitti_raw/2011_09_26/2011_09_26_drive_0013_sync";

const ShareDone kQuiet = [](double) {};

class SensorsTest : public ::testing::Test {
 protected:
  void SetUp() override {
    const auto* info = ::testing::UnitTest::GetInstance()->current_test_info();
    folder = fs::temp_directory_path() / ("raceloc_" + std::to_string(::getpid()) + "_" + info->name());
    fs::create_directories(folder);
  }
  void TearDown() override { fs::remove_all(folder); }

  [[nodiscard]] std::string in(const std::string& name) const { return (folder / name).string(); }
  std::string write(const std::string& name, const std::string& text) const {
    fs::create_directories((folder / name).parent_path());
    std::ofstream(in(name), std::ios::binary) << text;
    return in(name);
  }
  [[nodiscard]] std::vector<std::string> rawlogsLeft() const {
    std::vector<std::string> names;
    for (const auto& entry : fs::directory_iterator(folder))
      if (entry.path().extension() == ".rawlog") names.push_back(entry.path().filename().string());
    return names;
  }

  fs::path folder;
};

std::vector<Sample> readAll(const std::string& path, const LogOptions& options = {},
                            std::optional<GeodeticPoint> map_origin = {}) {
  LogReader reader(path, options, map_origin);
  std::vector<Sample> samples;
  while (auto sample = reader.next()) samples.push_back(std::move(*sample));
  return samples;
}

template <class Kind>
std::vector<Kind> only(const std::vector<Sample>& samples) {
  std::vector<Kind> found;
  for (const auto& sample : samples)
    if (const auto* kind = std::get_if<Kind>(&sample)) found.push_back(*kind);
  return found;
}

const GeodeticPoint kOrigin{49.0, 8.4, 115};
const Scan kScan{1e9, "lidar_top", Pose::Identity(), {{1}, {2}, {3}, {0.5F}}, {0.0F}, {}};
const MotionSample kMotion{1e9 + 0.01, "vehicle", 12, 0.1};

std::string writeLog(const std::string& path, const std::vector<Sample>& samples,
                     const std::optional<GeodeticPoint>& origin = kOrigin) {
  LogWriter writer(path, {origin, ""});
  for (const auto& sample : samples) writer.write(sample);
  writer.commit();
  return path;
}

// ---- Text

TEST(TextInput, CivilTimes) {
  // by `date -d ... +%s`
  EXPECT_EQ(parseCivilTime("2025-09-05T00:27:38.5Z"), 1757032058.5);
  EXPECT_EQ(parseCivilTime("2025-09-05 00:27:38"), 1757032058);
  EXPECT_EQ(parseCivilTime("2000-02-29T12:00:00Z"), 951825600);
  EXPECT_EQ(parseCivilTime("2011-09-26T13:10:51+02:00"), 1317035451);
  for (const std::string bad : {"", "2025-13-05 00:00:00", "2025-09-05", "2025-09-05 00:27:38.",
                                "2025-09-05x00:27:38", "2025-09-05 00:27:38 CEST"})
    EXPECT_EQ(parseCivilTime(bad), std::nullopt) << bad;
}

TEST(TextInput, NumbersAreWhole) {
  EXPECT_EQ(parseNumber("-1.5e3"), -1500);
  for (const std::string bad : {"", "1,5", "1 ", "0x10", "nan", "inf", "1e999"})
    EXPECT_EQ(parseNumber(bad), std::nullopt);
  EXPECT_THAT(split("a, \"b c\",,d", ','), ElementsAre("a", "b c", "", "d"));
  EXPECT_THAT(split("  1   2 ", ' '), ElementsAre("1", "2"));
}

TEST(TextInput, Decimation) {
  EXPECT_TRUE(parseDecimation("even").keeps(4) && !parseDecimation("even").keeps(5));
  EXPECT_TRUE(parseDecimation("odd").keeps(5) && !parseDecimation("odd").keeps(4));
  EXPECT_TRUE(parseDecimation("3").keeps(6) && !parseDecimation("3").keeps(7));
  for (const std::string bad : {"", "0", "-1", "1.5", "evn"})
    EXPECT_THROW(static_cast<void>(parseDecimation(bad)), InputError) << bad;
}

// ---- Earth

TEST(GpsConversion, KnownLengths) {
  // On the equator the ellipsoid's radii are a = 6378137 m along it and a (1 - e^2) = 6335439.327 m across
  // it.
  const GeodeticPoint equator{0, 20, 0};
  const double step_rad = 1e-5 * M_PI / 180;
  EXPECT_NEAR(toMap({0, 20 + 1e-5, 0}, equator).x(), 6378137 * step_rad, 1e-6);
  EXPECT_NEAR(toMap({1e-5, 20, 0}, equator).y(), 6335439.327 * step_rad, 1e-6);
  EXPECT_NEAR(toMap({0, 20, 7}, equator).z(), 7, 1e-8);
}

TEST(GpsConversion, UpTurnsAwayWithDistance) {
  // Two frames one degree apart along the equator: their verticals are one degree apart.
  const Pose T = mapFromMap({0, 0, 0}, {0, 1, 0});
  EXPECT_NEAR(T.linear()(2, 2), std::cos(M_PI / 180), 1e-12);
  EXPECT_NEAR(T.linear()(0, 2), std::sin(M_PI / 180), 1e-12);
}

TEST(MrptStamp, KnownTicks) {
  // 1601-01-01 to 1970-01-01: 134774 days
  EXPECT_EQ(toMrptStamp(0).time_since_epoch().count(), 134774LL * 86400 * 10'000'000);
  EXPECT_EQ(fromMrptStamp(toMrptStamp(1317035451.175862)), 1317035451.175862);
}

// ---- Foreign observations

std::shared_ptr<mrpt::obs::CObservationGPS> foreignFix(double stamp_s, int quality,
                                                       std::optional<double> hdop) {
  auto gps = mrpt::obs::CObservationGPS::Create();
  gps->sensorLabel = "gps";
  gps->timestamp = toMrptStamp(stamp_s);
  mrpt::obs::gnss::Message_NMEA_GGA gga;
  gga.fields.latitude_degrees = 49;
  gga.fields.longitude_degrees = 8.4;
  gga.fields.altitude_meters = 67;
  gga.fields.geoidal_distance = 48;
  gga.fields.fix_quality = static_cast<std::uint8_t>(quality);
  gga.fields.thereis_HDOP = hdop.has_value();
  gga.fields.HDOP = static_cast<float>(hdop.value_or(0));
  gps->setMsg(gga);
  return gps;
}

TEST_F(SensorsTest, ForeignFixesGetTheUsualSigmas) {
  {
    LogWriter writer(in("x.rawlog"), {});
    writer.write(*foreignFix(1, 0, {}));
    writer.write(*foreignFix(2, 1, 2.0));
    writer.write(*foreignFix(3, 4, {}));
    writer.commit();
  }
  LogReader reader(in("x.rawlog"), {});
  std::vector<GpsFix> fixes;
  while (auto sample = reader.next()) fixes.push_back(std::get<GpsFix>(*sample));
  ASSERT_EQ(fixes.size(), 2U);                // the one without a fix is skipped
  EXPECT_EQ(reader.origin()->height_m, 115);  // sea level and undulation
  EXPECT_LT(fixes[0].p_map_antenna_m.norm(), 1e-6);
  EXPECT_NEAR(std::sqrt(fixes[0].cov_map_m2(0, 0)), 5.0, 1e-9);  // 2.5 m per HDOP
  EXPECT_NEAR(std::sqrt(fixes[0].cov_map_m2(2, 2)), 7.5, 1e-9);
  EXPECT_NEAR(std::sqrt(fixes[1].cov_map_m2(1, 1)), 0.02, 1e-9);  // RTK fixed
}

TEST_F(SensorsTest, ForeignVelocitiesAreReadWhenValid) {
  const auto velocityOf = [&](char validity, double speed_knots, double direction_deg) {
    const auto gps = foreignFix(1, 1, {});
    mrpt::obs::gnss::Message_NMEA_RMC rmc;
    rmc.fields.validity_char = static_cast<std::int8_t>(validity);
    rmc.fields.speed_knots = speed_knots;
    rmc.fields.direction_degrees = direction_deg;
    gps->setMsg(rmc);
    LogWriter writer(in("x.rawlog"), {});
    writer.write(*gps);
    writer.commit();
    return only<GpsFix>(readAll(in("x.rawlog"))).at(0).velocity;
  };
  const auto west = velocityOf('A', 10, 270);
  ASSERT_TRUE(west);
  EXPECT_NEAR(west->speed_mps, 5.14444444444, 1e-9);  // a knot is 1852 m an hour
  EXPECT_NEAR(std::abs(west->course_rad), M_PI, 1e-9);
  EXPECT_NEAR(velocityOf('A', 10, 60)->course_rad, M_PI / 6, 1e-9);
  EXPECT_FALSE(velocityOf('V', 10, 270));
  EXPECT_FALSE(velocityOf('A', NAN, 270));
  EXPECT_FALSE(velocityOf('A', 10, INFINITY));
}

TEST_F(SensorsTest, VelocityIsWrittenAsReceiversSayIt) {
  // 2025-09-05 00:27:38.5 UTC; along the map's y, so far east that the meridians converge
  const GpsFix fix{1757032058.5,
                   "gps",
                   {10'000, 0, 0},
                   Eigen::Matrix3d::Identity(),
                   {0, 0, 0},
                   4,
                   GroundVelocity{20, M_PI / 2}};
  writeLog(in("x.rawlog"), {fix});
  RawlogObjects objects(in("x.rawlog"));
  static_cast<void>(objects.next());  // the header
  const auto gps = std::dynamic_pointer_cast<mrpt::obs::CObservationGPS>(objects.next());
  ASSERT_TRUE(gps && gps->hasMsgClass<mrpt::obs::gnss::Message_NMEA_RMC>());
  const auto& rmc = gps->getMsgByClass<mrpt::obs::gnss::Message_NMEA_RMC>();
  EXPECT_EQ(rmc.fields.validity_char, 'A');
  EXPECT_NEAR(rmc.fields.speed_knots, 20 * 3600 / 1852.0, 1e-9);
  // North at the antenna leans towards the origin's meridian, so that the map's y is to its right.
  const double converged_deg = 10'000 / 6.39e6 * std::tan(kOrigin.latitude_deg * M_PI / 180) * 180 / M_PI;
  EXPECT_NEAR(rmc.fields.direction_degrees, converged_deg, 1e-3);
  const auto& gga = gps->getMsgByClass<mrpt::obs::gnss::Message_NMEA_GGA>().fields;
  // Copies: the fields are packed, and a matcher would bind to a misaligned one.
  EXPECT_EQ(double{rmc.fields.latitude_degrees}, double{gga.latitude_degrees});
  EXPECT_EQ(double{rmc.fields.longitude_degrees}, double{gga.longitude_degrees});
  EXPECT_EQ(rmc.fields.date_day, 5);
  EXPECT_EQ(rmc.fields.date_month, 9);
  EXPECT_EQ(int{rmc.fields.date_year}, 25);
  EXPECT_EQ(rmc.fields.UTCTime.hour, 0);
  EXPECT_EQ(rmc.fields.UTCTime.minute, 27);
  EXPECT_EQ(double{rmc.fields.UTCTime.sec}, 38.5);
  EXPECT_EQ(fromMrptStamp(rmc.getDateAsTimestamp()), 1757030400);  // the midnight before
}

TEST_F(SensorsTest, ForeignImuIsTurnedIntoTheBody) {
  mrpt::obs::CObservationIMU imu;
  imu.sensorLabel = "imu";
  imu.timestamp = toMrptStamp(5);
  imu.sensorPose = mrpt::poses::CPose3D(1, 2, 3, M_PI / 2, 0, 0);  // its x is the body's y
  imu.set(mrpt::obs::IMU_WX, 1);
  imu.set(mrpt::obs::IMU_WY, 0);
  imu.set(mrpt::obs::IMU_WZ, 0.5);
  imu.set(mrpt::obs::IMU_X_ACC, 2);
  imu.set(mrpt::obs::IMU_Y_ACC, 3);
  imu.set(mrpt::obs::IMU_Z_ACC, 9.81);
  {
    LogWriter writer(in("x.rawlog"), {});
    writer.write(imu);
    writer.commit();
  }
  const auto samples = only<ImuSample>(readAll(in("x.rawlog")));
  ASSERT_EQ(samples.size(), 1U);
  EXPECT_LT((samples[0].gyro_body_rps - Eigen::Vector3d(0, 1, 0.5)).norm(), 1e-12);
  EXPECT_LT((samples[0].specific_force_body_mps2 - Eigen::Vector3d(-3, 2, 9.81)).norm(), 1e-12);
}

TEST(LidarConversion, IntensityCloudsAreReadAndBadPointsAreNot) {
  mrpt::obs::CObservationPointCloud cloud;
  cloud.sensorLabel = "lidar";
  cloud.timestamp = toMrptStamp(5);
  cloud.sensorPose = mrpt::poses::CPose3D(1, 0, 2, 0, 0, 0);
  auto map = mrpt::maps::CPointsMapXYZI::Create();
  map->insertPointRGB(1, 2, 3, 0.25F, 0, 0);
  map->insertPointRGB(std::numeric_limits<float>::quiet_NaN(), 0, 0, 0, 0, 0);
  map->insertPointRGB(4, 5, 6, 0.5F, 0, 0);
  cloud.pointcloud = map;
  const auto scan = scanFromObservation(cloud);
  ASSERT_TRUE(scan);
  EXPECT_THAT(scan->cloud.x, ElementsAre(1, 4));
  EXPECT_THAT(scan->cloud.intensity, ElementsAre(0.25F, 0.5F));
  EXPECT_THAT(scan->time_s, IsEmpty());
  EXPECT_THAT(scan->ring, IsEmpty());
  EXPECT_EQ(scan->T_body_lidar.translation(), Eigen::Vector3d(1, 0, 2));
  EXPECT_EQ(scanFromObservation(mrpt::obs::CObservationIMU()), std::nullopt);
}

TEST_F(SensorsTest, PointsThatAreNotFiniteAreWrittenAndNotRead) {
  Scan scan = kScan;
  scan.cloud = {{1, NAN, 3, 4}, {1, 2, INFINITY, 4}, {1, 2, 3, 4}, {0.125F, 0.25F, 0.5F, 1}};
  scan.time_s = {0, NAN, 0.25F, 0.5F};
  scan.ring = {1, 2, 3, 4};
  writeLog(in("x.rawlog"), {scan});
  RawlogObjects objects(in("x.rawlog"));
  static_cast<void>(objects.next());  // the header
  const auto cloud = std::dynamic_pointer_cast<mrpt::obs::CObservationPointCloud>(objects.next());
  ASSERT_TRUE(cloud);
  ASSERT_EQ(cloud->pointcloud->size(), 4U);
  EXPECT_TRUE(std::isnan(cloud->pointcloud->getPointsBufferRef_x()[1]));
  EXPECT_TRUE(std::isinf(cloud->pointcloud->getPointsBufferRef_y()[2]));

  const auto read = only<Scan>(readAll(in("x.rawlog"))).at(0);
  EXPECT_THAT(read.cloud.x, ElementsAre(1, 4));
  EXPECT_THAT(read.cloud.intensity, ElementsAre(0.125F, 1));
  EXPECT_THAT(read.time_s, ElementsAre(0, 0.5F));
  EXPECT_THAT(read.ring, ElementsAre(1, 4));
}

TEST_F(SensorsTest, TruthIsNoInsPose) {
  const Pose T_map_body = poseFromRpy({1, 2, 3}, 0.1, 0.2, 0.3);
  {
    LogWriter writer(in("x.rawlog"), {kOrigin, ""});
    writer.writePose(5, "truth", T_map_body);
    writer.commit();
  }
  EXPECT_THAT(readAll(in("x.rawlog")), IsEmpty());
  EXPECT_THAT(
      summarizeRawlog(in("x.rawlog")).devices,
      ElementsAre(AllOf(Field(&DeviceSummary::kind, "other"), Field(&DeviceSummary::label, "truth"))));
  RawlogObjects objects(in("x.rawlog"));
  static_cast<void>(objects.next());  // the header
  const auto pose = std::dynamic_pointer_cast<mrpt::obs::CObservationRobotPose>(objects.next());
  ASSERT_TRUE(pose);
  EXPECT_EQ(fromMrptStamp(pose->timestamp), 5);
  EXPECT_LT((fromMrpt(pose->pose.mean).matrix() - T_map_body.matrix()).norm(), 1e-12);
  for (int i = 0; i < 36; ++i) EXPECT_EQ(pose->pose.cov(i / 6, i % 6), 0);
}

TEST_F(SensorsTest, PosesOfOthersAreNoInsPoses) {
  mrpt::obs::CObservationRobotPose estimate;
  estimate.sensorLabel = "estimate";
  estimate.timestamp = toMrptStamp(5);
  {
    LogWriter writer(in("x.rawlog"), {kOrigin, ""});
    writer.write(estimate);
    writer.commit();
  }
  EXPECT_THAT(readAll(in("x.rawlog")), IsEmpty());
  EXPECT_THAT(summarizeRawlog(in("x.rawlog")).devices, ElementsAre(Field(&DeviceSummary::kind, "other")));
}

// ---- Logs

TEST_F(SensorsTest, SummaryCountsDevices) {
  std::vector<Sample> samples;
  for (const double stamp_s : {100.0, 100.1, 100.2, 100.7}) {
    MotionSample motion = kMotion;
    motion.stamp_s = stamp_s;
    samples.emplace_back(motion);
  }
  Scan scan = kScan;
  scan.stamp_s = 99;
  samples.emplace_back(scan);
  const auto summary = summarizeRawlog(writeLog(in("x.rawlog"), samples));
  ASSERT_EQ(summary.devices.size(), 2U);
  const auto& vehicle = summary.devices[1];
  EXPECT_EQ(vehicle.kind, "vehicle");
  EXPECT_EQ(vehicle.label, "vehicle");
  EXPECT_EQ(vehicle.count, 4U);
  EXPECT_NEAR(vehicle.max_gap_s, 0.5, 1e-6);
  EXPECT_EQ(summary.devices[0].kind, "lidar");
  EXPECT_EQ(summary.first_s, 99);
  EXPECT_NEAR(summary.last_s, 100.7, 1e-6);
  ASSERT_TRUE(summary.origin);
  EXPECT_EQ(summary.origin->latitude_deg, kOrigin.latitude_deg);  // all digits are kept
  EXPECT_EQ(summary.origin->height_m, kOrigin.height_m);
}

TEST_F(SensorsTest, PatternsChooseDevices) {
  Scan other = kScan;
  other.label = "lidar_rear";
  writeLog(in("x.rawlog"), {kScan, other, kMotion});
  LogOptions options;
  options.lidar_labels = "*_rear";
  options.vehicle_labels = "nothing";
  const auto samples = readAll(in("x.rawlog"), options);
  ASSERT_EQ(samples.size(), 1U);
  EXPECT_EQ(labelOf(samples[0]), "lidar_rear");
}

TEST_F(SensorsTest, WrongLabelIsNamedWithTheOnesThere) {
  Scan other = kScan;
  other.label = "lidar_rear";
  const std::string path = writeLog(in("x.rawlog"), {kScan, other});
  const auto summary = summarizeRawlog(path);
  requireDevice(summary, "lidar", "lidar_roof lidar_r*");
  EXPECT_EQ(test::complaint([&] { requireDevice(summary, "lidar", "lidar_roof"); }),
            "rawlog " + path +
                ": no LiDAR observation labelled lidar_roof (LiDAR labels in it: lidar_rear, lidar_top)");
  EXPECT_EQ(test::complaint([&] { requireDevice(summary, "gps", "*"); }),
            "rawlog " + path + ": no GPS observation labelled * (GPS labels in it: none)");
}

TEST_F(SensorsTest, EveryLabelThatIsNotThereIsNamed) {
  Scan other = kScan;
  other.label = "lidar_rear";
  const std::string path = writeLog(in("x.rawlog"), {kScan, other, kMotion});
  const auto summary = summarizeRawlog(path);
  LogOptions options;
  EXPECT_THAT(missingDevices(summary, options), IsEmpty());
  requireDevices(summary, options);
  options.lidar_labels = "lidar_r* lidar_roof, radar_*";
  options.imu_labels = "";
  EXPECT_THAT(missingDevices(summary, options),
              ElementsAre("LiDAR lidar_roof: not in the log, which has lidar_rear, lidar_top",
                          "LiDAR radar_*: not in the log, which has lidar_rear, lidar_top"));
  requireDevices(summary, options);
  options.imu_labels = "imu_*";
  EXPECT_EQ(test::complaint([&] { requireDevices(summary, options); }),
            "rawlog " + path + ": no IMU observation labelled imu_* (IMU labels in it: none)");
}

TEST_F(SensorsTest, TheFixesOfALogHaveABox) {
  const GpsFix here{1, "gps", {0, 0, 0}, Eigen::Matrix3d::Identity(), {0, 0, 0}, 4};
  GpsFix there = here;
  there.p_map_antenna_m.x() = 300;
  const auto box_m = [&](const std::vector<Sample>& samples) {
    return summarizeRawlog(writeLog(in("x.rawlog"), samples)).fixes_earth_m;
  };
  EXPECT_TRUE(box_m({kMotion}).isEmpty());
  const auto both_m = box_m({here, there});
  EXPECT_NEAR(both_m.diagonal().norm(), 300, 1e-3);
  EXPECT_NEAR(both_m.exteriorDistance(toEarth(fromMap({0, 0, 1000}, kOrigin))), 1000,
              50);  // of the box, not the line
}

TEST_F(SensorsTest, SteeringIsJoinedWhereverItsMessageIs) {
  mrpt::obs::CObservationRawDAQ late;
  late.sensorLabel = "vehicle";
  late.timestamp = toMrptStamp(2);
  late.AIN_double = {10, -0.25};
  late.AIN_channel_count = 2;
  {
    LogWriter writer(in("x.rawlog"), {});
    writer.write(MotionSample{1, "vehicle", 10, 0, 0.125});
    writer.write(MotionSample{2, "vehicle", 10, 0});
    writer.write(late);
    writer.write(MotionSample{3, "vehicle", 10, 0});
    writer.commit();
  }
  const auto motions = only<MotionSample>(readAll(in("x.rawlog")));
  ASSERT_EQ(motions.size(), 3U);
  EXPECT_EQ(motions[0].steering_rad, 0.125);
  EXPECT_EQ(motions[1].steering_rad, -0.25);
  EXPECT_EQ(motions[2].steering_rad, std::nullopt);
}

TEST_F(SensorsTest, VehicleOfAnOutputLogIsNoOdometry) {
  {
    LogWriter writer(in("x.rawlog"), {});
    writer.writeVehicleAsDaq(kMotion);
    writer.commit();
  }
  EXPECT_THAT(summarizeRawlog(in("x.rawlog")).devices, ElementsAre(Field(&DeviceSummary::kind, "other")));
  RawlogObjects objects(in("x.rawlog"));
  static_cast<void>(objects.next());  // the header
  const auto daq = std::dynamic_pointer_cast<mrpt::obs::CObservationRawDAQ>(objects.next());
  ASSERT_TRUE(daq);
  ASSERT_EQ(daq->AIN_double.size(), 3U);
  EXPECT_EQ(daq->AIN_double[0], kMotion.speed_mps);
  EXPECT_TRUE(std::isnan(daq->AIN_double[1]));
  EXPECT_EQ(daq->AIN_double[2], kMotion.yaw_rate_rps);
}

TEST_F(SensorsTest, GpsNeedsAnOrigin) {
  LogWriter writer(in("x.rawlog"), {});
  EXPECT_THROW(writer.write(GpsFix{1, "gps", {0, 0, 0}, Eigen::Matrix3d::Identity(), {0, 0, 0}, 4}),
               std::invalid_argument);
  EXPECT_THROW(writer.write(InsPose{1, "gps", Pose::Identity(), Matrix6d::Identity()}),
               std::invalid_argument);
}

TEST_F(SensorsTest, NothingAppearsWithoutCommit) {
  {
    LogWriter writer(in("x.rawlog"), {});
    writer.write(kMotion);
  }
  EXPECT_TRUE(fs::is_empty(folder));
}

TEST_F(SensorsTest, SameSamplesSameBytes) {
  for (const std::string name : {"a.rawlog", "b.rawlog"}) writeLog(in(name), {kScan, kMotion});
  const auto bytes = [&](const std::string& name) {
    std::stringstream text;
    text << std::ifstream(in(name), std::ios::binary).rdbuf();
    return text.str();
  };
  EXPECT_EQ(bytes("a.rawlog"), bytes("b.rawlog"));
}

TEST_F(SensorsTest, MissingEmptyAndGarbageLogsAreErrors) {
  EXPECT_THAT(test::complaint([&] { static_cast<void>(summarizeRawlog(in("none.rawlog"))); }),
              AllOf(HasSubstr(in("none.rawlog")), HasSubstr("cannot be read")));
  EXPECT_THAT(test::complaint([&] { LogReader(folder.string(), {}); }), HasSubstr("cannot be read"));
  EXPECT_THAT(test::complaint([&] { static_cast<void>(summarizeRawlog(write("zero.rawlog", ""))); }),
              HasSubstr("empty"));
  EXPECT_THAT(test::complaint([&] { static_cast<void>(summarizeRawlog(writeLog(in("no.rawlog"), {}))); }),
              HasSubstr("holds no observation"));
  EXPECT_THAT(test::complaint([&] {
                static_cast<void>(summarizeRawlog(write("text.rawlog", "this is no rawlog at all")));
              }),
              HasSubstr("text.rawlog: not a rawlog (no object of MRPT at its start)"));
}

TEST_F(SensorsTest, ALogIsLookedThroughNoFartherThanWanted) {
  const std::string path = writeLog(in("x.rawlog"), std::vector<Sample>(5, kScan));
  struct Enough {};
  std::vector<double> shares;
  const auto three = [&](double share) {
    shares.push_back(share);
    if (shares.size() == 3) throw Enough{};
  };
  EXPECT_THROW((void)summarizeRawlog(path, three), Enough);
  EXPECT_EQ(shares.size(), 3U);
  EXPECT_TRUE(std::is_sorted(shares.begin(), shares.end()));
  EXPECT_GT(shares.back(), 0);
}

TEST_F(SensorsTest, UnknownClassesAreErrors) {
  // An object of MRPT is: 0x80 + length of the name, name, version, data, 0x88.
  const std::string path = write("x.rawlog", std::string("\x87") + "CRocket" + '\0' + "\x88");
  EXPECT_THAT(test::complaint([&] { static_cast<void>(summarizeRawlog(path)); }),
              AllOf(HasSubstr(path), HasSubstr("CRocket"), HasSubstr("after 0 objects")));
}

TEST_F(SensorsTest, ATruncatedLogSaysWhereItEnds) {
  std::vector<Sample> samples;
  for (int i = 0; i < 500; ++i) {
    MotionSample motion = kMotion;
    motion.stamp_s += 0.01 * i;
    motion.speed_mps = std::sin(i);
    samples.emplace_back(motion);
  }
  const std::string path = writeLog(in("x.rawlog"), samples);
  fs::resize_file(path, fs::file_size(path) / 2);
  EXPECT_THAT(test::complaint([&] { static_cast<void>(summarizeRawlog(path)); }),
              AllOf(HasSubstr(path), HasSubstr("truncated"), HasSubstr("objects")));
  EXPECT_THAT(test::complaint([&] { static_cast<void>(readAll(path)); }), HasSubstr("truncated"));
}

// ---- Messages

class MessageReaderTest : public SensorsTest {
 protected:
  template <class... Objects>
  [[nodiscard]] std::string logOf(const LogHeader& header, const Objects&... objects) const {
    LogWriter writer(in("x.rawlog"), header, 0);
    (writer.write(objects), ...);
    writer.commit();
    return in("x.rawlog");
  }
  static mrpt::obs::CObservationRawDAQ daq(double stamp_s, const std::string& label,
                                           const std::vector<double>& values) {
    mrpt::obs::CObservationRawDAQ daq;
    daq.timestamp = toMrptStamp(stamp_s);
    daq.sensorLabel = label;
    daq.AIN_channel_count = static_cast<std::uint16_t>(values.size());
    daq.AIN_double = values;
    return daq;
  }
  /** Of each message "label/originals", and "/s" when it has a sample. */
  static std::vector<std::string> messagesOf(const std::string& path) {
    std::vector<std::string> messages;
    MessageReader reader(path);
    while (const auto message = reader.next())
      messages.push_back(message->label + "/" + std::to_string(message->originals.size()) +
                         (message->sample ? "/s" : ""));
    return messages;
  }
};

TEST_F(MessageReaderTest, TheHeaderIsKnownAtOnceAndIsNoMessage) {
  MessageReader reader(logOf({kOrigin, "[a]\nb = 1\n"}, Sample(kMotion)));
  ASSERT_TRUE(reader.header().origin);
  EXPECT_EQ(reader.header().origin->longitude_deg, kOrigin.longitude_deg);
  EXPECT_EQ(reader.origin()->height_m, kOrigin.height_m);
  EXPECT_EQ(reader.header().text, "[a]\nb = 1\n");
  EXPECT_EQ(reader.next()->label, "vehicle");
  EXPECT_FALSE(reader.next());
}

TEST_F(MessageReaderTest, AHeaderMayBeTextAlone) {
  MessageReader reader(logOf({std::nullopt, "// hello\n"}, Sample(kMotion)));
  EXPECT_FALSE(reader.header().origin);
  EXPECT_EQ(reader.header().text, "// hello\n");
  EXPECT_EQ(only<MotionSample>(readAll(in("x.rawlog"))).size(), 1U);
}

TEST_F(MessageReaderTest, AHeaderMayBeMissing) {
  {
    mrpt::io::CFileGZOutputStream file(in("none.rawlog"));
    mrpt::serialization::archiveFrom(file) << daq(1, "gate", {1, 2, 3});
  }
  MessageReader reader(in("none.rawlog"));
  EXPECT_FALSE(reader.header().origin);
  EXPECT_EQ(reader.header().text, "");
  EXPECT_EQ(reader.next()->label, "gate");
  EXPECT_FALSE(reader.next());
}

TEST_F(MessageReaderTest, WithoutAHeaderTheFirstFixIsTheOrigin) {
  MessageReader reader(logOf({}, *foreignFix(1, 0, {}), *foreignFix(2, 4, {})));
  EXPECT_FALSE(reader.next()->sample);  // no fix yet
  EXPECT_FALSE(reader.origin());
  const auto message = reader.next();
  ASSERT_TRUE(message->sample);
  EXPECT_LT(std::get<GpsFix>(*message->sample).p_map_antenna_m.norm(), 1e-6);
  EXPECT_EQ(reader.origin()->latitude_deg, 49);
  EXPECT_FALSE(reader.header().origin);
}

TEST_F(MessageReaderTest, AFixThatIsNotWantedIsTheOriginAllTheSame) {
  MessageReader reader(logOf({}, *foreignFix(1, 4, {})));
  EXPECT_FALSE(reader.next([](const LogMessage&) { return false; })->sample);
  EXPECT_TRUE(reader.origin());
}

TEST_F(MessageReaderTest, WhatNoSampleCanBeMadeOfIsPassedOn) {
  mrpt::obs::CObservationIMU imu;  // no values
  imu.sensorLabel = "imu";
  imu.timestamp = toMrptStamp(1);
  MotionSample nan = kMotion;
  nan.label = "nan";
  nan.speed_mps = NAN;
  mrpt::obs::CObservationOdometry no_stamp;
  no_stamp.sensorLabel = "no_stamp";
  no_stamp.hasVelocities = true;
  no_stamp.timestamp = INVALID_TIMESTAMP;
  mrpt::obs::CObservationComment second;
  second.text = "a log keeps only one";
  EXPECT_THAT(messagesOf(logOf({}, Sample(kMotion), imu, second, Sample(nan), no_stamp, Sample(kScan))),
              ElementsAre("vehicle/1/s", "imu/1", "nan/1", "no_stamp/1", "lidar_top/1/s"));
}

TEST_F(MessageReaderTest, SteeringIsJoinedToTheSpeedRightAfterIt) {
  const Sample v1 = MotionSample{1, "v", 10, 0};
  const Sample v2 = MotionSample{2, "v", 10, 0};
  const auto steering = daq(1, "v", {10, 0.1});
  EXPECT_THAT(messagesOf(logOf({}, steering, v1)), ElementsAre("v/2/s"));
  EXPECT_THAT(messagesOf(logOf({}, daq(1, "w", {10, 0.1}), v1)), ElementsAre("w/1", "v/1/s"));
  EXPECT_THAT(messagesOf(logOf({}, steering, v2)), ElementsAre("v/1", "v/1/s"));
  EXPECT_THAT(messagesOf(logOf({}, daq(1, "v", {10, 0.1, 0}), v1)), ElementsAre("v/1", "v/1/s"));
  EXPECT_THAT(messagesOf(logOf({}, steering, Sample(kScan), v1)),
              ElementsAre("v/1", "lidar_top/1/s", "v/1/s"));
  EXPECT_THAT(messagesOf(logOf({}, v1, steering)), ElementsAre("v/1/s", "v/1"));

  MessageReader reader(logOf({}, steering, daq(1, "v", {10, 0.2}), v1));
  EXPECT_EQ(reader.next()->originals.size(), 1U);
  EXPECT_EQ(std::get<MotionSample>(*reader.next()->sample).steering_rad, 0.2);
  EXPECT_FALSE(reader.next());
}

TEST_F(MessageReaderTest, BadLogsAreErrors) {
  EXPECT_THAT(test::complaint([&] { MessageReader reader(in("none.rawlog")); }), HasSubstr("cannot be read"));
  EXPECT_THAT(
      test::complaint([&] { MessageReader reader(write("text.rawlog", "this is no rawlog at all")); }),
      HasSubstr("not a rawlog"));
  const std::string path = writeLog(in("x.rawlog"), std::vector<Sample>(500, kScan));
  fs::resize_file(path, fs::file_size(path) / 2);
  EXPECT_THAT(test::complaint([&] { static_cast<void>(messagesOf(path)); }), HasSubstr("truncated"));
}

// ---- KITTI

/** A drive of three packets and two scans, with numbers that are easy to check by hand. */
class KittiTest : public SensorsTest {
 protected:
  void SetUp() override {
    SensorsTest::SetUp();
    write("day/calib_imu_to_velo.txt", "calib_time: x\nR: 1 0 0 0 1 0 0 0 1\nT: -0.8 0.3 -0.8\n");
    write("day/drive/oxts/timestamps.txt",
          "2011-09-26 13:10:50.000000000\n2011-09-26 13:10:50.100000000\n2011-09-26 13:10:50.200000000\n");
    // position modes: RTK fixed, none, differential; yaw 90 deg: facing north
    write("day/drive/oxts/data/0000000000.txt", packet(8.4, 4, 6));
    write("day/drive/oxts/data/0000000001.txt", packet(8.4, 4, 0));
    write("day/drive/oxts/data/0000000002.txt", packet(8.4, 1, 4));
    write("day/drive/velodyne_points/timestamps_start.txt", "2011-09-26 13:10:50.0\n2011-09-26 13:10:50.1\n");
    write("day/drive/velodyne_points/timestamps.txt", "2011-09-26 13:10:50.05\n2011-09-26 13:10:50.15\n");
    write("day/drive/velodyne_points/timestamps_end.txt", "2011-09-26 13:10:50.1\n2011-09-26 13:10:50.2\n");
    // ahead, left, behind-left, right
    const std::vector<float> points{10, 0, 0, 0.5F, 0, 10, 0, 0.25F, -10, 1e-3F, 0, 1, 0, -10, 0, 0};
    std::string bytes(points.size() * sizeof(float), '\0');
    std::memcpy(bytes.data(), points.data(), bytes.size());
    write("day/drive/velodyne_points/data/0000000000.bin", bytes);
    write("day/drive/velodyne_points/data/0000000001.bin", bytes);
    drive.folder = in("day/drive");
  }

  static std::string packet(double longitude_deg, int navstat, int posmode) {
    std::ostringstream line;
    line.precision(15);
    line << "49 " << longitude_deg << " 115 0 0 " << M_PI / 2
         << " 11 0 11 0 0 0 0 9.8 0 0 9.8 0.5 0.25 0.125 0 0 0 0.2 "
         << "0.03 " << navstat << " 8 " << posmode << " 4 0";
    return line.str();
  }
  ImportSummary import(const std::string& name = "x.rawlog") const {
    return importLog(drive, in(name), kQuiet);
  }
  [[nodiscard]] std::string refused() const {
    auto message = test::complaint([&] { static_cast<void>(import()); });
    EXPECT_THAT(rawlogsLeft(), IsEmpty());
    return message;
  }

  KittiRawDrive drive;
};

TEST_F(KittiTest, PointsThatAreNotFiniteAreLeftOut) {
  const std::vector<float> points{1, 2, 3, 0.5F, NAN, 0, 0, 0.25F, 4, INFINITY, 6, 0.75F, 7, 8, 9, 1};
  std::string bytes(points.size() * sizeof(float), '\0');
  std::memcpy(bytes.data(), points.data(), bytes.size());
  const Cloud cloud = readVelodyneBin(write("nan.bin", bytes));
  EXPECT_THAT(cloud.x, ElementsAre(1, 7));
  EXPECT_THAT(cloud.intensity, ElementsAre(0.5F, 1));
}

TEST_F(KittiTest, DevicesAndFrames) {
  const auto summary = import();
  EXPECT_EQ(summary.origin->latitude_deg, 49);
  ASSERT_EQ(summary.truth->poses.size(), 3U);
  // The car faces north: the body's origin is south, east and below of the IMU by the lever arm.
  const Pose& T_map_body = summary.truth->poses[0].T_map_body;
  EXPECT_NEAR(yawOf(T_map_body), M_PI / 2, 1e-9);
  EXPECT_LT((T_map_body.translation() - Eigen::Vector3d(0.32, -0.05, -0.63)).norm(), 1e-9);
  EXPECT_EQ(summary.truth->poses[0].stamp_s, 1317035450);  // 11:10:50 UTC

  const auto samples = readAll(in("x.rawlog"));
  const auto fixes = only<GpsFix>(samples);
  ASSERT_EQ(fixes.size(), 2U);  // the third packet's INS is not initialised
  EXPECT_EQ(fixes[0].label, "gps_oxts");
  EXPECT_EQ(fixes[0].fix_quality, 4);
  EXPECT_EQ(fixes[1].fix_quality, 6);
  EXPECT_LT(fixes[0].p_map_antenna_m.norm(), 1e-4);
  EXPECT_LT((fixes[0].p_body_antenna_m - drive.p_body_imu_m).norm(), 1e-12);
  EXPECT_NEAR(fixes[0].cov_map_m2(0, 0), 0.04, 1e-7);
  EXPECT_NEAR(fixes[0].cov_map_m2(2, 2), 0.09, 1e-7);

  const auto poses = only<InsPose>(samples);
  ASSERT_EQ(poses.size(), 2U);
  EXPECT_LT((poses[0].T_map_body.matrix() - T_map_body.matrix()).norm(), 1e-9);
  EXPECT_NEAR(poses[0].covariance(3, 3), 0.04, 1e-9);
  EXPECT_NEAR(poses[0].covariance(5, 5), 0.09, 1e-9);

  ASSERT_EQ(only<ImuSample>(samples).size(), 3U);
  EXPECT_LT((only<ImuSample>(samples)[0].gyro_body_rps - Eigen::Vector3d(0.5, 0.25, 0.125)).norm(), 1e-12);
  const auto motions = only<MotionSample>(samples);
  ASSERT_EQ(motions.size(), 3U);
  // v_body = v_imu - w x r, along x: 11 - (w_y r_z - w_z r_y)
  EXPECT_NEAR(motions[0].speed_mps, 11 - (0.25 * 0.63 - 0.125 * 0.32), 1e-12);
  EXPECT_EQ(motions[0].yaw_rate_rps, 0.125);
}

TEST_F(KittiTest, TimesFollowTheSweep) {
  drive.sweep = SweepDirection::counter_clockwise;
  static_cast<void>(import());
  const auto scans = only<Scan>(readAll(in("x.rawlog")));
  ASSERT_EQ(scans.size(), 2U);
  EXPECT_NEAR(scans[1].stamp_s, 1317035450.1, 1e-6);
  // p_velo = p_imu + T: the LiDAR is -T from the IMU
  EXPECT_LT((scans[0].T_body_lidar.translation() - Eigen::Vector3d(0.85, 0.02, 1.43)).norm(), 1e-9);
  EXPECT_THAT(scans[0].cloud.intensity, ElementsAre(0.5F, 0.25F, 1, 0));
  // half a turn to the front, three quarters to the left, all but behind, a quarter to the right
  constexpr double kStep = 0.5 / 131072 + 1e-6;
  const std::vector<double> share{0.5, 0.75, 1, 0.25};
  for (std::size_t i = 0; i < 4; ++i) EXPECT_NEAR(scans[0].time_s[i], 0.1 * share[i], kStep + 2e-6);

  drive.sweep = SweepDirection::clockwise;
  static_cast<void>(import("cw.rawlog"));
  const auto clockwise = only<Scan>(readAll(in("cw.rawlog")));
  for (std::size_t i = 0; i < 4; ++i) EXPECT_NEAR(clockwise[0].time_s[i], 0.1 * (1 - share[i]), kStep + 2e-6);

  drive.sweep = SweepDirection::none;
  static_cast<void>(import("none.rawlog"));
  EXPECT_THAT(only<Scan>(readAll(in("none.rawlog")))[0].time_s, IsEmpty());
}

TEST_F(KittiTest, NoiseIsAlikeOnFixAndPoseAndNotOnTheTruth) {
  const auto clean = import("clean.rawlog");
  drive.gps_noise = {10, 1};
  const auto noisy = import("noisy.rawlog");
  static_cast<void>(import("again.rawlog"));
  drive.gps_noise.seed = 2;
  static_cast<void>(import("other.rawlog"));
  const auto fixesOf = [&](const std::string& name) { return only<GpsFix>(readAll(in(name))); };
  const auto posesOf = [&](const std::string& name) { return only<InsPose>(readAll(in(name))); };
  for (std::size_t i = 0; i < 2; ++i) {
    const Eigen::Vector3d on_fix =
        fixesOf("noisy.rawlog")[i].p_map_antenna_m - fixesOf("clean.rawlog")[i].p_map_antenna_m;
    const Eigen::Vector3d on_pose = posesOf("noisy.rawlog")[i].T_map_body.translation() -
                                    posesOf("clean.rawlog")[i].T_map_body.translation();
    EXPECT_LT((on_fix - on_pose).norm(), 2e-4);  // the fix goes through degrees twice
    EXPECT_GT(on_fix.head<2>().norm(), 0.1);
    EXPECT_NEAR(on_fix.z(), 0, 2e-4);
    EXPECT_LT((fixesOf("noisy.rawlog")[i].cov_map_m2 - fixesOf("clean.rawlog")[i].cov_map_m2).norm(), 1e-6);
  }
  EXPECT_EQ(noisy.truth->poses[1].T_map_body.matrix(), clean.truth->poses[1].T_map_body.matrix());
  EXPECT_EQ(fixesOf("again.rawlog")[0].p_map_antenna_m, fixesOf("noisy.rawlog")[0].p_map_antenna_m);
  EXPECT_NE(fixesOf("other.rawlog")[0].p_map_antenna_m, fixesOf("noisy.rawlog")[0].p_map_antenna_m);
}

TEST_F(KittiTest, WhatIsWrongIsNamed) {
  const std::string scan = "day/drive/velodyne_points/data/0000000001.bin";
  write(scan, "short");
  EXPECT_THAT(refused(), AllOf(HasSubstr(in(scan)), HasSubstr("5 bytes")));
  fs::remove(in(scan));

  write("day/drive/oxts/data/0000000001.txt", "1 2 3");
  EXPECT_THAT(refused(), AllOf(HasSubstr("0000000001.txt"), HasSubstr("line 1"), HasSubstr("30 numbers")));
  write("day/drive/oxts/data/0000000001.txt", packet(8.4, 4, 4));

  write("day/drive/velodyne_points/timestamps_end.txt", "2011-09-26 13:10:50.1\nnoon\n");
  EXPECT_THAT(refused(), AllOf(HasSubstr("timestamps_end.txt"), HasSubstr("line 2"), HasSubstr("noon")));
  write("day/drive/velodyne_points/timestamps_end.txt", "");
  EXPECT_THAT(refused(), AllOf(HasSubstr("timestamps_end.txt"), HasSubstr("no line 1")));

  fs::remove(in("day/calib_imu_to_velo.txt"));
  write("day/drive/velodyne_points/timestamps_end.txt", "2011-09-26 13:10:50.1\n");
  EXPECT_THAT(refused(), HasSubstr("calib_imu_to_velo.txt"));

  fs::remove(in("day/drive/velodyne_points/data/0000000000.bin"));
  EXPECT_THAT(refused(), AllOf(HasSubstr("velodyne_points/data"), HasSubstr("no *.bin file")));

  drive.folder = in("nowhere");
  EXPECT_THAT(refused(), AllOf(HasSubstr(in("nowhere")), HasSubstr("no such folder")));
}

TEST_F(KittiTest, OdometryTruthIsTheBodysMotion) {
  // The camera looks ahead: its x is right, y down, z forward, and it sits where the LiDAR does.
  write("sequences/07/calib.txt", "P0: 0\nTr: 0 -1 0 0 0 0 -1 0 1 0 0 0\n");
  const std::string bin(16, '\0');
  write("sequences/07/velodyne/000010.bin", bin);
  write("sequences/07/velodyne/000011.bin", bin);
  // forward by 2 m, then with the car turned left by 90 deg (about the camera's -y)
  write("poses/07.txt", "1 0 0 0 0 1 0 0 0 0 1 0\n1 0 0 0 0 1 0 0 0 0 1 2\n0 0 -1 0 0 1 0 0 1 0 0 2\n");
  KittiOdometrySequence sequence;
  sequence.folder = in("sequences/07/");  // with a slash, as shells complete it
  const auto summary = importLog(sequence, in("x.rawlog"), kQuiet);
  ASSERT_EQ(summary.truth->poses.size(), 3U);
  EXPECT_FALSE(summary.truth->origin);
  EXPECT_LT((summary.truth->poses[0].T_map_body.matrix() - Eigen::Matrix4d::Identity()).norm(), 1e-12);
  EXPECT_LT((summary.truth->poses[1].T_map_body.translation() - Eigen::Vector3d(2, 0, 0)).norm(), 1e-12);
  const Pose& turned = summary.truth->poses[2].T_map_body;
  EXPECT_NEAR(yawOf(turned), M_PI / 2, 1e-12);
  // the LiDAR, 0.86 m ahead of the axle, stays at x = 2 + 0.86; the axle is now beside it
  EXPECT_LT((turned.translation() - Eigen::Vector3d(2.86, -0.86, 0)).norm(), 1e-12);
  const auto scans = only<Scan>(readAll(in("x.rawlog")));
  ASSERT_EQ(scans.size(), 2U);
  EXPECT_EQ(scans[0].stamp_s, summary.truth->poses[0].stamp_s);
  EXPECT_THAT(scans[0].time_s, IsEmpty());
}

TEST_F(SensorsTest, KittiDrive0013) {
  if (!fs::exists(kKittiDrive))
    GTEST_SKIP() << "needs the KITTI drive below build/data (shared/data/unpack_kitti.py)";
  KittiRawDrive drive;
  drive.folder = kKittiDrive.string();
  drive.decimation = {24, 0};
  const auto even = importLog(drive, in("even.rawlog"), kQuiet);
  drive.decimation = {24, 13};
  const auto odd = importLog(drive, in("odd.rawlog"), kQuiet);

  const auto scansOf = [](const ImportSummary& summary) {
    for (const auto& device : summary.devices)
      if (device.kind == "lidar") return device.count;
    return std::size_t{0};
  };
  EXPECT_EQ(scansOf(even), 144U / 24);
  EXPECT_EQ(scansOf(odd), 144U / 24);
  EXPECT_EQ(summarizeRawlog(in("even.rawlog")).origin->longitude_deg, 8.4378138518088);  // first packet
  EXPECT_EQ(summarizeRawlog(in("odd.rawlog")).origin->longitude_deg, 8.4378138518088);

  double length_m = 0;
  const auto& poses = even.truth->poses;
  for (std::size_t i = 1; i < poses.size(); ++i)
    length_m += (poses[i].T_map_body.translation() - poses[i - 1].T_map_body.translation()).norm();
  EXPECT_NEAR(length_m, 173, 1);  // as the data's README says

  LogOptions options;
  const auto samples = readAll(in("even.rawlog"), options);
  EXPECT_EQ(only<GpsFix>(samples).size(), 144U);
  std::size_t dead_reckoned = 0;
  for (const auto& fix : only<GpsFix>(samples)) dead_reckoned += fix.fix_quality == 6 ? 1 : 0;
  EXPECT_EQ(dead_reckoned, 15U);  // posmode 0 in 15 frames
  for (const auto& scan : only<Scan>(samples)) {
    EXPECT_GT(scan.cloud.size(), 100'000U);
    for (const float time_s : scan.time_s) ASSERT_TRUE(time_s >= 0 && time_s < 0.11F);
  }
  // wheel-like speed against the truth's own: distance over time
  const auto motions = only<MotionSample>(samples);
  double driven_m = 0;
  for (std::size_t i = 1; i < motions.size(); ++i)
    driven_m += 0.5 * (motions[i].speed_mps + motions[i - 1].speed_mps) *
                (motions[i].stamp_s - motions[i - 1].stamp_s);
  EXPECT_NEAR(driven_m, length_m, 0.01 * length_m);
}

// ---- PCD

class PcdTest : public SensorsTest {
 protected:
  static std::string header(const std::string& data, int points = 3) {
    return "# .PCD v0.7\nVERSION 0.7\nFIELDS x y z intensity t\nSIZE 4 4 4 4 4\nTYPE F F F F U\nCOUNT 1 1 1 "
           "1 1\nWIDTH " +
           std::to_string(points) + "\nHEIGHT 1\nVIEWPOINT 0 0 0 1 0 0 0\nPOINTS " + std::to_string(points) +
           "\nDATA " + data + "\n";
  }
  static std::string record(float x, float y, float z, float intensity, std::uint32_t t_ns) {
    std::string bytes(20, '\0');
    std::memcpy(&bytes[0], &x, 4);
    std::memcpy(&bytes[4], &y, 4);
    std::memcpy(&bytes[8], &z, 4);
    std::memcpy(&bytes[12], &intensity, 4);
    std::memcpy(&bytes[16], &t_ns, 4);
    return bytes;
  }
  static void expectPoints(const Scan& scan) {
    EXPECT_THAT(scan.cloud.x, ElementsAre(1, 4));
    EXPECT_THAT(scan.cloud.z, ElementsAre(3, -6));
    EXPECT_THAT(scan.cloud.intensity, ElementsAre(0.5F, 1));
    ASSERT_EQ(scan.time_s.size(), 2U);
    EXPECT_FLOAT_EQ(scan.time_s[0], 0);
    EXPECT_FLOAT_EQ(scan.time_s[1], 0.05F);
  }
};

TEST_F(PcdTest, AsciiAndBinaryAreTheSame) {
  const std::string ascii = header("ascii") + "1 2 3 50 1000\n nan nan nan 0 0\n4 5 -6 200 50001000\n";
  expectPoints(readPcd(write("a.pcd", ascii), 100));
  const std::string binary = header("binary") + record(1, 2, 3, 50, 1000) + record(NAN, NAN, NAN, 0, 0) +
                             record(4, 5, -6, 200, 50'001'000);
  expectPoints(readPcd(write("b.pcd", binary), 100));
}

TEST_F(PcdTest, DoublesBeyondTheFloatsAreLeftOut) {
  const std::string pcd =
      "FIELDS x y z\nSIZE 8 8 8\nTYPE F F F\nCOUNT 1 1 1\nPOINTS 2\nDATA ascii\n1 2 3\n1e300 0 0\n";
  EXPECT_THAT(readPcd(write("a.pcd", pcd), 1).cloud.x, ElementsAre(1));
}

TEST_F(PcdTest, WhatIsWrongIsNamed) {
  const auto refused = [&](const std::string& text) {
    const std::string path = write("x.pcd", text);
    auto message = test::complaint([&] { static_cast<void>(readPcd(path, 255)); });
    EXPECT_THAT(message, HasSubstr(path));
    return message;
  };
  EXPECT_THAT(refused(header("binary_compressed")), HasSubstr("binary_compressed"));
  EXPECT_THAT(refused(header("binary") + "short"), HasSubstr("truncated"));
  EXPECT_THAT(refused(header("ascii") + "1 2 3 4 5\n"), HasSubstr("truncated"));
  EXPECT_THAT(refused(header("ascii") + "1 2 3 4\n"), HasSubstr("5 values"));
  EXPECT_THAT(refused(header("ascii") + "1 2 x 4 5\n"), HasSubstr("not a number: x"));
  EXPECT_THAT(refused("hello\n"), HasSubstr("no DATA line"));
  EXPECT_THAT(refused("FIELDS x y\nPOINTS 0\nDATA ascii\n"), HasSubstr("no fields x, y and z"));
  EXPECT_THAT(refused("FIELDS x y z\nSIZE 4 4 3\nTYPE F F F\nPOINTS 0\nDATA ascii\n"), HasSubstr("F3"));
  EXPECT_THAT(refused("FIELDS x y z\nPOINTS -1\nDATA ascii\n"), HasSubstr("-1"));
}

TEST_F(PcdTest, NamesGiveTheStamps) {
  const std::string cloud = header("ascii", 1) + "1 2 3 50 0\n";
  const auto stampsOf = [&](const std::string& sub) {
    PcdFolder source;
    source.folder = in(sub);
    source.rate_hz = 20;
    static_cast<void>(importLog(source, in(sub + ".rawlog"), kQuiet));
    std::vector<double> stamps_s;
    for (const auto& scan : only<Scan>(readAll(in(sub + ".rawlog")))) stamps_s.push_back(scan.stamp_s);
    return stamps_s;
  };
  write("ns/1600000000250000000.pcd", cloud);
  write("ns/1600000000500000000.pcd", cloud);
  EXPECT_THAT(stampsOf("ns"), ElementsAre(1600000000.25, 1600000000.5));
  write("s/1600000000.25.pcd", cloud);
  write("s/1600000001.pcd", cloud);
  EXPECT_THAT(stampsOf("s"), ElementsAre(1600000000.25, 1600000001));
  write("numbers/000007.pcd", cloud);
  write("numbers/000008.pcd", cloud);
  EXPECT_THAT(stampsOf("numbers"), ElementsAre(0, 0.05));
  write("mixed/1600000000250000000.pcd", cloud);
  write("mixed/a.pcd", cloud);
  EXPECT_THAT(test::complaint([&] { stampsOf("mixed"); }), AllOf(HasSubstr("a.pcd"), HasSubstr("rename")));
}

TEST_F(PcdTest, PosesAreTheTruth) {
  write("scans/000001.pcd", header("ascii", 1) + "1 2 3 50 0\n");
  PcdFolder source;
  source.folder = in("scans");
  source.poses_path = write("truth.tum", "1 1 2 3 0 0 0 1\n2 4 5 6 0 0 0 1\n");
  const auto summary = importLog(source, in("x.rawlog"), kQuiet);
  ASSERT_EQ(summary.truth->poses.size(), 2U);
  EXPECT_EQ(summary.truth->poses[1].T_map_body.translation(), Eigen::Vector3d(4, 5, 6));
}

// ---- CSV

class CsvTest : public SensorsTest {
 protected:
  void SetUp() override {
    SensorsTest::SetUp();
    source.folder = folder.string();
    source.ini_path =
        write("map.ini",
              "[gps]\nfile = log.csv\nstamp = t\nlatitude = lat\nlongitude = lon\nsigma_m = 2\n"
              "[vehicle]\nfile = log.csv\nstamp = t\nspeed = kmh\nspeed_scale = 0.5\nsteering = wheel\n"
              "steering_ratio = 10\nwheelbase_m = 2.5\n");
  }
  [[nodiscard]] std::string refused(const std::string& csv) const {
    write("log.csv", csv);
    auto message = test::complaint([&] { static_cast<void>(importLog(source, in("x.rawlog"), kQuiet)); });
    EXPECT_THAT(rawlogsLeft(), IsEmpty());
    return message;
  }
  CsvLog source;
};

TEST_F(CsvTest, ColumnsBecomeSamples) {
  write("log.csv",
        "\xEF\xBB\xBFt,lat,lon,kmh,wheel\n1000,49,8.4,20,1\n1001,49,8.4,,1\n1002,49.00001,8.4,40,-1\n");
  const auto summary = importLog(source, in("x.rawlog"), kQuiet);
  EXPECT_EQ(summary.origin->latitude_deg, 49);
  EXPECT_THAT(summary.notes, Contains(HasSubstr("1 rows of log.csv not used for vehicle")));
  const auto samples = readAll(in("x.rawlog"));
  const auto fixes = only<GpsFix>(samples);
  ASSERT_EQ(fixes.size(), 3U);
  EXPECT_NEAR(fixes[2].p_map_antenna_m.y(), 1.112, 0.001);  // 1e-5 deg of latitude
  EXPECT_NEAR(fixes[0].cov_map_m2(0, 0), 4, 1e-6);
  const auto motions = only<MotionSample>(samples);
  ASSERT_EQ(motions.size(), 2U);
  EXPECT_EQ(motions[0].speed_mps, 10);
  EXPECT_NEAR(*motions[0].steering_rad, 0.1, 1e-15);
  EXPECT_NEAR(motions[0].yaw_rate_rps, 10 * std::tan(0.1) / 2.5, 1e-12);
}

TEST_F(CsvTest, WhatIsWrongIsNamed) {
  const std::string names = "t,lat,lon,kmh,wheel\n";
  EXPECT_THAT(refused(names + "1000,49,8.4,20,1\n1001,49,8.4,20\n"),
              AllOf(HasSubstr("log.csv, line 3"), HasSubstr("4 cells")));
  EXPECT_THAT(refused(names + "1000,49,8.4,fast,1\n"),
              AllOf(HasSubstr("line 2"), HasSubstr("not a number: fast")));
  EXPECT_THAT(refused(names + "1000,490,8.4,20,1\n"), AllOf(HasSubstr("line 2"), HasSubstr("out of range")));
  EXPECT_THAT(refused("t,latt,lon,kmh,wheel\n"),
              AllOf(HasSubstr("no column lat "), HasSubstr("did you mean latt?")));
  EXPECT_THAT(refused(""), HasSubstr("empty"));
  EXPECT_THAT(refused(names), HasSubstr("nothing to import"));
  fs::remove(in("log.csv"));
  EXPECT_THAT(test::complaint([&] { static_cast<void>(importLog(source, in("x.rawlog"), kQuiet)); }),
              AllOf(HasSubstr("log.csv"), HasSubstr("cannot be read")));
  write("map.ini", "[gps]\nfilee = log.csv\n");
  EXPECT_THAT(refused(names), HasSubstr("did you mean file?"));
}

TEST_F(SensorsTest, BarberTelemetry) {
  if (!fs::exists(kRecordings / "barber_gr86")) GTEST_SKIP() << "needs ../shared/data/barber_gr86";
  CsvLog source;
  source.ini_path = (kRoot / "ini/import_csv_barber.ini").string();
  source.folder = (kRecordings / "barber_gr86").string();
  static_cast<void>(importLog(source, in("x.rawlog"), kQuiet));
  const auto samples = readAll(in("x.rawlog"));
  const auto fixes = only<GpsFix>(samples);
  EXPECT_EQ(fixes.size(), 11'963U);  // rows of the file
  Eigen::AlignedBox3d track;
  for (const auto& fix : fixes) track.extend(fix.p_map_antenna_m);
  EXPECT_LT(track.sizes().head<2>().maxCoeff(), 1500);  // Barber is 3.7 km around and less than 1 km across
  EXPECT_GT(track.sizes().head<2>().minCoeff(), 300);
  for (const auto& motion : only<MotionSample>(samples)) {
    EXPECT_LT(motion.speed_mps, 70);
    EXPECT_LT(std::abs(*motion.steering_rad), 0.4);
  }
}

// ---- Velodyne captures and logs

TEST_F(SensorsTest, VelodyneCaptures) {
  if (!fs::exists(kRecordings / "sensors")) GTEST_SKIP() << "needs ../shared/data/sensors";
  VelodynePcap vlp16;
  vlp16.path = (kRecordings / "sensors/sample_velodyne_vlp16_gps.pcap").string();
  VelodynePcap hdl32;
  hdl32.path = (kRecordings / "sensors/sample_velodyne_hdl32.pcap").string();
  hdl32.model = VelodyneModel::hdl32;
  for (const auto& source : {vlp16, hdl32}) {
    SCOPED_TRACE(source.path);
    static_cast<void>(importLog(source, in("x.rawlog"), kQuiet));
    const auto samples = readAll(in("x.rawlog"));
    const auto scans = only<Scan>(samples);
    ASSERT_GE(scans.size(), 3U);
    for (std::size_t i = 1; i < scans.size(); ++i) {
      EXPECT_GT(scans[i].cloud.size(), 5'000U);
      EXPECT_NEAR(scans[i].stamp_s - scans[i - 1].stamp_s, 0.1,
                  0.07);  // 10 turns a second, the first one cut
      ASSERT_EQ(scans[i].time_s.size(), scans[i].cloud.size());
      for (const float time_s : scans[i].time_s) ASSERT_TRUE(time_s >= 0 && time_s < 0.12F);
    }
    // recorded on 2016-01-21 at 08:18:02 UTC, as its RMC messages say
    if (source.model == VelodyneModel::vlp16) {
      const auto fixes = only<GpsFix>(samples);
      ASSERT_GE(fixes.size(), 1U);
      EXPECT_NEAR(fixes[0].stamp_s, 1453364282, 1);
      EXPECT_NEAR(scans[0].stamp_s, 1453364282, 1);
    }
  }
}

TEST_F(SensorsTest, BadCapturesAreErrors) {
  VelodynePcap source;
  for (const std::string text : {"", "no capture"}) {
    source.path = write("x.pcap", text);
    EXPECT_THAT(test::complaint([&] { static_cast<void>(importLog(source, in("x.rawlog"), kQuiet)); }),
                AllOf(HasSubstr(source.path), HasSubstr("no classic")));
  }
  source.path = in("nowhere.pcap");
  EXPECT_THAT(test::complaint([&] { static_cast<void>(importLog(source, in("x.rawlog"), kQuiet)); }),
              HasSubstr("cannot be read"));
  EXPECT_THAT(rawlogsLeft(), IsEmpty());
}

TEST(RealLogs, VelodynePackets) {
  const auto path = kRecordings / "sensors/test_velodyne_VLP16.rawlog";
  if (!fs::exists(path)) GTEST_SKIP() << "needs ../shared/data/sensors";
  const auto scans = only<Scan>(readAll(path.string()));
  ASSERT_EQ(scans.size(), 1U);
  EXPECT_GT(scans[0].cloud.size(), 10'000U);
  for (const float ring : scans[0].ring) ASSERT_TRUE(ring >= 0 && ring < 16);
  for (const float time_s : scans[0].time_s) ASSERT_TRUE(time_s >= 0 && time_s < 0.12F);
}

TEST(RealLogs, RtkReceivers) {
  const auto path = kRecordings / "sensors/test_rtk_path.rawlog";
  if (!fs::exists(path)) GTEST_SKIP() << "needs ../shared/data/sensors";
  const auto fixes = only<GpsFix>(readAll(path.string()));
  ASSERT_GT(fixes.size(), 300U);
  // The two front antennas stay as far apart as their lever arms say. Horizontally, because the log's comment
  // states that their base stations disagree by 1.043 m in height, and by 5 mm otherwise.
  std::size_t pairs = 0;
  for (std::size_t i = 1; i < fixes.size(); ++i) {
    const auto& a = fixes[i - 1];
    const auto& b = fixes[i];
    const bool both_front = a.label != b.label && a.label.rfind("GPS_RTK_FRONT", 0) == 0 &&
                            b.label.rfind("GPS_RTK_FRONT", 0) == 0;
    if (!both_front || a.stamp_s != b.stamp_s || a.fix_quality != 4 || b.fix_quality != 4) continue;
    ++pairs;
    EXPECT_NEAR((a.p_map_antenna_m - b.p_map_antenna_m).head<2>().norm(),
                (a.p_body_antenna_m - b.p_body_antenna_m).head<2>().norm(),
                0.05);  // RTK: 1 cm each, and the 5 mm
  }
  EXPECT_GT(pairs, 50U);
}

}  // namespace
}  // namespace raceloc
