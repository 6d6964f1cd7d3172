/** \file
 * Eigen-decomposition of a symmetric 3x3 matrix by cyclic Jacobi rotations without a branch, and the
 * regularisations built on it. The same rotations run on every device. */
#pragma once

#include <type_traits>

#include "core/linear.hpp"
#include "core/scalar.hpp"
#include "raceloc/gpu/covariance.h"

namespace raceloc::gpu {

/** Eigenvalues ascending with their unit vectors. */
template <class T>
struct Eigen3 {
  T low, middle, high;
  Vec3<T> v_low, v_middle, v_high;
};

/** One rotation in the plane (p, q) that makes a_pq zero; r is the third axis. */
template <class T>
RACELOC_HD void rotateJacobi(T& a_pp, T& a_qq, T& a_pq, T& a_pr, T& a_qr, Vec3<T>& v_p, Vec3<T>& v_q) {
  const T difference = a_qq - a_pp, twice = T(2) * a_pq;
  const T root = squareRoot(difference * difference + twice * twice) + T(1e-30);  // never 0 / 0
  const T t = twice / select(difference >= T(0), difference + root, difference - root);
  const T c = T(1) / squareRoot(T(1) + t * t), s = t * c;
  a_pp -= t * a_pq;
  a_qq += t * a_pq;
  a_pq = T(0);
  const T pr = c * a_pr - s * a_qr;
  a_qr = s * a_pr + c * a_qr;
  a_pr = pr;
  const Vec3<T> p = c * v_p - s * v_q;
  v_q = s * v_p + c * v_q;
  v_p = p;
}

template <class T>
RACELOC_HD void orderPair(T& a, T& b, Vec3<T>& v_a, Vec3<T>& v_b) {
  const auto swap = b < a;
  const T low = select(swap, b, a), high = select(swap, a, b);
  const Vec3<T> v_low = select(swap, v_b, v_a), v_high = select(swap, v_a, v_b);
  a = low, b = high;
  v_a = v_low, v_b = v_high;
}

/** \param a entries of order 1 (divide by the trace first); 4 sweeps reach float accuracy, 6 double. */
template <class T>
RACELOC_HD Eigen3<T> eigen(Sym3<T> a) {
  constexpr int sweeps = std::is_same_v<T, double> ? 6 : 4;
  const T none(0), one(1);
  Vec3<T> x{one, none, none}, y{none, one, none}, z{none, none, one};
  for (int sweep = 0; sweep < sweeps; ++sweep) {
    rotateJacobi(a.xx, a.yy, a.xy, a.xz, a.yz, x, y);
    rotateJacobi(a.xx, a.zz, a.xz, a.xy, a.yz, x, z);
    rotateJacobi(a.yy, a.zz, a.yz, a.xy, a.xz, y, z);
  }
  orderPair(a.xx, a.yy, x, y);
  orderPair(a.yy, a.zz, y, z);
  orderPair(a.xx, a.yy, x, y);
  return {a.xx, a.yy, a.zz, x, y, z};
}

/** Below this share of the largest eigenvalue, the gap between the two smallest leaves the normal undefined.
 */
inline constexpr double kNormalGap = 1e-3;

/** Variance of a point whose surface is unknown, among planes of variances (epsilon, 1, 1): it must not pull
 * harder than they do along themselves, or voxels full of such points hold a match back. */
inline constexpr float kUnknownPlane = 4;

/** Covariance of a point that nothing is known of. */
template <class T>
RACELOC_HD Sym3<T> unknownSurface(Regularisation how, T squared_radius_m2) {
  return isotropic(how == Regularisation::plane ? T(kUnknownPlane) : squared_radius_m2);
}

/** C made fit for registration. Where the neighbourhood says nothing (it is one point; for `plane`, it has no
 * normal) the answer is unknownSurface(). */
template <class T>
RACELOC_HD Sym3<T> regularised(const Sym3<T>& C, Regularisation how, T epsilon, T squared_radius_m2) {
  if (how == Regularisation::none) return C;
  const T size = trace(C);
  const auto spread = size > T(1e-10) * squared_radius_m2;
  const Sym3<T> unknown = unknownSurface(how, squared_radius_m2);
  const Eigen3<T> e = eigen((T(1) / select(spread, size, T(1))) * C);
  if (how == Regularisation::plane) {
    const auto flat = e.middle - e.low >= T(kNormalGap) * e.high;
    const Sym3<T> plane = isotropic(T(1)) + (epsilon - T(1)) * outer(e.v_low);
    return select(spread, select(flat, plane, unknown), unknown);
  }
  const T floor = epsilon * e.high;
  const T low = select(e.low > floor, e.low, floor), middle = select(e.middle > floor, e.middle, floor);
  const Sym3<T> raised =
      size * (low * outer(e.v_low) + middle * outer(e.v_middle) + e.high * outer(e.v_high));
  return select(spread, raised, unknown);
}

}  // namespace raceloc::gpu
