/** \file
 * Brute force in double, written from the definitions and not from core/: maps instead of hashes, all pairs
 * instead of cells, closed forms instead of iterations. */
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <map>
#include <tuple>

#include "raceloc/gpu/covariance.h"
#include "raceloc/gpu/matcher.h"
#include "tests/scenes.h"

namespace raceloc::gpu::test {

using Vector = std::array<double, 3>;
using Matrix = std::array<Vector, 3>;
using VoxelIndex = std::tuple<long, long, long>;  ///< z, y, x: ascending as the kernels promise

inline VoxelIndex voxelOf(const Vector& p, double size_m) {
  return {std::lround(std::floor(p[2] / size_m)), std::lround(std::floor(p[1] / size_m)),
          std::lround(std::floor(p[0] / size_m))};
}

inline Matrix product(const Matrix& A, const Matrix& B) {
  Matrix C{};
  for (std::size_t i = 0; i < 3; ++i)
    for (std::size_t j = 0; j < 3; ++j)
      for (std::size_t k = 0; k < 3; ++k) C[i][j] += A[i][k] * B[k][j];
  return C;
}

inline Matrix flipped(const Matrix& A) {
  Matrix B{};
  for (std::size_t i = 0; i < 3; ++i)
    for (std::size_t j = 0; j < 3; ++j) B[i][j] = A[j][i];
  return B;
}

inline Vector product(const Matrix& A, const Vector& v) {
  Vector w{};
  for (std::size_t i = 0; i < 3; ++i)
    for (std::size_t k = 0; k < 3; ++k) w[i] += A[i][k] * v[k];
  return w;
}

inline double scalar(const Vector& a, const Vector& b) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }

inline Vector crossed(const Vector& a, const Vector& b) {
  return {a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]};
}

inline double determinant(const Matrix& A) { return scalar(A[0], crossed(A[1], A[2])); }

inline Matrix inverted(const Matrix& A) {
  const double d = determinant(A);
  Matrix B{crossed(A[1], A[2]), crossed(A[2], A[0]),
           crossed(A[0], A[1])};  // cofactors; the inverse is their transpose
  for (auto& row : B)
    for (double& x : row) x /= d;
  return flipped(B);
}

inline Matrix matrixAt(const Covariances& C, std::size_t i) {
  const auto d = [](float x) { return static_cast<double>(x); };
  return {{{d(C.xx[i]), d(C.xy[i]), d(C.xz[i])},
           {d(C.xy[i]), d(C.yy[i]), d(C.yz[i])},
           {d(C.xz[i]), d(C.yz[i]), d(C.zz[i])}}};
}

inline Matrix rotationOf(const Transform& T) {
  return {{{T.R[0], T.R[1], T.R[2]}, {T.R[3], T.R[4], T.R[5]}, {T.R[6], T.R[7], T.R[8]}}};
}

/** Eigenvalues of a symmetric matrix, ascending, by the cosine form of the cubic. */
inline Vector eigenvalues(const Matrix& A) {
  const double mean = (A[0][0] + A[1][1] + A[2][2]) / 3;
  Matrix B = A;
  double square = 0;
  for (std::size_t i = 0; i < 3; ++i) B[i][i] -= mean;
  for (const auto& row : B)
    for (const double x : row) square += x * x;
  const double p = std::sqrt(square / 6);
  if (p == 0) return {mean, mean, mean};
  const double angle = std::acos(std::clamp(determinant(B) / (2 * p * p * p), -1.0, 1.0)) / 3;
  const double third = 2 * std::acos(-1.0) / 3;
  const double high = mean + 2 * p * std::cos(angle), low = mean + 2 * p * std::cos(angle + third);
  return {low, 3 * mean - high - low, high};
}

/** Unit eigenvector of a simple eigenvalue: orthogonal to the rows of A - value I. */
inline Vector eigenvector(const Matrix& A, double value) {
  Matrix B = A;
  for (std::size_t i = 0; i < 3; ++i) B[i][i] -= value;
  Vector best{1, 0, 0};
  double largest = 0;
  for (const Vector& v : {crossed(B[0], B[1]), crossed(B[1], B[2]), crossed(B[2], B[0])}) {
    const double length2 = scalar(v, v);
    if (length2 <= largest) continue;
    largest = length2;
    for (std::size_t i = 0; i < 3; ++i) best[i] = v[i] / std::sqrt(length2);
  }
  return best;
}

inline double weightAt(const Vector& d, const CovarianceOptions& o) {
  const double length = std::sqrt(scalar(d, d));
  const auto f = [](float x) { return static_cast<double>(x); };
  switch (o.weight) {
    case Weight::rbf:
      return std::exp(-f(o.rbf_gamma_per_m2) * length * length);
    case Weight::gaussian:
      return std::exp(-0.5 * std::pow(length / f(o.gaussian_sigma_m), 2));
    case Weight::polynomial:
      return std::pow(1 + f(o.polynomial_alpha_per_m2) / f(o.polynomial_c) * length * length,
                      -0.5 * o.polynomial_degree);
    case Weight::hist:
      return std::max(0.0, 1 - (std::fabs(d[0]) + std::fabs(d[1]) + std::fabs(d[2])) / (3 * f(o.hist_s_m)));
    case Weight::laplacian:
      return std::exp(-length / f(o.laplacian_sigma_m));
  }
  return 0;
}

struct RawCovariance {
  Matrix C{};
  int neighbours = 0;
  bool on_the_rim = false;  ///< a neighbour so close to the radius that float may decide otherwise
};

inline RawCovariance rawCovariance(const Points& p, std::size_t i, const CovarianceOptions& o) {
  const double radius = static_cast<double>(o.radius_m);
  const Vector q = at(p, i);
  RawCovariance out;
  double total = 0;
  Vector mean{};
  std::vector<std::pair<double, Vector>> near;
  for (std::size_t j = 0; j < p.size(); ++j) {
    const Vector x = at(p, j), d{x[0] - q[0], x[1] - q[1], x[2] - q[2]};
    const double length = std::sqrt(scalar(d, d));
    if (std::fabs(length - radius) < 1e-5 * radius) out.on_the_rim = true;
    if (length > radius) continue;
    const double w = weightAt(d, o);
    near.emplace_back(w, x);
    total += w;
    for (std::size_t k = 0; k < 3; ++k) mean[k] += w * x[k];
  }
  for (double& m : mean) m /= total;
  for (const auto& [w, x] : near)
    for (std::size_t r = 0; r < 3; ++r)
      for (std::size_t c = 0; c < 3; ++c) out.C[r][c] += w * (x[r] - mean[r]) * (x[c] - mean[c]) / total;
  out.neighbours = static_cast<int>(near.size());
  return out;
}

/** A function of the eigenvalues, with the eigenvectors kept. */
inline Matrix withEigenvalues(const Matrix& C, const Vector& values) {
  const Vector old = eigenvalues(C);
  const Vector low = eigenvector(C, old[0]), high = eigenvector(C, old[2]), middle = crossed(high, low);
  Matrix out{};
  for (std::size_t r = 0; r < 3; ++r)
    for (std::size_t c = 0; c < 3; ++c)
      out[r][c] =
          values[0] * low[r] * low[c] + values[1] * middle[r] * middle[c] + values[2] * high[r] * high[c];
  return out;
}

struct Gaussian {
  Vector mean;
  Matrix C;
};
using GaussianMap = std::map<VoxelIndex, Gaussian>;

inline GaussianMap gaussians(const VoxelGaussians& contents) {
  GaussianMap map;
  for (std::size_t i = 0; i < contents.size(); ++i)
    map[{contents.iz[i], contents.iy[i], contents.ix[i]}] = {at(contents.mean, i),
                                                             matrixAt(contents.covariance, i)};
  return map;
}

/** Pairs of a pass by its definition: index of the source point, Gaussian of the voxel. */
inline std::vector<std::pair<std::size_t, const Gaussian*>> pairsOf(const Points& source,
                                                                    const GaussianMap& map, double voxel_m,
                                                                    const Transform& T,
                                                                    const MatchOptions& o) {
  std::vector<std::pair<std::size_t, const Gaussian*>> pairs;
  for (std::size_t i = 0; i < source.size(); ++i) {
    const Vector q = applied(T, at(source, i));
    const auto [z, y, x] = voxelOf(q, voxel_m);
    for (long dz = -1; dz <= 1; ++dz)
      for (long dy = -1; dy <= 1; ++dy)
        for (long dx = -1; dx <= 1; ++dx) {
          const long steps = std::labs(dx) + std::labs(dy) + std::labs(dz);
          if (steps > (o.neighbour_voxels == 1 ? 0 : o.neighbour_voxels == 7 ? 1 : 3)) continue;
          const auto found = map.find({z + dz, y + dy, x + dx});
          if (found == map.end()) continue;
          const Vector& m = found->second.mean;
          if (std::hypot(m[0] - q[0], m[1] - q[1], m[2] - q[2]) <= o.max_distance_m)
            pairs.emplace_back(i, &found->second);
        }
  }
  return pairs;
}

/** Cost, H, b over given pairs, in the map's frame as reading.md section 4 writes it. */
inline Linearization linearizeOver(const std::vector<std::pair<std::size_t, const Gaussian*>>& pairs,
                                   const Points& source, const Covariances& C, const Transform& T,
                                   const MatchOptions& o) {
  Linearization out;
  const Matrix R = rotationOf(T);
  const double c2 = o.robust_width * o.robust_width;
  std::size_t last = source.size();
  for (const auto& [i, gaussian] : pairs) {
    const Vector p = at(source, i), q = applied(T, p);
    const Vector e{gaussian->mean[0] - q[0], gaussian->mean[1] - q[1], gaussian->mean[2] - q[2]};
    Matrix S = product(product(R, matrixAt(C, i)), flipped(R));
    for (std::size_t r = 0; r < 3; ++r)
      for (std::size_t c = 0; c < 3; ++c) S[r][c] += gaussian->C[r][c];
    const Matrix W = inverted(S);
    const double s = scalar(e, product(W, e));
    const double weight = c2 > 0 ? 1 / (1 + s / c2) : 1;
    out.cost += 0.5 * (c2 > 0 ? c2 * std::log1p(s / c2) : s);
    const Matrix px{{{0, -p[2], p[1]}, {p[2], 0, -p[0]}, {-p[1], p[0], 0}}};
    const Matrix Rpx = product(R, px);
    std::array<Vector, 6> J{};  // columns of de/dxi = (R [p]x, -R)
    for (std::size_t k = 0; k < 3; ++k)
      for (std::size_t r = 0; r < 3; ++r) J[k][r] = Rpx[r][k], J[3 + k][r] = -R[r][k];
    for (std::size_t a = 0; a < 6; ++a) {
      const Vector WJ = product(W, J[a]);
      out.b[a] += weight * scalar(WJ, e);
      for (std::size_t k = 0; k < 6; ++k) out.H[6 * a + k] += weight * scalar(WJ, J[k]);
    }
    out.squared_distance_m2 += s / (W[0][0] + W[1][1] + W[2][2]);
    ++out.pairs;
    if (i != last) ++out.inliers;
    last = i;
  }
  return out;
}

}  // namespace raceloc::gpu::test
