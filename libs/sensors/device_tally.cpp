#include "sensors/device_tally.h"

#include <algorithm>
#include <cstdio>

namespace raceloc {

namespace {

const char* kindOf(const GpsFix& /*sample*/) { return "gps"; }
const char* kindOf(const InsPose& /*sample*/) { return "ins_pose"; }
const char* kindOf(const ImuSample& /*sample*/) { return "imu"; }
const char* kindOf(const MotionSample& /*sample*/) { return "vehicle"; }
const char* kindOf(const Scan& /*sample*/) { return "lidar"; }

}  // namespace

void DeviceTally::add(const std::string& label, const std::string& kind, double stamp_s) {
  const auto [entry, is_new] =
      x_devices.try_emplace({kind, label}, Counted{{label, kind, 0, stamp_s, stamp_s, 0}, stamp_s});
  auto& [device, newest_s] = entry->second;
  ++device.count;
  if (is_new) return;
  device.first_s = std::min(device.first_s, stamp_s);
  device.last_s = std::max(device.last_s, stamp_s);
  device.max_gap_s = std::max(device.max_gap_s, stamp_s - newest_s);
  newest_s = std::max(newest_s, stamp_s);
}

void DeviceTally::add(const Sample& sample) {
  std::visit([this](const auto& s) { add(s.label, kindOf(s), s.stamp_s); }, sample);
}

std::vector<DeviceSummary> DeviceTally::devices() const {
  std::vector<DeviceSummary> found;
  found.reserve(x_devices.size());
  for (const auto& device : x_devices) found.push_back(device.second.summary);
  return found;
}

std::string toText(const std::vector<DeviceSummary>& devices) {
  std::string text = "  kind      label             samples   rate Hz   span s   longest gap s\n";
  for (const auto& d : devices) {
    const double span_s = d.last_s - d.first_s;
    const double rate_hz = span_s > 0 ? static_cast<double>(d.count - 1) / span_s : 0;
    char line[160];
    std::snprintf(line, sizeof line, "  %-9s %-16s %8zu %9.2f %8.2f %15.3f\n", d.kind.c_str(),
                  d.label.c_str(), d.count, rate_hz, span_s, d.max_gap_s);
    text += line;
  }
  return text;
}

}  // namespace raceloc
