/** \file
 * Weighted mean and covariance of a neighbourhood, from offsets to its point: nothing large is subtracted. */
#pragma once

#include "core/linear.hpp"

namespace raceloc::gpu {

template <class T>
struct Moments {
  T weight = T(0);
  Vec3<T> first{T(0), T(0), T(0)};
  Sym3<T> second{T(0), T(0), T(0), T(0), T(0), T(0)};
  T neighbours = T(0);  ///< exact below 2^24

  /** Takes the neighbour at offset d [m] if it lies within the radius. */
  template <class WeightOf>
  RACELOC_HD void add(const Vec3<T>& d, T squared_radius_m2, const WeightOf& weightOf) {
    const T squared_m2 = dot(d, d);
    const auto near = squared_m2 <= squared_radius_m2;
    const T w = select(near, weightOf(squared_m2, absolute(d.x) + absolute(d.y) + absolute(d.z)), T(0));
    const Vec3<T> wd = w * d;
    weight += w;
    first = first + wd;
    second = second + Sym3<T>{wd.x * d.x, wd.x * d.y, wd.x * d.z, wd.y * d.y, wd.y * d.z, wd.z * d.z};
    neighbours = neighbours + select(near, T(1), T(0));
  }

  /** Takes what another has taken. */
  RACELOC_HD void add(const Moments& other) {
    weight += other.weight;
    first = first + other.first;
    second = second + other.second;
    neighbours += other.neighbours;
  }

  /** sum w (p-mu)(p-mu)' / sum w [m^2]; the point itself has weight 1, so the sum is never 0. */
  [[nodiscard]] RACELOC_HD Sym3<T> covariance() const {
    const T share = T(1) / weight;
    return share * second + T(-1) * outer(share * first);
  }
};

}  // namespace raceloc::gpu
