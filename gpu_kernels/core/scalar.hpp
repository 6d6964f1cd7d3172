/** \file
 * What the bodies of core/ ask of a number besides arithmetic. T is float (CUDA), double (references) or a
 * vector of floats (cpu/lanes.hpp has the same functions): a body that has no `if` on a T serves all three. */
#pragma once

#include <cmath>

#include "core/host_device.hpp"

namespace raceloc::gpu {

RACELOC_HD float select(bool condition, float yes, float no) { return condition ? yes : no; }
RACELOC_HD double select(bool condition, double yes, double no) { return condition ? yes : no; }

/** a b, rounded: on the device too, where a product is otherwise contracted with the sum around it. */
RACELOC_HD float product(float a, float b) {
#if defined(__CUDA_ARCH__)
  return __fmul_rn(a, b);
#else
  return a * b;
#endif
}

RACELOC_HD float squareRoot(float x) { return std::sqrt(x); }
RACELOC_HD double squareRoot(double x) { return std::sqrt(x); }
RACELOC_HD float absolute(float x) { return std::fabs(x); }
RACELOC_HD double absolute(double x) { return std::fabs(x); }

/** The root of a weight: on the device the fast instruction, to 2^-23 of it, without the branch of the rounded one. */
RACELOC_HD float nearRoot(float x) {
#if defined(__CUDA_ARCH__)
  float root;
  asm("sqrt.approx.ftz.f32 %0, %1;" : "=f"(root) : "f"(x));
  return root;
#else
  return std::sqrt(x);
#endif
}
template <class T>
RACELOC_HD T nearRoot(const T& x) {
  return squareRoot(x);
}

/** e^x for x <= 0; on the device the fast intrinsic, 2 ulp + |x| 2^-21. */
RACELOC_HD float exponential(float x) {
#if defined(__CUDA_ARCH__)
  return __expf(x);
#else
  return std::exp(x);
#endif
}
RACELOC_HD double exponential(double x) { return std::exp(x); }

/** log x for x >= 1. */
RACELOC_HD float logarithm(float x) { return std::log(x); }
RACELOC_HD double logarithm(double x) { return std::log(x); }

}  // namespace raceloc::gpu
