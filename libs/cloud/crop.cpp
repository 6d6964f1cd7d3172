#include "cloud/crop.h"

#include <cmath>

namespace raceloc {

void CropOptions::describe(OptionList& keys) {
  keys.add("min_range_m", min_range_m, atLeast(0), "nearer returns are dropped [m]");
  keys.add("max_range_m", max_range_m, above(0), "farther returns are dropped [m]");
  keys.add("own_car_front_m", own_car_front_m, atLeast(0), "box of the own car, ahead of the rear axle [m]");
  keys.add("own_car_rear_m", own_car_rear_m, atLeast(0), "box of the own car, behind the rear axle [m]");
  keys.add("own_car_half_width_m", own_car_half_width_m, atLeast(0), "box of the own car, to each side [m]");
}

bool isInside(const Eigen::Vector3f& p_lidar_m, const Eigen::Vector3f& p_body_m, const CropOptions& o) {
  const double range_m = p_lidar_m.cast<double>().norm();
  if (!(range_m >= o.min_range_m && range_m <= o.max_range_m)) return false;  // NaN too
  const bool own_car = p_body_m.x() > -o.own_car_rear_m && p_body_m.x() < o.own_car_front_m &&
                       std::abs(p_body_m.y()) < o.own_car_half_width_m;
  return !own_car;
}

}  // namespace raceloc
