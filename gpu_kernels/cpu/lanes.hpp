/** \file
 * Vectors of floats as wide as the instruction set that this file is compiled for, with the functions that
 * core/scalar.hpp has for one float. All of it lives in a namespace named after the instruction set (GK_ISA),
 * so that the linker cannot mix code of two. No operation is contracted or reordered: a lane gets the same
 * bits on every instruction set. */
#pragma once

#include <cstdint>
#if defined(__SSE2__)
#include <immintrin.h>
#endif

#include "core/host_device.hpp"

namespace raceloc::gpu::GK_ISA {

#if defined(__AVX512F__)
inline constexpr int kWidth = 16;
#elif defined(__AVX2__)
inline constexpr int kWidth = 8;
#else
inline constexpr int kWidth = 4;
#endif

/** The loops work on groups of this many lanes, whatever the width: sums over them have one order. */
inline constexpr int kLanes = 16;
inline constexpr int kParts = kLanes / kWidth;

using Floats = float __attribute__((vector_size(4 * kWidth)));
using Ints = std::int32_t __attribute__((vector_size(4 * kWidth)));

/** What a comparison gives: all bits of a lane, or none. */
struct M {
  Ints v;
};

struct F {
  Floats v;
  F() = default;
  RACELOC_HD explicit F(float s) : v(s - Floats{}) {}
  RACELOC_HD explicit F(double s) : F(static_cast<float>(s)) {}
  RACELOC_HD explicit F(int s) : F(static_cast<float>(s)) {}
};

RACELOC_HD F wrapped(Floats v) {
  F f;
  f.v = v;
  return f;
}

RACELOC_HD F load(const float* p) {
  F f;
  __builtin_memcpy(&f.v, p, sizeof(f.v));
  return f;
}
RACELOC_HD void store(float* p, const F& f) { __builtin_memcpy(p, &f.v, sizeof(f.v)); }
RACELOC_HD Ints loadInts(const std::int32_t* p) {
  Ints i;
  __builtin_memcpy(&i, p, sizeof(i));
  return i;
}
RACELOC_HD void storeInts(std::int32_t* p, Ints i) { __builtin_memcpy(p, &i, sizeof(i)); }

RACELOC_HD F operator+(const F& a, const F& b) { return wrapped(a.v + b.v); }
RACELOC_HD F operator-(const F& a, const F& b) { return wrapped(a.v - b.v); }
RACELOC_HD F operator-(const F& a) { return wrapped(-a.v); }
RACELOC_HD F operator*(const F& a, const F& b) { return wrapped(a.v * b.v); }
RACELOC_HD F operator/(const F& a, const F& b) { return wrapped(a.v / b.v); }
RACELOC_HD F& operator+=(F& a, const F& b) { return a = a + b; }
RACELOC_HD F& operator-=(F& a, const F& b) { return a = a - b; }
RACELOC_HD F& operator*=(F& a, const F& b) { return a = a * b; }
RACELOC_HD M operator<(const F& a, const F& b) { return {a.v < b.v}; }
RACELOC_HD M operator>(const F& a, const F& b) { return {a.v > b.v}; }
RACELOC_HD M operator<=(const F& a, const F& b) { return {a.v <= b.v}; }
RACELOC_HD M operator>=(const F& a, const F& b) { return {a.v >= b.v}; }
RACELOC_HD M operator&(const M& a, const M& b) { return {a.v & b.v}; }
RACELOC_HD M operator|(const M& a, const M& b) { return {a.v | b.v}; }

RACELOC_HD F select(const M& condition, const F& yes, const F& no) {
  return wrapped(condition.v ? yes.v : no.v);
}

RACELOC_HD F product(const F& a, const F& b) { return a * b; }

RACELOC_HD F larger(const F& a, const F& b) {
#if defined(__AVX512F__)
  return wrapped(_mm512_maskz_max_ps(0xFFFF, a.v, b.v));  // without a mask, GCC 12 warns of its own header
#elif defined(__AVX2__)
  return wrapped(_mm256_max_ps(a.v, b.v));
#elif defined(__SSE2__)
  return wrapped(_mm_max_ps(a.v, b.v));
#else
  return select(a > b, a, b);
#endif
}

RACELOC_HD F smaller(const F& a, const F& b) {
#if defined(__AVX512F__)
  return wrapped(_mm512_maskz_min_ps(0xFFFF, a.v, b.v));
#elif defined(__AVX2__)
  return wrapped(_mm256_min_ps(a.v, b.v));
#elif defined(__SSE2__)
  return wrapped(_mm_min_ps(a.v, b.v));
#else
  return select(a < b, a, b);
#endif
}

/** Bit k is lane k. */
RACELOC_HD unsigned lanesOf(const M& m) {
#if defined(__AVX512F__)
  return _mm512_test_epi32_mask(reinterpret_cast<__m512i>(m.v), reinterpret_cast<__m512i>(m.v));
#elif defined(__AVX2__)
  return static_cast<unsigned>(_mm256_movemask_ps(reinterpret_cast<__m256>(m.v)));
#elif defined(__SSE2__)
  return static_cast<unsigned>(_mm_movemask_ps(reinterpret_cast<__m128>(m.v)));
#else
  unsigned lanes = 0;
  for (int i = 0; i < kWidth; ++i) lanes |= (m.v[i] != 0 ? 1U : 0U) << i;
  return lanes;
#endif
}

RACELOC_HD F squareRoot(const F& x) {
#if defined(__AVX512F__)
  return wrapped(_mm512_maskz_sqrt_ps(0xFFFF, x.v));
#elif defined(__AVX2__)
  return wrapped(_mm256_sqrt_ps(x.v));
#elif defined(__SSE2__)
  return wrapped(_mm_sqrt_ps(x.v));
#else
  F root;
  for (int i = 0; i < kWidth; ++i) root.v[i] = __builtin_sqrtf(x.v[i]);
  return root;
#endif
}

RACELOC_HD Ints bitsOf(const F& x) {
  Ints i;
  __builtin_memcpy(&i, &x.v, sizeof(i));
  return i;
}
RACELOC_HD F fromBits(Ints i) {
  F f;
  __builtin_memcpy(&f.v, &i, sizeof(i));
  return f;
}

RACELOC_HD F absolute(const F& x) { return fromBits(bitsOf(x) & 0x7FFFFFFF); }

/** Towards zero; the numbers fit. */
RACELOC_HD Ints truncated(const F& x) { return __builtin_convertvector(x.v, Ints); }
RACELOC_HD F toFloats(Ints i) { return wrapped(__builtin_convertvector(i, Floats)); }
RACELOC_HD Ints floorToInts(const F& x) {
  const Ints whole = truncated(x);
  return whole + (x.v < toFloats(whole).v);  // a true comparison is -1
}

/** e^x for x <= 0: 2^n times the Taylor series of the rest, |rest| <= log(2) / 2, which ends at 1e-8. Below
 * -87 it stays at 1e-38. */
RACELOC_HD F exponential(const F& x) {
  const F bounded = select(x > F(-87), x, F(-87));
  const Ints n = truncated(bounded * F(1.44269504088896) - F(0.5));
  const F whole = toFloats(n);
  const F r = (bounded - whole * F(0.693359375)) - whole * F(-2.12194440054690583e-4);  // log 2 in two parts
  F sum = F(1.0 / 5040);
  for (const double coefficient : {1.0 / 720, 1.0 / 120, 1.0 / 24, 1.0 / 6, 0.5, 1.0, 1.0})
    sum = sum * r + F(coefficient);
  return fromBits(bitsOf(sum) + (n << 23));
}

/** log x for x >= 1: exponent and mantissa m in [sqrt(1/2), sqrt(2)), log m = 2 atanh((m-1)/(m+1)) by its
 * series, which ends at 1e-9. */
RACELOC_HD F logarithm(const F& x) {
  const Ints shifted = bitsOf(x) - 0x3F3504F3;  // the bits of sqrt(1/2)
  const Ints n = shifted >> 23;
  const F m = fromBits((shifted & 0x007FFFFF) + 0x3F3504F3);
  const F s = (m - F(1)) / (m + F(1)), s2 = s * s;
  F sum = F(2.0 / 9);
  for (const double coefficient : {2.0 / 7, 2.0 / 5, 2.0 / 3, 2.0}) sum = sum * s2 + F(coefficient);
  return toFloats(n) * F(0.693147180559945) + sum * s;
}

}  // namespace raceloc::gpu::GK_ISA
