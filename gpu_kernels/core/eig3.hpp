/** \file
 * Eigen-decomposition of a symmetric 3x3 matrix by cyclic Jacobi rotations without a branch, and the
 * regularisations built on it. The same rotations run on every device. */
#pragma once

#include <cmath>

#include "core/linear.hpp"
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
  const T root = std::sqrt(difference * difference + twice * twice) + T(1e-30);  // never 0 / 0
  const T t = twice / (difference >= T(0) ? difference + root : difference - root);
  const T c = T(1) / std::sqrt(T(1) + t * t), s = t * c;
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
  const bool swap = b < a;
  const T low = swap ? b : a, high = swap ? a : b;
  const Vec3<T> v_low = swap ? v_b : v_a, v_high = swap ? v_a : v_b;
  a = low, b = high;
  v_a = v_low, v_b = v_high;
}

/** \param a entries of order 1 (divide by the trace first); 4 sweeps reach float accuracy, 6 double. */
template <class T>
RACELOC_HD Eigen3<T> eigen(Sym3<T> a) {
  constexpr int sweeps = sizeof(T) == sizeof(float) ? 4 : 6;
  Vec3<T> x{1, 0, 0}, y{0, 1, 0}, z{0, 0, 1};
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
template <class T>
inline constexpr T kNormalGap = T(1e-3);

/** C made fit for registration. Where the neighbourhood says nothing (it is one point; for `plane`, it has no
 * normal) the answer is isotropic, of variance radius^2. */
template <class T>
RACELOC_HD Sym3<T> regularised(const Sym3<T>& C, Regularisation how, T epsilon, T squared_radius_m2) {
  if (how == Regularisation::none) return C;
  const T size = trace(C);
  if (!(size > T(1e-10) * squared_radius_m2)) return isotropic(squared_radius_m2);
  const Eigen3<T> e = eigen((T(1) / size) * C);
  if (how == Regularisation::plane) {
    if (!(e.middle - e.low >= kNormalGap<T> * e.high)) return isotropic(squared_radius_m2);
    return isotropic(T(1)) + (epsilon - T(1)) * outer(e.v_low);
  }
  const T floor = epsilon * e.high;
  const T low = e.low > floor ? e.low : floor, middle = e.middle > floor ? e.middle : floor;
  return size * (low * outer(e.v_low) + middle * outer(e.v_middle) + e.high * outer(e.v_high));
}

}  // namespace raceloc::gpu
