/** \file
 * A car whose wheels say what it does: no drag, no slip. */
#pragma once

#include "odometry/motion_history.h"

namespace raceloc::test {

inline MotionOptions plainMotion() {
  MotionOptions o;
  o.drag_per_m = o.downforce_per_m = 0;
  return o;
}
inline CalibrationOptions plainCalibration() {
  CalibrationOptions o;
  o.sideslip_deg_per_mps2 = o.traction_per_mps2 = 0;
  return o;
}

}  // namespace raceloc::test
