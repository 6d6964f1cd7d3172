#include "sensors/velodyne_pcap.h"

#include <mrpt/config/CConfigFileMemory.h>
#include <mrpt/hwdrivers/CVelodyneScanner.h>
#include <mrpt/maps/registerAllClasses.h>

#include <array>
#include <cmath>
#include <cstdint>
#include <fstream>
#include <utility>

#include "core/errors.h"
#include "sensors/gps_conversion.h"
#include "sensors/lidar_conversion.h"
#include "sensors/mrpt_stamp.h"
#include "sensors/pose_conversion.h"

namespace raceloc {

namespace {

using mrpt::obs::CObservationGPS;
using mrpt::obs::CObservationVelodyneScan;
using mrpt::obs::gnss::Message_NMEA_RMC;

constexpr double kHour_s = 3600;
constexpr std::uint32_t kDataRecordBytes = 1206 + 42;  // payload, and its Ethernet, IP and UDP headers

InputError badPcap(const std::string& path, const std::string& what) {
  return InputError("pcap " + path + ": " + what);
}

/** When the first data packet was captured. Source: pcap-savefile(5). */
double firstCaptureStamp(const std::string& path) {
  std::ifstream in(path, std::ios::binary);
  if (!in) throw badPcap(path, "cannot be read; check the path");
  std::array<std::uint32_t, 6> file_header{};
  in.read(reinterpret_cast<char*>(file_header.data()), sizeof file_header);
  const std::uint32_t magic = file_header[0];
  if (!in || (magic != 0xa1b2c3d4 && magic != 0xa1b23c4d))
    throw badPcap(path, "no classic little-endian pcap; convert it with editcap -F pcap");
  std::array<std::uint32_t, 4> record{};  // seconds, fraction, stored bytes, bytes on the wire
  while (in.read(reinterpret_cast<char*>(record.data()), sizeof record)) {
    if (record[2] == kDataRecordBytes) return record[0] + record[1] * (magic == 0xa1b2c3d4 ? 1e-6 : 1e-9);
    in.seekg(record[2], std::ios::cur);
  }
  throw badPcap(path, "no Velodyne data packet in it");
}

std::string nameOf(VelodyneModel model) {
  switch (model) {
    case VelodyneModel::hdl32:
      return "HDL32";
    case VelodyneModel::hdl64:
      return "HDL64";
    default:
      return "VLP16";
  }
}

/** One pass through the capture. */
class Capture {
 public:
  explicit Capture(const VelodynePcap& source) : x_path(source.path) {
    std::string text = "[v]\nmodel = " + nameOf(source.model) + "\npcap_input = " + source.path +
                       "\npcap_read_once = true\npcap_read_fast = true\n";
    if (!source.calibration_path.empty()) text += "calibration_file = " + source.calibration_path + "\n";
    x_driver.setPCAPVerbosity(false);
    try {
      x_driver.loadConfig(mrpt::config::CConfigFileMemory(text), "v");
      x_driver.initialize();
    } catch (const std::exception&) {
      throw badPcap(
          x_path, "MRPT's Velodyne driver refuses it; check the capture, the model " + nameOf(source.model) +
                      " and the calibration file" +
                      (source.calibration_path.empty() ? " (none given)" : " " + source.calibration_path));
    }
  }

  /** Each call takes one packet and may complete a sweep or a GPS message. False at the end. */
  bool next(CObservationVelodyneScan::Ptr& sweep, CObservationGPS::Ptr& gps) {
    sweep.reset();
    gps.reset();
    return x_driver.getNextObservation(sweep, gps);
  }

 private:
  std::string x_path;
  mrpt::hwdrivers::CVelodyneScanner x_driver;
};

double deviceClock(const CObservationVelodyneScan& sweep) {
  return sweep.scan_packets.front().gps_timestamp() * 1e-6;
}

/** What the LiDAR's clock (seconds within an hour) lacks to UTC, and how many sweeps there are. */
struct ClockOffset {
  double offset_s = 0;
  bool by_satellites = false;
  std::size_t sweeps = 0;
};

ClockOffset measureClock(const VelodynePcap& source) {
  ClockOffset clock;
  const double captured_s = firstCaptureStamp(source.path);
  Capture capture(source);
  CObservationVelodyneScan::Ptr sweep;
  CObservationGPS::Ptr gps;
  while (capture.next(sweep, gps)) {
    if (!sweep || sweep->scan_packets.empty()) continue;
    if (clock.sweeps++ == 0) clock.offset_s = captured_s - deviceClock(*sweep);
    if (!sweep->has_satellite_timestamp || clock.by_satellites) continue;
    clock.offset_s = fromMrptStamp(sweep->timestamp) - deviceClock(*sweep);
    clock.by_satellites = true;
  }
  return clock;
}

std::optional<GpsFix> gpsFix(const CObservationGPS& gps, const VelodynePcap& source,
                             std::optional<GeodeticPoint>& origin) {
  if (!gps.hasMsgClass<Message_NMEA_RMC>()) return std::nullopt;
  const auto& rmc = gps.getMsgByClass<Message_NMEA_RMC>().fields;
  if (rmc.validity_char != 'A') return std::nullopt;
  const GeodeticPoint position{rmc.latitude_degrees, rmc.longitude_degrees, source.height_m};
  if (!origin) origin = position;
  const Eigen::Vector3d variances_m2(2.5 * 2.5, 2.5 * 2.5, 100.0 * 100.0);
  return GpsFix{fromMrptStamp(gps.timestamp), source.gps_label,        toMap(position, *origin),
                variances_m2.asDiagonal(),    Eigen::Vector3d::Zero(), 1};
}

}  // namespace

ImportSummary importLog(const VelodynePcap& source, const std::string& log_path, const ShareDone& done) {
  mrpt::maps::registerAllClasses_mrpt_maps();
  const ClockOffset clock = measureClock(source);
  if (clock.sweeps == 0)
    throw badPcap(source.path, "no whole sweep in it; check the model " + nameOf(source.model));

  ImportSummary summary;
  summary.notes.emplace_back(clock.by_satellites ? "stamps are satellite time"
                                                 : "no satellite time: stamps are the time of capture");
  summary.notes.emplace_back("the sweep that the end of the capture cuts is dropped");

  // The header comes first in a log and needs the origin, so the few GPS packets are read ahead.
  std::vector<GpsFix> fixes;
  CObservationVelodyneScan::Ptr sweep;
  CObservationGPS::Ptr gps;
  for (Capture capture(source); capture.next(sweep, gps);)
    if (gps)
      if (auto fix = gpsFix(*gps, source, summary.origin)) fixes.push_back(std::move(*fix));

  ImportLog log(log_path, {summary.origin, "// imported from a Velodyne packet capture\n"});
  auto next_fix = fixes.begin();
  std::size_t number = 0;
  double last_s = 0;
  for (Capture capture(source); capture.next(sweep, gps);) {
    if (!sweep || sweep->scan_packets.empty()) continue;
    if (!sweep->has_satellite_timestamp) {
      double stamp_s = clock.offset_s + deviceClock(*sweep);
      if (number > 0)
        stamp_s += kHour_s * std::round((last_s - stamp_s) / kHour_s);  // its clock restarts each hour
      sweep->timestamp = toMrptStamp(stamp_s);
    }
    last_s = fromMrptStamp(sweep->timestamp);
    for (; next_fix != fixes.end() && next_fix->stamp_s <= last_s; ++next_fix) log.write(*next_fix);
    if (source.decimation.keeps(number++)) {
      sweep->sensorLabel = source.label;
      sweep->sensorPose = toMrpt(source.T_body_lidar);
      log.write(*scanFromObservation(*sweep));
    }
    done(static_cast<double>(number) / static_cast<double>(clock.sweeps));
  }
  for (; next_fix != fixes.end(); ++next_fix) log.write(*next_fix);
  summary.devices = log.commit();
  return summary;
}

}  // namespace raceloc
