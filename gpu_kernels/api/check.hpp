/** \file
 * What the public functions refuse. */
#pragma once

#include <cmath>
#include <cstdint>
#include <limits>
#include <sstream>
#include <stdexcept>
#include <string>

#include "raceloc/gpu/covariance.h"
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

inline void requireGood(const CovarianceOptions& options) {
  requirePositive("radius_m", options.radius_m);
  requirePositive("rbf_gamma_per_m2", options.rbf_gamma_per_m2);
  requirePositive("gaussian_sigma_m", options.gaussian_sigma_m);
  requirePositive("laplacian_sigma_m", options.laplacian_sigma_m);
  requirePositive("polynomial_alpha_per_m2", options.polynomial_alpha_per_m2);
  requirePositive("polynomial_c", options.polynomial_c);
  requirePositive("hist_s_m", options.hist_s_m);
  require(options.polynomial_degree >= 1, "polynomial_degree", options.polynomial_degree, ">= 1");
  require(options.plane_epsilon > 0 && options.plane_epsilon <= 1, "plane_epsilon", options.plane_epsilon,
          "in (0, 1]");
  require(options.nearest >= 4 && options.nearest <= kMostNearest, "nearest", options.nearest,
          "from 4 to 64");
}

inline void requireSameSize(const PointsView& points, const CovariancesView& covariances) {
  if (points.size == covariances.size) return;  // the text below allocates
  require(false, "number of covariances", covariances.size,
          ("that of the points, " + std::to_string(points.size)).c_str());
}

}  // namespace raceloc::gpu
