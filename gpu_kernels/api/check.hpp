/** \file
 * What the public functions refuse. */
#pragma once

#include <cmath>
#include <cstdint>
#include <limits>
#include <sstream>
#include <stdexcept>
#include <string>

#include "raceloc/gpu/types.h"

namespace raceloc::gpu {

/** \throws std::invalid_argument "name is value, but must be range" */
template <class T>
void require(bool good, const char* name, T value, const char* range) {
  if (good) return;
  std::ostringstream text;
  text << name << " is " << value << ", but must be " << range;
  throw std::invalid_argument(text.str());
}

template <class T>
void requirePositive(const char* name, T value) {
  require(value > T(0) && std::isfinite(value), name, value, "finite and > 0");
}

/** Indices of points are 32 bits wide. */
inline void requireCountable(std::size_t points) {
  require(points < std::numeric_limits<std::int32_t>::max(), "number of points", points, "below 2^31");
}

inline void requireSameSize(const PointsView& points, const CovariancesView& covariances) {
  if (points.size == covariances.size) return;  // the text below allocates
  require(false, "number of covariances", covariances.size,
          ("that of the points, " + std::to_string(points.size)).c_str());
}

}  // namespace raceloc::gpu
