#pragma once

#include <string>

namespace raceloc {

/** A device of a log or car. */
struct DeviceName {
  std::string label;
  std::string kind;  ///< `lidar`, `gps`, `imu` or `vehicle`
};

}  // namespace raceloc
