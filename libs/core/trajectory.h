/** \file
 * Trajectories and their exchange format: one line per pose, `stamp x y z qx qy qz qw` (TUM). */
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "core/types.h"

namespace raceloc {

struct StampedPose {
  double stamp_s;
  Pose T_map_body;
};

/** Poses in order of time, all in one map frame. */
struct Trajectory {
  std::optional<GeodeticPoint> origin;  ///< of the map frame, when known
  std::vector<StampedPose> poses;
};

/** Writes microseconds and 0.1 mm exactly; the origin goes into a comment line, which other TUM readers skip.
 * \throws InputError if the file cannot be written. */
void writeTum(const std::string& path, const Trajectory& trajectory);

/** \throws InputError naming file and line for: unreadable or empty file, a line without eight numbers,
 * stamps that do not increase, a quaternion off unit length by more than 1e-3. */
[[nodiscard]] Trajectory readTum(const std::string& path);

}  // namespace raceloc
