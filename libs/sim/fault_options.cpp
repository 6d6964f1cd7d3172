#include "sim/fault_options.h"

#include <algorithm>
#include <utility>

#include "core/labels.h"

namespace raceloc {

namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();

struct KindRow {
  FaultKind kind;
  const char* name;
  const char* device;  ///< DeviceName::kind; empty: any
  const char* meaning;
};

constexpr KindRow kKinds[] = {
    {FaultKind::gps_noise, "gps_noise", "gps", "white noise on each axis of the position"},
    {FaultKind::gps_step, "gps_step", "gps", "the position is beside the true one by a fixed step"},
    {FaultKind::gps_ramp, "gps_ramp", "gps", "the position drifts away at a steady rate"},
    {FaultKind::gps_vibration, "gps_vibration", "gps", "the position drifts to the car's left in left turns"},
    {FaultKind::gps_outage, "gps_outage", "gps", "no fix and no INS pose"},
    {FaultKind::gps_frozen, "gps_frozen", "gps", "fix and INS pose repeat, their stamps go on"},
    {FaultKind::gps_covariance, "gps_covariance", "gps",
     "the claimed position covariance is not the true one"},
    {FaultKind::gps_rtk_flapping, "gps_rtk_flapping", "gps", "RTK float and fixed in turn, float first"},
    {FaultKind::gps_heading_flip, "gps_heading_flip", "gps", "INS heading and course are turned by 180 deg"},
    {FaultKind::message_late, "message_late", "", "messages arrive late"},
    {FaultKind::message_duplicated, "message_duplicated", "", "messages arrive twice"},
    {FaultKind::message_shuffled, "message_shuffled", "", "messages arrive late by chance, so out of order"},
    {FaultKind::stamp_jump, "stamp_jump", "", "the device's clock jumps, and jumps back at the end"},
    {FaultKind::lidar_off, "lidar_off", "lidar", "no scan"},
    {FaultKind::lidar_thinned, "lidar_thinned", "lidar", "some points are lost, by chance"},
    {FaultKind::lidar_spray, "lidar_spray", "lidar", "some points, by chance, are drops on their rays"},
    {FaultKind::lidar_sector_blocked, "lidar_sector_blocked", "lidar", "no points in a sector"},
    {FaultKind::lidar_times_scaled, "lidar_times_scaled", "lidar", "the times of the points are wrong"},
    {FaultKind::lidar_times_reversed, "lidar_times_reversed", "lidar", "the sweep's times run backwards"},
    {FaultKind::lidar_times_absent, "lidar_times_absent", "lidar", "the points have no times"},
    {FaultKind::lidar_nan, "lidar_nan", "lidar", "some points, by chance, are not numbers"},
    {FaultKind::lidar_ground_only, "lidar_ground_only", "lidar", "no points above the ground"},
    {FaultKind::imu_bias_step, "imu_bias_step", "imu", "gyro and accelerometer have one more bias"},
    {FaultKind::imu_frozen, "imu_frozen", "imu", "the sample repeats, its stamp goes on"},
    {FaultKind::imu_saturated, "imu_saturated", "imu", "each axis ends at a limit"},
    {FaultKind::wheel_lock, "wheel_lock", "vehicle", "the speed is 0"},
    {FaultKind::wheel_spin, "wheel_spin", "vehicle", "the speed is too high by a factor"},
    {FaultKind::vehicle_frozen, "vehicle_frozen", "vehicle", "the sample repeats, its stamp goes on"},
    {FaultKind::steering_offset, "steering_offset", "vehicle",
     "the steering angle, where there is one, is off"},
};

const KindRow& rowOf(FaultKind kind) {
  return *std::find_if(std::begin(kKinds), std::end(kKinds),
                       [&](const auto& row) { return row.kind == kind; });
}

Range anyNumber() { return {-kInfinity, kInfinity}; }

std::vector<std::string> kindNames() {
  std::vector<std::string> names;
  for (const auto& row : kKinds) names.emplace_back(row.name);
  return names;
}

/** The kind decides which keys the section has, so it is read before them. */
FaultKind readKind(IniFile& ini, const std::string& section) {
  const std::string where = "ini " + ini.path() + ", section [" + section + "]: ";
  for (const auto& pair : ini.pairs(section)) {
    if (pair.first != "kind") continue;
    for (const auto& row : kKinds)
      if (pair.second == row.name) return row.kind;
    const std::string nearest = nearestName(pair.second, kindNames());
    throw InputError(where + "kind = " + pair.second + " is no kind of fault" +
                     (nearest.empty() ? "" : "; did you mean " + nearest + "?") +
                     " (known: " + listed(kindNames()) + ")");
  }
  throw InputError(where + "no key kind; it says what goes wrong (known: " + listed(kindNames()) + ")");
}

/** "to_s = 5", spelled as its key. */
std::string valueOf(const Fault& fault, const std::string& key) {
  const std::string text = "\n" + iniText(fault.section, fault);
  const auto begin = text.find("\n" + key + " = ") + 1;
  return text.substr(begin, text.find('\n', begin) - begin);
}

/** What no single key shows. */
void requireOrder(const Fault& fault, const std::string& ini_path) {
  const auto refuse = [&](const std::string& key, const std::string& than, const std::string& rule) {
    throw InputError("ini " + ini_path + ", section [" + fault.section + "]: " + valueOf(fault, key) +
                     ", but it must " + rule + " " + valueOf(fault, than));
  };
  if (fault.end_s() <= fault.from_s) refuse("to_s", "from_s", "be 0 (to the end of the log) or later than");
  if (fault.kind == FaultKind::lidar_spray && fault.max_m < fault.min_m)
    refuse("max_m", "min_m", "not be below");
  if (fault.kind == FaultKind::lidar_sector_blocked && fault.sector_from_deg == fault.sector_to_deg)
    refuse("sector_to_deg", "sector_from_deg", "differ from");
}

std::string shownName(const std::string& device_kind) {
  if (device_kind == "gps") return "GPS";
  if (device_kind == "imu") return "IMU";
  if (device_kind == "lidar") return "LiDAR";
  return device_kind.empty() ? "device" : device_kind;
}

}  // namespace

const std::vector<FaultKind>& faultKinds() {
  static const std::vector<FaultKind> kinds = [] {
    std::vector<FaultKind> all;
    for (const auto& row : kKinds) all.push_back(row.kind);
    return all;
  }();
  return kinds;
}

std::string nameOf(FaultKind kind) { return rowOf(kind).name; }

void Fault::describe(OptionList& keys) {
  keys.add("kind", kind, {{nameOf(kind), kind}}, rowOf(kind).meaning);
  keys.add("labels", labels, "devices: shell patterns, separated by blanks");
  keys.add("from_s", from_s, atLeast(0), "stamps since the start of the log from here [s] ...");
  keys.add("to_s", to_s, atLeast(0), "... to before here [s]; 0: to the end of the log");
  switch (kind) {
    case FaultKind::gps_noise:
      keys.add("sigma_m", sigma_m, atLeast(0), "standard deviation on each of east, north and up [m]");
      keys.add("shared", shared, "whether all these receivers have the same error at the same time");
      break;
    case FaultKind::gps_step:
      keys.add("east_m", east_m, between(-1e6, 1e6), "step [m]");
      keys.add("north_m", north_m, between(-1e6, 1e6), "step [m]");
      keys.add("up_m", up_m, between(-1e6, 1e6), "step [m]");
      break;
    case FaultKind::gps_ramp:
      keys.add("rate_mps", rate_mps, atLeast(0), "drift [m/s], from nothing at from_s");
      keys.add("direction_deg", direction_deg, between(-360, 360),
               "of the drift, east is 0, north is 90 [deg]");
      break;
    case FaultKind::gps_vibration:
      keys.add("gain_m_per_mps2", gain_m_per_mps2, anyNumber(),
               "error to the left for each m/s^2 of speed times yaw rate [s^2]");
      keys.add("time_constant_s", time_constant_s, above(0), "of the first-order lag of the error [s]");
      break;
    case FaultKind::gps_covariance:
      keys.add("claimed_sigma_m", claimed_sigma_m, atLeast(0),
               "claimed on each axis [m]; 0: zero covariance");
      break;
    case FaultKind::gps_rtk_flapping:
      keys.add("period_s", period_s, between(0.001, 3600),
               "in float for this long, then fixed for as long [s]");
      keys.add("float_sigma_m", float_sigma_m, atLeast(0),
               "of the error on each axis [m], which lasts as long as its float");
      break;
    case FaultKind::message_late:
      keys.add("delay_s", delay_s, between(0, 10), "later arrival [s]");
      break;
    case FaultKind::message_duplicated:
      keys.add("again_after_s", again_after_s, between(0, 10), "second arrival after the first [s]");
      break;
    case FaultKind::message_shuffled:
      keys.add("window_s", window_s, between(0, 10), "later arrival, uniformly up to this [s]");
      break;
    case FaultKind::stamp_jump:
      keys.add("jump_s", jump_s, between(-1e8, 1e8), "added to the stamps [s]");
      break;
    case FaultKind::lidar_thinned:
      keys.add("lost_share", lost_share, between(0, 1), "of the points");
      break;
    case FaultKind::lidar_spray:
      keys.add("spray_share", spray_share, between(0, 1), "of the points");
      keys.add("min_m", min_m, above(0), "drops are at a uniform range from this [m] ...");
      keys.add("max_m", max_m, above(0), "... to this [m]");
      break;
    case FaultKind::lidar_sector_blocked:
      keys.add("sector_from_deg", sector_from_deg, between(-180, 180),
               "azimuth in the LiDAR's frame, counter-clockwise from here [deg] ...");
      keys.add("sector_to_deg", sector_to_deg, between(-180, 180),
               "... to here [deg], over the back if less");
      break;
    case FaultKind::lidar_times_scaled:
      keys.add("time_factor", time_factor, between(0, 100), "times the true time since the sweep's start");
      break;
    case FaultKind::lidar_nan:
      keys.add("nan_share", nan_share, between(0, 1), "of the points");
      break;
    case FaultKind::lidar_ground_only:
      keys.add("height_m", height_m, anyNumber(), "points below this stay, above the rear axle's centre [m]");
      break;
    case FaultKind::imu_bias_step:
      keys.add("gyro_x_dps", gyro_x_dps, anyNumber(), "about the body's x, forward [deg/s]");
      keys.add("gyro_y_dps", gyro_y_dps, anyNumber(), "about y, left [deg/s]");
      keys.add("gyro_z_dps", gyro_z_dps, anyNumber(), "about z, up [deg/s]");
      keys.add("accelerometer_x_mps2", accelerometer_x_mps2, anyNumber(), "along x [m/s^2]");
      keys.add("accelerometer_y_mps2", accelerometer_y_mps2, anyNumber(), "along y [m/s^2]");
      keys.add("accelerometer_z_mps2", accelerometer_z_mps2, anyNumber(), "along z [m/s^2]");
      break;
    case FaultKind::imu_saturated:
      keys.add("gyro_limit_dps", gyro_limit_dps, atLeast(0), "largest turn rate either way [deg/s]");
      keys.add("accelerometer_limit_mps2", accelerometer_limit_mps2, atLeast(0),
               "largest specific force either way, 9.81 is upright at rest [m/s^2]");
      break;
    case FaultKind::wheel_spin:
      keys.add("spin_factor", spin_factor, atLeast(0), "times the true speed");
      break;
    case FaultKind::steering_offset:
      keys.add("offset_deg", offset_deg, between(-180, 180),
               "added to the angle of the road wheels, left [deg]");
      break;
    case FaultKind::gps_outage:
    case FaultKind::gps_frozen:
    case FaultKind::gps_heading_flip:
    case FaultKind::lidar_off:
    case FaultKind::lidar_times_reversed:
    case FaultKind::lidar_times_absent:
    case FaultKind::imu_frozen:
    case FaultKind::wheel_lock:
    case FaultKind::vehicle_frozen:
      break;
  }
}

std::vector<Fault> readFaults(const std::string& ini_path) {
  IniFile ini(ini_path);
  std::vector<Fault> faults;
  for (const auto& section : ini.sections("fault_")) {
    Fault fault;
    fault.section = section;
    fault.kind = readKind(ini, section);
    ini.load(section, fault);
    requireOrder(fault, ini_path);
    faults.push_back(std::move(fault));
  }
  if (faults.empty())
    throw InputError("ini " + ini_path +
                     ": no section [fault_...] in it (sections: " + listed(ini.sections()) + ")");
  ini.rejectUnknownSections();
  return faults;
}

std::string iniText(const std::vector<Fault>& faults) {
  std::string text;
  for (const auto& fault : faults) text += (text.empty() ? "" : "\n") + iniText(fault.section, fault);
  return text;
}

void requireDevices(const std::vector<Fault>& faults, const std::string& ini_path,
                    const std::vector<DeviceName>& devices) {
  const bool knows_motion = std::any_of(devices.begin(), devices.end(),
                                        [](const auto& device) { return device.kind == "vehicle"; });
  for (const auto& fault : faults) {
    if (fault.kind == FaultKind::gps_vibration && !knows_motion)
      throw InputError("faults " + ini_path + ", section [" + fault.section +
                       "]: kind = gps_vibration, but it needs the car's speed and yaw rate, and there is no "
                       "vehicle device");
    const std::string wanted = rowOf(fault.kind).device;
    std::vector<std::string> labels;
    for (const auto& device : devices)
      if (wanted.empty() || device.kind == wanted) labels.push_back(device.label);
    const auto unmatched = unmatchedPatterns(fault.labels, labels);
    if (!unmatched.empty() || fault.labels.empty())
      throw InputError("faults " + ini_path + ", section [" + fault.section + "]: labels = " + fault.labels +
                       ", but no " + shownName(wanted) + " is called " +
                       (unmatched.empty() ? "so" : listed(unmatched)) + " (" + shownName(wanted) +
                       " labels: " + listed(labels) + ")");
  }
}

}  // namespace raceloc
