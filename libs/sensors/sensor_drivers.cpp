#include "sensors/sensor_drivers.h"

#include <fcntl.h>
#include <mrpt/config/CConfigFileMemory.h>
#include <mrpt/hwdrivers/CGenericSensor.h>
#include <mrpt/hwdrivers/CVelodyneScanner.h>
#include <mrpt/hwdrivers/registerAllClasses.h>
#include <mrpt/maps/registerAllClasses.h>
#include <mrpt/obs/CObservationGPS.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <charconv>
#include <cstdint>
#include <cstring>
#include <iostream>
#include <map>
#include <mutex>
#include <optional>
#include <set>
#include <system_error>
#include <utility>

#include "core/errors.h"
#include "core/options.h"
#include "sensors/mrpt_message.h"
#include "sensors/sample_conversion.h"
#include "sensors/vehicle_datagrams.h"

namespace raceloc {

namespace {

using mrpt::hwdrivers::CGenericSensor;
using mrpt::hwdrivers::CVelodyneScanner;
using mrpt::obs::CObservation;
using mrpt::obs::CObservationGPS;

constexpr char kGps[] = "CGPSInterface", kVelodyne[] = "CVelodyneScanner", kVehicle[] = "VehicleDatagrams";

constexpr int kHighestPort = 65535;

/** Drivers whose observations hold samples, for suggestions only. */
const std::vector<std::string> kUsual{kGps, "CGPS_NTRIP", kVelodyne, "CIMUXSens_MT4", kVehicle};

/** One section of the file. */
struct Section {
  std::string ini_path, name;
  std::map<std::string, std::string> keys;

  [[nodiscard]] InputError bad(const std::string& what) const {
    return InputError("sensors " + ini_path + ", section [" + name + "]: " + what);
  }
  [[nodiscard]] std::string require(const std::string& key) const {
    const auto found = keys.find(key);
    if (found == keys.end() || found->second.empty())
      throw bad("no " + key + " in it; add " + key + " = ...");
    return found->second;
  }
  template <class Number>
  [[nodiscard]] Number number(const std::string& key, Number without, Number low, Number high) const {
    const auto found = keys.find(key);
    if (found == keys.end()) return without;
    Number value{};
    const char* end = found->second.data() + found->second.size();
    const auto [stop, error] = std::from_chars(found->second.data(), end, value);
    if (error != std::errc() || stop != end || !(value >= low && value <= high))
      throw bad(key + " = " + found->second + ", but it must be a number, " + std::to_string(low) + " .. " +
                std::to_string(high));
    return value;
  }
  [[nodiscard]] mrpt::config::CConfigFileMemory config() const {
    mrpt::config::CConfigFileMemory config;
    for (const auto& [key, value] : keys) config.write(name, key, value);
    return config;
  }
};

/** The driver says no more than that it cannot; the system says why. */
void requireSerialPort(const Section& section) {
  const std::string port = section.require("COM_port_LIN");
  const std::string path = port.front() == '/' ? port : "/dev/" + port;
  const int file = ::open(path.c_str(), O_RDWR | O_NOCTTY | O_NONBLOCK | O_CLOEXEC);
  if (file < 0)
    throw section.bad("COM_port_LIN = " + port + " cannot be opened (" + std::strerror(errno) +
                      "); check the cable, the name and the rights");
  ::close(file);
}

/** MRPT has two variables for the ports of all LiDARs, and reads them when it opens the sockets. */
class VelodynePorts {
 public:
  explicit VelodynePorts(const Section& section)
      : x_data(CVelodyneScanner::VELODYNE_DATA_UDP_PORT),
        x_position(CVelodyneScanner::VELODYNE_POSITION_UDP_PORT) {
    const int data = section.number<int>("data_port", x_data, 1, kHighestPort);
    const int position = section.number<int>("position_port", x_position, 1, kHighestPort);
    CVelodyneScanner::VELODYNE_DATA_UDP_PORT = static_cast<std::int16_t>(data);
    CVelodyneScanner::VELODYNE_POSITION_UDP_PORT = static_cast<std::int16_t>(position);
  }
  ~VelodynePorts() {
    CVelodyneScanner::VELODYNE_DATA_UDP_PORT = x_data;
    CVelodyneScanner::VELODYNE_POSITION_UDP_PORT = x_position;
  }
  VelodynePorts(const VelodynePorts&) = delete;
  VelodynePorts& operator=(const VelodynePorts&) = delete;

 private:
  std::int16_t x_data, x_position;
};

InputError cannotOpen(const Section& section, const std::string& driver, const std::exception& e) {
  return section.bad(driver + " cannot be opened (" + mrptMessage(e.what()) +
                     "); check its keys and the device");
}

CGenericSensor::Ptr opened(const Section& section) {
  const std::string driver = section.require("driver");
  auto sensor = CGenericSensor::createSensorPtr(driver);
  if (!sensor) {
    const std::string near = nearestName(driver, kUsual);
    throw section.bad("driver = " + driver + ", but MRPT has no driver of this name" +
                      (near.empty() ? "; " + listed(kUsual) + " are usual" : "; did you mean " + near + "?"));
  }
  if (driver == kGps) requireSerialPort(section);
  try {
    sensor->loadConfig(section.config(), section.name);
    const VelodynePorts ports(section);
    sensor->initialize();
  } catch (const InputError&) {
    throw;
  } catch (const std::exception& e) {
    throw cannotOpen(section, driver, e);
  }
  try {
    sensor->doProcess();  // some open their device only here
  } catch (const std::exception& e) {
    throw cannotOpen(section, driver, e);
  }
  return sensor;
}

/** Whether a rawlog with it can be read back. */
bool isReadable(const CObservation& observation) {
  using namespace mrpt::obs::gnss;
  const auto* gps = dynamic_cast<const CObservationGPS*>(&observation);
  return gps == nullptr || std::none_of(gps->messages.begin(), gps->messages.end(), [](const auto& message) {
           return message.first == NV_OEM6_GENERIC_FRAME || message.first == NV_OEM6_GENERIC_SHORT_FRAME ||
                  message.first == NV_OEM6_INSCOVS;
         });
}

Feed driverFeed(const Section& section) {
  const std::string label = section.require("sensorLabel");
  const std::string driver = section.require("driver");
  constexpr double kUsualRate_hz = 200, kHighest_hz = 1e5;
  const double rate_hz =
      section.number("process_rate", driver == kVelodyne ? kHighest_hz : kUsualRate_hz, 0.01, kHighest_hz);
  const std::chrono::duration<double> period(1 / rate_hz);
  // MRPT keeps the date of the last RMC in one variable for all receivers: they take turns.
  static std::mutex gps_turn;
  const auto poll = [sensor = opened(section), label, period,
                     is_gps = driver == kGps](std::vector<Arrival>& arrivals) -> std::optional<SteadyTime> {
    const auto begin = std::chrono::steady_clock::now();
    {
      std::unique_lock turn(gps_turn, std::defer_lock);
      if (is_gps) turn.lock();
      sensor->doProcess();
    }
    for (const auto& [stamp, object] : sensor->getObservations()) {
      auto observation = std::dynamic_pointer_cast<CObservation>(object);
      if (!observation || !isReadable(*observation)) continue;
      if (deviceOf(*observation).kind != "other") observation->sensorLabel = label;
      arrivals.push_back(std::move(observation));
    }
    return begin + std::chrono::duration_cast<SteadyTime::duration>(period);
  };
  return {label, poll};
}

Feed vehicleFeed(const Section& section) {
  constexpr int kNone = 0;
  const int port = section.number("port", kNone, 1, kHighestPort);
  if (port == kNone) throw section.bad("no port in it; add port = ...");
  try {
    return vehicleDatagrams(section.require("sensorLabel"), port);
  } catch (const std::system_error& e) {
    throw section.bad("port = " + std::to_string(port) + " cannot be opened (" + e.code().message() + ")");
  }
}

}  // namespace

OpenSensors openSensors(const std::string& ini_path) {
  mrpt::maps::registerAllClasses_mrpt_maps();
  mrpt::hwdrivers::registerAllClasses_mrpt_hwdrivers();
  IniFile ini(ini_path);
  OpenSensors sensors;
  std::set<std::string> labels;
  for (const std::string& name : ini.sections()) {
    const auto pairs = ini.pairs(name);
    if (name == "global") continue;
    const Section section{ini_path, name, {pairs.begin(), pairs.end()}};
    const std::string label = section.require("sensorLabel");
    if (label.find_first_of(" \t,") != std::string::npos)
      throw section.bad("sensorLabel = " + label + ", but it must be one word");
    if (!labels.insert(label).second)
      throw section.bad("sensorLabel = " + label + " is another sensor's; give each its own");
    const std::string driver = section.require("driver");
    sensors.feeds.push_back(driver == kVehicle ? vehicleFeed(section) : driverFeed(section));
    if (driver == kGps) sensors.gps_labels.push_back(label);
  }
  if (sensors.feeds.empty())
    throw InputError("sensors " + ini_path + ": no sensor in it; add a section with driver = ...");
  return sensors;
}

QuietDrivers::QuietDrivers() : x_before(std::cerr.rdbuf(nullptr)) {}

QuietDrivers::~QuietDrivers() {
  std::cerr.rdbuf(x_before);
  std::cerr.clear();
}

}  // namespace raceloc
