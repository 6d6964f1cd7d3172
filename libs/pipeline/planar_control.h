#pragma once

#include "core/types.h"
#include "fusion/fusion_types.h"

namespace raceloc {

/** The plane's part of a motion of the body, for the fusion filter: on a bank neither speed nor yaw rate are the body's
 * own. \param T_map_from, T_map_to  of the body, `duration_s` > 0 before `stamp_s`, and then */
[[nodiscard]] Control planarControl(double stamp_s, double duration_s, const Pose& T_map_from,
                                    const Pose& T_map_to);

}  // namespace raceloc
