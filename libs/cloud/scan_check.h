/** \file
 * Scans that say less than they should, or something else. */
#pragma once

#include <optional>

#include "core/samples.h"

namespace raceloc {

/** Whether all points lie on one cone about the sensor's axis (within 0.3 deg), as those of a single laser do:
 * height, roll and pitch cannot be seen in them. Of fewer than 20 points nothing is said. */
[[nodiscard]] bool isOneRing(const Scan& scan);

/** Whether there is ground where it should be, below the body's origin (the rear axle) and about level with the car:
 * flat cells of 1 m, within 15 m. None when too little is near to tell. A LiDAR whose place on the car is wrong
 * (upside down, on its side, metres too high) shows walls and no ground, or the ground above the car. */
[[nodiscard]] std::optional<bool> showsGround(const Scan& scan);
[[nodiscard]] std::optional<bool> showsGround(const Cloud& cloud, const Pose& T_body_cloud);

}  // namespace raceloc
