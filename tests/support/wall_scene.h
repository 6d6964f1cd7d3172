/** \file
 * Scans of a made-up road with walls, body frame. */
#pragma once

#include <cmath>
#include <vector>

#include "support/forall.h"

namespace raceloc::test {

/** from, from + step, ... below `to`. */
inline std::vector<double> steps(double from, double to, double step) {
  std::vector<double> all;
  for (int k = 0; from + k * step < to; ++k) all.push_back(from + k * step);
  return all;
}

constexpr float kRoad_m = -0.3F;  ///< below the axle

/** A road of 60 m to each side, flat to centimetres. */
inline void addGround(Cloud& cloud, Random& rnd, double half_m = 60) {
  for (const double x : steps(-half_m, half_m, 0.4))
    for (const double y : steps(-half_m, half_m, 0.4))
      cloud.push(Eigen::Vector3d(x + rnd.uniform(0, 0.2), y + rnd.uniform(0, 0.2), kRoad_m + rnd.normal(0.01))
                     .cast<float>());
}

/** A wall of 1 m along y = beta[0] + beta[1] x + beta[2] x^2. */
inline void addWall(Cloud& cloud, Random& rnd, const Eigen::Vector3d& beta, double from_m, double to_m) {
  for (const double x : steps(from_m, to_m, 0.2))
    for (const double h : steps(0.05, 1, 0.1)) {
      const double y = beta[0] + x * (beta[1] + x * beta[2]) + rnd.normal(0.01);
      cloud.push(Eigen::Vector3d(x, y, kRoad_m + h).cast<float>());
    }
}

/** What is seen of a car of 5 x 2 x 1.2 m: the near side and the tail. */
inline void addCar(Cloud& cloud, const Eigen::Vector2d& middle_m) {
  for (const double z : steps(0.05, 1.2, 0.1)) {
    for (const double x : steps(-2.5, 2.5, 0.1))
      cloud.push(Eigen::Vector3d(middle_m.x() + x, middle_m.y() - std::copysign(1, middle_m.y()), kRoad_m + z)
                     .cast<float>());
    for (const double y : steps(-1, 1, 0.1))
      cloud.push(Eigen::Vector3d(middle_m.x() - 2.5, middle_m.y() + y, kRoad_m + z).cast<float>());
  }
}

}  // namespace raceloc::test
