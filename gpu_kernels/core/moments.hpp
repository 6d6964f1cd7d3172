/** \file
 * Weighted mean and covariance of a neighbourhood, from offsets to its point: nothing large is subtracted. */
#pragma once

#include <cmath>
#include <cstdint>

#include "core/linear.hpp"

namespace raceloc::gpu {

template <class T>
struct Moments {
  T weight = 0;
  Vec3<T> first{0, 0, 0};
  Sym3<T> second{0, 0, 0, 0, 0, 0};
  std::int32_t neighbours = 0;

  /** Takes the neighbour at offset d [m] if it lies within the radius. */
  template <class WeightOf>
  RACELOC_HD void add(const Vec3<T>& d, T squared_radius_m2, const WeightOf& weightOf) {
    const T squared_m2 = dot(d, d);
    if (squared_m2 > squared_radius_m2) return;
    const T w = weightOf(squared_m2, std::fabs(d.x) + std::fabs(d.y) + std::fabs(d.z));
    const Vec3<T> wd = w * d;
    weight += w;
    first = first + wd;
    second = second + Sym3<T>{wd.x * d.x, wd.x * d.y, wd.x * d.z, wd.y * d.y, wd.y * d.z, wd.z * d.z};
    ++neighbours;
  }

  /** sum w (p-mu)(p-mu)' / sum w [m^2]; the point itself has weight 1, so the sum is never 0. */
  [[nodiscard]] RACELOC_HD Sym3<T> covariance() const {
    const T share = T(1) / weight;
    return share * second + T(-1) * outer(share * first);
  }
};

}  // namespace raceloc::gpu
