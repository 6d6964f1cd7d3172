/** \file
 * The part of a scan that is worth matching. */
#pragma once

#include "core/options.h"
#include "core/types.h"

namespace raceloc {

/** Section [crop]. */
struct CropOptions {
  double min_range_m = 3.0;
  double max_range_m = 100.0;
  double own_car_front_m = 4.5;
  double own_car_rear_m = 1.5;
  double own_car_half_width_m = 1.2;
  void describe(OptionList& keys);
};

/** Whether a point is kept. Range is from the sensor, the box of the own car is in the body frame; a point that is not
 * finite is out.
 * \param p_lidar_m the point as the sensor gave it
 * \param p_body_m  the same point in the body frame */
[[nodiscard]] bool isInside(const Eigen::Vector3f& p_lidar_m, const Eigen::Vector3f& p_body_m,
                            const CropOptions& options);

}  // namespace raceloc
