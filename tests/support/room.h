/** \file
 * A street with a floor, walls and posts, as points: a scene in which every direction is fixed. */
#pragma once

#include "core/types.h"
#include "support/forall.h"

namespace raceloc::test {

/** Points (map frame) with `sigma_m` of noise on each axis, within 40 m of the origin along x. */
inline Cloud street(Random& rnd, double sigma_m, int points = 20000) {
  Cloud cloud;
  for (int i = 0; i < points; ++i) {
    Eigen::Vector3d p;
    switch (rnd.integer(0, 4)) {
      case 0:
        p = {rnd.uniform(-40, 40), rnd.uniform(-8, 8), 0};
        break;
      case 1:
        p = {rnd.uniform(-40, 40), 8, rnd.uniform(0, 4)};
        break;
      case 2:
        p = {rnd.uniform(-40, 40), -8, rnd.uniform(0, 4)};
        break;
      case 3:
        p = {10.0 * rnd.integer(-4, 4), 8 - rnd.uniform(0, 2), rnd.uniform(0, 3)};
        break;    // house corners
      default: {  // round posts
        const double angle_rad = rnd.uniform(-M_PI, M_PI);
        p = {7.0 * rnd.integer(-5, 5) + 0.3 * std::cos(angle_rad), -6 + 0.3 * std::sin(angle_rad),
             rnd.uniform(0, 3)};
      }
    }
    cloud.push(
        (p + Eigen::Vector3d(rnd.normal(sigma_m), rnd.normal(sigma_m), rnd.normal(sigma_m))).cast<float>());
  }
  return cloud;
}

}  // namespace raceloc::test
