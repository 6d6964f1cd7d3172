#include "pipeline/planar_control.h"

#include <cmath>

namespace raceloc {

Control planarControl(double stamp_s, double duration_s, const Pose& T_map_from, const Pose& T_map_to) {
  constexpr double kStanding_mps = 0.5;  // slower, the way is too short to have a direction
  const double from_rad = yawOf(T_map_from), turn_rad = wrapAngle(yawOf(T_map_to) - from_rad);
  const Eigen::Vector2d moved_m = Eigen::Rotation2Dd(-(from_rad + 0.5 * turn_rad)) *
                                  (T_map_to.translation() - T_map_from.translation()).head<2>();
  Control control{stamp_s, moved_m.x() / duration_s, turn_rad / duration_s};
  if (control.speed_mps > kStanding_mps) {
    control.speed_mps = moved_m.norm() / duration_s;
    control.slip_rad = std::atan2(moved_m.y(), moved_m.x());
  }
  return control;
}

}  // namespace raceloc
