/** \file
 * The part of a scan that is worth matching. */
#pragma once

#include <raceloc/gpu/deskew.h>

#include "core/options.h"

namespace raceloc {

/** Section [crop]. Ranges are from the sensor, the box of the own car is in the body frame. */
struct CropOptions {
  double min_range_m = 3.0;
  double max_range_m = 100.0;
  double own_car_front_m = 4.5;
  double own_car_rear_m = 1.5;
  double own_car_half_width_m = 1.2;
  void describe(OptionList& keys);
  [[nodiscard]] gpu::Crop forKernels() const;
};

}  // namespace raceloc
