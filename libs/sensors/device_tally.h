/** \file
 * What a log holds, device by device. */
#pragma once

#include <cstddef>
#include <map>
#include <string>
#include <utility>
#include <vector>

#include "core/samples.h"

namespace raceloc {

struct DeviceSummary {
  std::string label;  ///< of an INS pose: its receiver's label, without `_pose`
  std::string kind;   ///< lidar gps ins_pose imu vehicle other
  std::size_t count;
  double first_s, last_s;
  double max_gap_s;  ///< longest time between two samples, in the order of the file
};

/** Counts samples by label and kind. */
class DeviceTally {
 public:
  void add(const std::string& label, const std::string& kind, double stamp_s);
  void add(const Sample& sample);
  [[nodiscard]] std::vector<DeviceSummary> devices() const;  ///< in order of kind, then label

 private:
  struct Counted {
    DeviceSummary summary;
    double newest_s;
  };
  std::map<std::pair<std::string, std::string>, Counted> x_devices;
};

/** A table for people: one line a device, with its rate. */
[[nodiscard]] std::string toText(const std::vector<DeviceSummary>& devices);

}  // namespace raceloc
