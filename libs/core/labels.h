/** \file
 * Sensor labels and the patterns that choose among them. */
#pragma once

#include <string>
#include <vector>

namespace raceloc {

/** Whether `label` matches a shell pattern (`gps_*`, `lidar_?`), or one of several separated by blanks or
 * commas. */
[[nodiscard]] bool matchesLabel(const std::string& patterns, const std::string& label);

/** Those of the patterns that match none of `labels`: slips of the pen, or devices that are not there. */
[[nodiscard]] std::vector<std::string> unmatchedPatterns(const std::string& patterns,
                                                         const std::vector<std::string>& labels);

/** Those of the patterns that are labels, without wildcards: devices that someone counts on. */
[[nodiscard]] std::vector<std::string> labelsNamed(const std::string& patterns);

}  // namespace raceloc
