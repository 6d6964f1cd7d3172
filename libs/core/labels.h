/** \file
 * Sensor labels and the patterns that choose among them. */
#pragma once

#include <string>

namespace raceloc {

/** Whether `label` matches a shell pattern (`gps_*`, `lidar_?`), or one of several separated by blanks or
 * commas. */
[[nodiscard]] bool matchesLabel(const std::string& patterns, const std::string& label);

}  // namespace raceloc
