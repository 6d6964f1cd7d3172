/** \file
 * Lines that a simulated car is told, as they lie about it. */
#pragma once

#include <Eigen/Core>

#include "core/types.h"
#include "sim/path_tracker.h"
#include "track/racing_line.h"
#include "track/track.h"
#include "wall/wall_path.h"

namespace raceloc {

/** A line of the circuit in the frame of a car that is, or believes to be, at (x, y, theta) on the road; empty when that
 * is not near the road. The road must be level along its centre line: it leans to the side only. */
[[nodiscard]] Path linePath(const Track& track, const RacingLine& line, const Eigen::Vector3d& x_y_theta,
                            double ahead_m);

/** A path as it lies about a car. \param path  at least one point \param up_body  in the car's axes */
[[nodiscard]] PathAhead aheadOn(const Path& path, const Pose& T_path_body, double speed_mps,
                                const Eigen::Vector3d& up_body);

}  // namespace raceloc
