/** \file
 * 3-vectors, symmetric and full 3x3 matrices: only what the bodies need. T is float on the backends, double
 * in tests. */
#pragma once

#include "core/scalar.hpp"

namespace raceloc::gpu {

template <class T>
struct Vec3 {
  T x, y, z;
};

/** Symmetric matrix, upper triangle. */
template <class T>
struct Sym3 {
  T xx, xy, xz, yy, yz, zz;
};

/** Full matrix, row by row. */
template <class T>
struct Mat3 {
  T xx, xy, xz, yx, yy, yz, zx, zy, zz;
};

template <class T>
RACELOC_HD Vec3<T> operator+(const Vec3<T>& a, const Vec3<T>& b) {
  return {a.x + b.x, a.y + b.y, a.z + b.z};
}

template <class T>
RACELOC_HD Vec3<T> operator-(const Vec3<T>& a, const Vec3<T>& b) {
  return {a.x - b.x, a.y - b.y, a.z - b.z};
}

template <class T>
RACELOC_HD Vec3<T> operator*(T s, const Vec3<T>& a) {
  return {s * a.x, s * a.y, s * a.z};
}

template <class T>
RACELOC_HD T dot(const Vec3<T>& a, const Vec3<T>& b) {
  return a.x * b.x + a.y * b.y + a.z * b.z;
}

template <class T>
RACELOC_HD Vec3<T> cross(const Vec3<T>& a, const Vec3<T>& b) {
  return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}

template <class T>
RACELOC_HD Sym3<T> operator+(const Sym3<T>& a, const Sym3<T>& b) {
  return {a.xx + b.xx, a.xy + b.xy, a.xz + b.xz, a.yy + b.yy, a.yz + b.yz, a.zz + b.zz};
}

template <class T>
RACELOC_HD Sym3<T> operator*(T s, const Sym3<T>& a) {
  return {s * a.xx, s * a.xy, s * a.xz, s * a.yy, s * a.yz, s * a.zz};
}

template <class T>
RACELOC_HD Vec3<T> operator*(const Sym3<T>& a, const Vec3<T>& v) {
  return {a.xx * v.x + a.xy * v.y + a.xz * v.z, a.xy * v.x + a.yy * v.y + a.yz * v.z,
          a.xz * v.x + a.yz * v.y + a.zz * v.z};
}

template <class T>
RACELOC_HD Vec3<T> operator*(const Mat3<T>& a, const Vec3<T>& v) {
  return {a.xx * v.x + a.xy * v.y + a.xz * v.z, a.yx * v.x + a.yy * v.y + a.yz * v.z,
          a.zx * v.x + a.zy * v.y + a.zz * v.z};
}

template <class T>
RACELOC_HD T trace(const Sym3<T>& a) {
  return a.xx + a.yy + a.zz;
}

/** v v'. */
template <class T>
RACELOC_HD Sym3<T> outer(const Vec3<T>& v) {
  return {v.x * v.x, v.x * v.y, v.x * v.z, v.y * v.y, v.y * v.z, v.z * v.z};
}

template <class T>
RACELOC_HD Sym3<T> isotropic(T variance) {
  return {variance, T(0), T(0), variance, T(0), variance};
}

template <class T>
RACELOC_HD Mat3<T> transposed(const Mat3<T>& a) {
  return {a.xx, a.yx, a.zx, a.xy, a.yy, a.zy, a.xz, a.yz, a.zz};
}

template <class M, class T>
RACELOC_HD Vec3<T> select(const M& condition, const Vec3<T>& yes, const Vec3<T>& no) {
  return {select(condition, yes.x, no.x), select(condition, yes.y, no.y), select(condition, yes.z, no.z)};
}

template <class M, class T>
RACELOC_HD Sym3<T> select(const M& condition, const Sym3<T>& yes, const Sym3<T>& no) {
  return {select(condition, yes.xx, no.xx), select(condition, yes.xy, no.xy),
          select(condition, yes.xz, no.xz), select(condition, yes.yy, no.yy),
          select(condition, yes.yz, no.yz), select(condition, yes.zz, no.zz)};
}

/** R C R': the covariance C in the frame that R turns into. */
template <class T>
RACELOC_HD Sym3<T> turned(const Mat3<T>& R, const Sym3<T>& C) {
  const Vec3<T> row_x{R.xx, R.xy, R.xz}, row_y{R.yx, R.yy, R.yz}, row_z{R.zx, R.zy, R.zz};
  const Vec3<T> C_x = C * row_x, C_y = C * row_y, C_z = C * row_z;
  return {dot(row_x, C_x), dot(row_x, C_y), dot(row_x, C_z),
          dot(row_y, C_y), dot(row_y, C_z), dot(row_z, C_z)};
}

/** Adjugate, also symmetric; the inverse is adjugate / determinant. */
template <class T>
RACELOC_HD Sym3<T> adjugate(const Sym3<T>& a) {
  return {a.yy * a.zz - a.yz * a.yz, a.xz * a.yz - a.xy * a.zz, a.xy * a.yz - a.xz * a.yy,
          a.xx * a.zz - a.xz * a.xz, a.xy * a.xz - a.xx * a.yz, a.xx * a.yy - a.xy * a.xy};
}

}  // namespace raceloc::gpu
