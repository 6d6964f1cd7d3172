#pragma once

#include "core/types.h"
#include "fusion/fusion_types.h"
#include "odometry/motion_history.h"

namespace raceloc {

/** The plane's part of a motion of the body, for the fusion filter: on a bank neither speed nor yaw rate are the body's
 * own. What the calibration does not know yet, it says.
 * \param history  that tells the motion; of an instant that it does not cover nothing is said to be unknown
 * \param T_map_from, T_map_to  of the body, `duration_s` > 0 before `stamp_s`, and then */
[[nodiscard]] Control planarControl(const MotionHistory& history, double stamp_s, double duration_s,
                                    const Pose& T_map_from, const Pose& T_map_to);

}  // namespace raceloc
