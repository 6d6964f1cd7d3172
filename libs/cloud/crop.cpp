#include "cloud/crop.h"

namespace raceloc {

void CropOptions::describe(OptionList& keys) {
  keys.add("min_range_m", min_range_m, atLeast(0), "nearer returns are dropped [m]");
  keys.add("max_range_m", max_range_m, above(0), "farther returns are dropped [m]");
  keys.add("own_car_front_m", own_car_front_m, atLeast(0), "box of the own car, ahead of the rear axle [m]");
  keys.add("own_car_rear_m", own_car_rear_m, atLeast(0), "box of the own car, behind the rear axle [m]");
  keys.add("own_car_half_width_m", own_car_half_width_m, atLeast(0), "box of the own car, to each side [m]");
}

gpu::Crop CropOptions::forKernels() const {
  const auto f = [](double x) { return static_cast<float>(x); };
  return {f(min_range_m), f(max_range_m), f(own_car_front_m), f(own_car_rear_m), f(own_car_half_width_m)};
}

}  // namespace raceloc
