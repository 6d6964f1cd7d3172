/** \file
 * Sensors as they are in a car: a GPS behind a serial line (a pseudo terminal), a Velodyne's packets over UDP. */
#include <gmock/gmock.h>
#include <mrpt/obs/CObservationIMU.h>
#include <mrpt/obs/CObservationPointCloud.h>

#include <algorithm>
#include <filesystem>

#include "core/errors.h"
#include "sensors/black_box.h"
#include "sensors/foreign_logs.h"
#include "sensors/live_source.h"
#include "sensors/rawlog.h"
#include "sensors/sensor_drivers.h"
#include "sensors/velodyne_pcap.h"
#include "support/files.h"
#include "support/run_command.h"
#include "support/sensors.h"
#include "support/wait.h"

namespace raceloc {
namespace {

using namespace test;
using namespace std::chrono_literals;
using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Pair;

const std::string kRecordings = RACELOC_ROOT "/../shared/data/sensors/";
const GeodeticPoint kOrigin{48.982, 8.3904, 164.4};

/** Every number in a sample, in a fixed order. */
std::vector<double> numbersOf(const Sample& sample) {
  std::vector<double> all{stampOf(sample), static_cast<double>(sample.index())};
  const auto add = [&](const auto& matrix) {
    for (Eigen::Index i = 0; i < matrix.size(); ++i) all.push_back(matrix.data()[i]);
  };
  const auto addAll = [&](const std::vector<float>& values) {
    all.insert(all.end(), values.begin(), values.end());
  };
  if (const auto* fix = std::get_if<GpsFix>(&sample)) {
    add(fix->p_map_antenna_m);
    add(fix->cov_map_m2);
    add(fix->p_body_antenna_m);
    all.push_back(fix->fix_quality);
  }
  if (const auto* scan = std::get_if<Scan>(&sample)) {
    add(scan->T_body_lidar.matrix());
    for (const auto* values :
         {&scan->cloud.x, &scan->cloud.y, &scan->cloud.z, &scan->cloud.intensity, &scan->time_s, &scan->ring})
      addAll(*values);
  }
  return all;
}

class SensorsLive : public ::testing::Test {
 protected:
  TemporaryFolder folder;
  QuietDrivers quiet;

  [[nodiscard]] std::string sensorsIni(const std::string& text) const {
    writeFile(folder / "sensors.ini", text);
    return folder / "sensors.ini";
  }
  [[nodiscard]] std::string refusal(const std::string& text) const {
    try {
      (void)openSensors(sensorsIni(text));
    } catch (const InputError& e) {
      return e.what();
    }
    return "accepted";
  }
};

std::string gpsSection(const std::string& label, const std::string& port) {
  return "[" + label + "]\ndriver = CGPSInterface\nsensorLabel = " + label + "\nCOM_port_LIN = " + port +
         "\nbaudRate = 115200\npose_x = 1.5\npose_z = 0.9\n";
}

/** Takes until `enough`; false when that never comes. */
template <class Enough>
bool takeUntil(LiveSource& source, std::vector<Arrival>& taken, const Enough& enough) {
  return comesTrue([&] {
    while (auto arrival = source.next(0ms)) taken.push_back(std::move(arrival));
    return enough();
  });
}

TEST_F(SensorsLive, GpsAndLidarAreRecordedAsTheyCameAndReadBackBitForBit) {
  const std::string pcap = kRecordings + "sample_velodyne_vlp16_gps.pcap";
  if (!std::filesystem::exists(pcap)) GTEST_SKIP() << "no recordings beside the checkout";
  const SerialLine line;
  const int data_port = freeUdpPort(), position_port = freeUdpPort();
  auto sensors = openSensors(
      sensorsIni(gpsSection("gps_left", line.port()) +
                 "[lidar]\ndriver = CVelodyneScanner\nsensorLabel = lidar_top\nmodel = VLP16\n"
                 "pose_z = 1.2\ndata_port = " +
                 std::to_string(data_port) + "\nposition_port = " + std::to_string(position_port) + "\n"));
  EXPECT_THAT(sensors.gps_labels, ElementsAre("gps_left"));
  const LogHeader header = withGpsLabels({kOrigin, ""}, sensors.gps_labels);
  constexpr std::size_t kMost = 1000;
  LiveSource source(std::move(sensors.feeds), kMost);
  EXPECT_THAT(source.health(), ElementsAre(Pair("gps_left", ::testing::_), Pair("lidar_top", ::testing::_)));

  std::vector<Arrival> taken;
  const auto came = [&](const std::string& label) { return source.health()[label].came; };
  line.send("GPRMC,120000.00,A,4858.92,N,00823.424,E,10.0,90.0,280325,,,A");
  line.send("GPGGA,120000.00,4858.92,N,00823.424,E,4,12,0.8,116.4,M,48.0,M,,");
  line.send("GPGGA,120000.05,4858.93,N,00823.424,E,4,12,0.8,116.4,M,48.0,M,,");
  ASSERT_TRUE(takeUntil(source, taken, [&] { return came("gps_left") == 2; }));
  VelodyneReplay packets(pcap);
  packets.sendAll(data_port, position_port);
  VelodynePcap capture;
  capture.path = pcap;
  const ImportSummary imported = importLog(capture, folder / "imported.rawlog", [](double) {});
  const auto sweeps = std::find_if(imported.devices.begin(), imported.devices.end(),
                                   [](const auto& device) { return device.kind == "lidar"; });
  ASSERT_NE(sweeps, imported.devices.end());
  ASSERT_TRUE(takeUntil(source, taken, [&] { return came("lidar_top") >= sweeps->count; }));
  source.stop();
  ASSERT_TRUE(takeUntil(source, taken, [&] { return source.isAtEnd(); }));
  EXPECT_EQ(came("lidar_top"), sweeps->count);
  EXPECT_THAT(source.dropped(), IsEmpty());

  // What was taken goes to the black box and to a reader, as in a run.
  {
    BlackBox box(folder / "box.rawlog", header);
    for (const Arrival& arrival : taken) box.write(arrival);
    box.commit();
    EXPECT_EQ(box.written(), taken.size());
  }
  auto next = taken.begin();
  LogReader live([&] { return next == taken.end() ? nullptr : *next++; }, {}, kOrigin, header);
  LogReader recorded(folder / "box.rawlog", {}, kOrigin);
  std::size_t fixes = 0, scans = 0;
  for (;;) {
    const auto a = live.next(), b = recorded.next();
    ASSERT_EQ(a.has_value(), b.has_value());
    if (!a) break;
    EXPECT_EQ(labelOf(*a), labelOf(*b));
    EXPECT_EQ(numbersOf(*a), numbersOf(*b));
    if (const auto* scan = std::get_if<Scan>(&*a)) {
      ++scans;
      EXPECT_EQ(scan->label, "lidar_top");
      EXPECT_DOUBLE_EQ(scan->T_body_lidar.translation().z(), static_cast<double>(1.2F));
    }
    if (const auto* fix = std::get_if<GpsFix>(&*a)) {
      ++fixes;
      EXPECT_EQ(fix->label, "gps_left");
      EXPECT_LT(fix->p_map_antenna_m.head<2>().norm(), 20);  // a hundredth of a minute is 18.5 m
      EXPECT_NEAR(fix->p_map_antenna_m.z(), 0, 1e-3);
      EXPECT_DOUBLE_EQ(fix->p_body_antenna_m.x(), 1.5);
    }
  }
  // The capture's clock is years away from the receiver's: what does not fit in is counted.
  std::size_t left_out = 0;
  for (const auto& [label, times] : live.leftOut()) left_out += times;
  EXPECT_EQ(fixes + scans + live.droppedLate() + left_out, 2 + sweeps->count);
  EXPECT_EQ(live.droppedLate(), recorded.droppedLate());
  const LogSummary summary = summarizeRawlog(folder / "box.rawlog");
  EXPECT_THAT(summary.gps_labels, ElementsAre("gps_left"));
}

TEST_F(SensorsLive, TheCarsOwnElectronicsSpeakInDatagrams) {
  const int port = freeUdpPort();
  LiveSource source(
      openSensors(sensorsIni("[car]\ndriver = VehicleDatagrams\nsensorLabel = vehicle\nport = " +
                             std::to_string(port) + "\n"))
          .feeds,
      100);
  const UdpSocket car;
  for (const std::string text : {"1743163200.01 70.5 0.25 -0.03", "what?", "1743163200.02 70.75 0.5\n"})
    car.send({text.begin(), text.end()}, port);
  std::vector<Arrival> taken;
  ASSERT_TRUE(takeUntil(source, taken, [&] { return source.health()["vehicle"].came == 2; }));
  auto next = taken.begin();
  LogReader reader([&] { return next == taken.end() ? nullptr : *next++; }, {}, kOrigin, {});
  const auto first = reader.next(), second = reader.next();
  ASSERT_TRUE(first && second && !reader.next());
  const auto &a = std::get<MotionSample>(*first), &b = std::get<MotionSample>(*second);
  EXPECT_DOUBLE_EQ(a.stamp_s, 1743163200.01);
  EXPECT_EQ(a.speed_mps, 70.5);
  EXPECT_EQ(a.yaw_rate_rps, 0.25);
  EXPECT_EQ(a.steering_rad, -0.03);
  EXPECT_EQ(b.speed_mps, 70.75);
  EXPECT_FALSE(b.steering_rad);
}

TEST_F(SensorsLive, ASensorThatFallsSilentOrIsUnpluggedIsNamed) {
  auto line = std::make_unique<SerialLine>();
  LiveSource source(openSensors(sensorsIni(gpsSection("gps_left", line->port()))).feeds, 10);
  std::vector<Arrival> taken;
  line->send("GPGGA,120000.00,4858.92,N,00823.424,E,4,12,0.8,116.4,M,48.0,M,,");
  ASSERT_TRUE(takeUntil(source, taken, [&] { return source.health()["gps_left"].came == 1; }));
  const auto last = source.health()["gps_left"].last;
  line.reset();
  ASSERT_TRUE(takeUntil(source, taken, [&] { return !source.health()["gps_left"].trouble.empty(); }));
  EXPECT_EQ(source.health()["gps_left"].last, last);
  EXPECT_FALSE(source.isAtEnd());
}

TEST_F(SensorsLive, BadSectionsAreRefusedInOneLine) {
  const SerialLine line;
  const std::string good = gpsSection("gps_left", line.port());
  EXPECT_THAT(refusal("[global]\nrawlog_prefix = x\n"), HasSubstr("no sensor in it"));
  EXPECT_THAT(
      refusal("[a]\ndriver = CGPSInterfce\nsensorLabel = a\n"),
      AllOf(HasSubstr("section [a]"), HasSubstr("CGPSInterfce"), HasSubstr("did you mean CGPSInterface")));
  EXPECT_THAT(refusal("[a]\nsensorLabel = a\n"), AllOf(HasSubstr("section [a]"), HasSubstr("no driver")));
  EXPECT_THAT(refusal("[a]\ndriver = CGPSInterface\n"), HasSubstr("no sensorLabel"));
  EXPECT_THAT(refusal("[a]\ndriver = CGPSInterface\nsensorLabel = left one\n"), HasSubstr("one word"));
  EXPECT_THAT(refusal("[a]\ndriver = CGPSInterface\nsensorLabel = a\n"), HasSubstr("no COM_port_LIN"));
  EXPECT_THAT(refusal(gpsSection("a", "/dev/nowhere")),
              AllOf(HasSubstr("/dev/nowhere cannot be opened"), HasSubstr("No such file")));
  EXPECT_THAT(refusal("[a]\ndriver = CGPSInterface\nsensorLabel = a\nCOM_port_LIN = " + line.port() + "\n"),
              AllOf(HasSubstr("CGPSInterface cannot be opened"), HasSubstr("baudRate")));
  EXPECT_THAT(refusal(good + gpsSection("b", line.port()) + "[c]\ndriver = CGPSInterface\nsensorLabel = b\n"),
              HasSubstr("another sensor's"));
  EXPECT_THAT(refusal(good + "process_rate = often\n"), HasSubstr("process_rate = often"));
  const std::string port = "\ndata_port = " + std::to_string(freeUdpPort()) + "\n";
  const std::string velodyne = "driver = CVelodyneScanner\nmodel = VLP16";
  EXPECT_THAT(
      refusal("[a]\nsensorLabel = a\n" + velodyne + port + "[b]\nsensorLabel = b\n" + velodyne + port),
      AllOf(HasSubstr("section [b]"), HasSubstr("in use")));
}

/** A feed that hands out its observations at once. */
Feed feedOf(std::vector<Arrival> all) {
  return {"", [all = std::move(all)](std::vector<Arrival>& arrivals) -> std::optional<SteadyTime> {
            arrivals = all;
            return std::nullopt;
          }};
}

template <class Observation>
Arrival observation(const std::string& label) {
  auto o = std::make_shared<Observation>();
  o->sensorLabel = label;
  return o;
}

TEST_F(SensorsLive, TheOldestScanGoesFirstWhenNobodyTakes) {
  using mrpt::obs::CObservationIMU;
  using mrpt::obs::CObservationPointCloud;
  const std::vector<Arrival> all{
      observation<CObservationIMU>("imu_1"),         observation<CObservationPointCloud>("scan_1"),
      observation<CObservationPointCloud>("scan_2"), observation<CObservationIMU>("imu_2"),
      observation<CObservationIMU>("imu_3"),         observation<CObservationIMU>("imu_4"),
      observation<CObservationIMU>("imu_5")};
  LiveSource source({feedOf(all)}, 4);
  ASSERT_TRUE(comesTrue([&] { return source.dropped().size() == 3; }));
  EXPECT_THAT(source.dropped(), ElementsAre(Pair("imu_1", 1), Pair("scan_1", 1), Pair("scan_2", 1)));
  std::vector<std::string> left;
  while (!source.isAtEnd())
    if (const auto arrival = source.next(10ms)) left.push_back(arrival->sensorLabel);
  EXPECT_THAT(left, ElementsAre("imu_2", "imu_3", "imu_4", "imu_5"));
}

TEST_F(SensorsLive, AFeedThatCannotGoOnEndsTheRun) {
  LiveSource source(
      {Feed{"", [](std::vector<Arrival>&) -> std::optional<SteadyTime> { throw InputError("cut"); }}}, 4);
  std::vector<Arrival> taken;
  EXPECT_THROW((void)takeUntil(source, taken, [] { return false; }), InputError);
}

}  // namespace
}  // namespace raceloc
