/** \file
 * The paper's five kernels as weights of an offset d = neighbour - point: each in [0, 1], 1 at d = 0, and of
 * d alone, so that covariances are positive semi-definite and do not depend on the origin (reading.md section
 * 4). A weight is called with |d|^2 [m^2] and |d|_1 [m]. */
#pragma once

#include "core/scalar.hpp"
#include "raceloc/gpu/covariance.h"

namespace raceloc::gpu {

/** exp(-rate |d|^2): `rbf` with its gamma, `gaussian` with 1 / (2 sigma^2). */
template <class T>
struct SquaredExponential {
  T rate_per_m2;
  RACELOC_HD T operator()(T squared_m2, T) const { return exponential(-rate_per_m2 * squared_m2); }
};

/** exp(-|d| / sigma). */
template <class T>
struct Laplacian {
  T rate_per_m;
  RACELOC_HD T operator()(T squared_m2, T) const { return exponential(-rate_per_m * nearRoot(squared_m2)); }
};

/** (1 + (alpha/c) |d|^2)^(-degree/2): the paper's (alpha <x,y> + c)^degree, cosine-normalised about the
 * point. */
template <class T>
struct Polynomial {
  T ratio_per_m2;
  int degree;
  RACELOC_HD T operator()(T squared_m2, T) const {
    const T base = T(1) / squareRoot(T(1) + ratio_per_m2 * squared_m2);
    T power = T(1), square = base;
    for (int left = degree; left > 0; left >>= 1) {
      if ((left & 1) != 0) power *= square;
      square *= square;
    }
    return power;
  }
};

/** max(0, 1 - |d|_1 / (3 s)): intersection of two-bin histograms of each axis over their mass. */
template <class T>
struct Histogram {
  T rate_per_m;
  RACELOC_HD T operator()(T, T manhattan_m) const {
    const T w = T(1) - rate_per_m * manhattan_m;
    return select(w > T(0), w, T(0));
  }
};

/** Calls `use` with the weight that the options name. */
template <class T, class Use>
void withWeight(const CovarianceOptions& o, const Use& use) {
  switch (o.weight) {
    case Weight::rbf:
      return use(SquaredExponential<T>{T(o.rbf_gamma_per_m2)});
    case Weight::gaussian:
      return use(SquaredExponential<T>{T(1 / (2 * o.gaussian_sigma_m * o.gaussian_sigma_m))});
    case Weight::polynomial:
      return use(Polynomial<T>{T(o.polynomial_alpha_per_m2 / o.polynomial_c), o.polynomial_degree});
    case Weight::hist:
      return use(Histogram<T>{T(1 / (3 * o.hist_s_m))});
    case Weight::laplacian:
      return use(Laplacian<T>{T(1 / o.laplacian_sigma_m)});
  }
}

}  // namespace raceloc::gpu
