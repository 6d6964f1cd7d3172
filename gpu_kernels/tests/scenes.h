/** \file
 * Clouds for tests and benchmarks: drawn from a seed, or read from the real scan pair. */
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <fstream>
#include <limits>
#include <optional>
#include <random>
#include <sstream>
#include <string>

#include "core/se3_lm.hpp"
#include "raceloc/gpu/covariance.h"
#include "raceloc/gpu/deskew.h"
#include "raceloc/gpu/types.h"

namespace raceloc::gpu::test {

inline constexpr double kDegree = 0.017453292519943295;
inline constexpr float kNan = std::numeric_limits<float>::quiet_NaN(),
                       kInf = std::numeric_limits<float>::infinity();
inline constexpr std::array kWeights{Weight::rbf, Weight::gaussian, Weight::polynomial, Weight::hist,
                                     Weight::laplacian};

inline void push(Points& p, double x, double y, double z) {
  p.x.push_back(static_cast<float>(x));
  p.y.push_back(static_cast<float>(y));
  p.z.push_back(static_cast<float>(z));
}

inline Points randomCloud(unsigned seed, int n, double size_m) {
  std::mt19937 engine(seed);
  std::uniform_real_distribution<double> u(-size_m, size_m);
  Points p;
  for (int i = 0; i < n; ++i) push(p, u(engine), u(engine), u(engine));
  return p;
}

/** Ten voxels of 1 m with as many points as a warp takes at once, one less, one more, and thousands, in any order. */
inline Points unevenVoxels(unsigned seed) {
  std::mt19937 engine(seed);
  std::uniform_real_distribution<double> inside(0.01, 0.99);
  std::vector<std::array<double, 3>> rows;
  double voxel = -4;
  for (const int n : {1, 2, 31, 32, 33, 127, 128, 129, 257, 8000}) {
    for (int i = 0; i < n; ++i)
      rows.push_back({voxel + inside(engine), 3 + inside(engine), -2 + inside(engine)});
    voxel += 1;
  }
  std::shuffle(rows.begin(), rows.end(), engine);
  Points p;
  for (const auto& q : rows) push(p, q[0], q[1], q[2]);
  return p;
}

/** Covariances R diag R' with random positive eigenvalues. */
inline Covariances randomCovariances(unsigned seed, std::size_t n) {
  std::mt19937 engine(seed);
  std::uniform_real_distribution<double> u(-1, 1);
  Covariances C;
  for (std::size_t i = 0; i < n; ++i) {
    std::array<double, 6> c{0.05, 0, 0, 0.05, 0, 0.05};
    for (int k = 0; k < 3; ++k) {
      const double x = u(engine), y = u(engine), z = u(engine);
      c[0] += x * x, c[1] += x * y, c[2] += x * z, c[3] += y * y, c[4] += y * z, c[5] += z * z;
    }
    C.xx.push_back(static_cast<float>(c[0])), C.xy.push_back(static_cast<float>(c[1]));
    C.xz.push_back(static_cast<float>(c[2])), C.yy.push_back(static_cast<float>(c[3]));
    C.yz.push_back(static_cast<float>(c[4])), C.zz.push_back(static_cast<float>(c[5]));
    C.neighbours.push_back(10);
  }
  return C;
}

/** A hall of 24 x 14 x 4 m with a platform and two pillars, seen with 5 mm of noise: six directions are
 * constrained. */
inline Points hall(unsigned seed, int n) {
  std::mt19937 engine(seed);
  std::uniform_real_distribution<double> u(0, 1);
  std::normal_distribution<double> noise(0, 0.005);
  Points p;
  for (int i = 0; i < n; ++i) {
    const double a = u(engine), b = u(engine);
    std::array<double, 3> q{};
    switch (i % 8) {
      case 0:
      case 1:
        q = {24 * a - 12, 14 * b - 7, 0};
        break;
      case 2:
        q = {12, 14 * a - 7, 4 * b};
        break;
      case 3:
        q = {-12, 14 * a - 7, 4 * b};
        break;
      case 4:
        q = {24 * a - 12, 7, 4 * b};
        break;
      case 5:
        q = {24 * a - 12, -7, 4 * b};
        break;
      case 6:
        q = {3 + 4 * a, 1 + 3 * b, 1};
        break;
      default:
        q = {(i % 16 < 8 ? -4 : 6) + std::cos(6.283 * a), (i % 16 < 8 ? 3 : -3) + std::sin(6.283 * a), 4 * b};
    }
    // No plane on the face of a voxel of 1 m: noise would split it between two.
    push(p, q[0] + 0.3 + noise(engine), q[1] + 0.4 + noise(engine), q[2] + 0.35 + noise(engine));
  }
  return p;
}

inline std::array<double, 3> at(const Points& p, std::size_t i) {
  return {static_cast<double>(p.x[i]), static_cast<double>(p.y[i]), static_cast<double>(p.z[i])};
}

inline std::array<double, 3> applied(const Transform& T, const std::array<double, 3>& p) {
  std::array<double, 3> q = T.t;
  for (std::size_t i = 0; i < 3; ++i)
    for (std::size_t k = 0; k < 3; ++k) q[i] += T.R[3 * i + k] * p[k];
  return q;
}

inline Points applied(const Transform& T, const Points& p) {
  Points out;
  for (std::size_t i = 0; i < p.size(); ++i) {
    const auto q = applied(T, at(p, i));
    push(out, q[0], q[1], q[2]);
  }
  return out;
}

inline Transform inverse(const Transform& T) {
  Transform out;
  for (std::size_t i = 0; i < 3; ++i) {
    out.t[i] = 0;
    for (std::size_t k = 0; k < 3; ++k) {
      out.R[3 * i + k] = T.R[3 * k + i];
      out.t[i] -= T.R[3 * k + i] * T.t[k];
    }
  }
  return out;
}

inline Transform operator*(const Transform& A, const Transform& B) {
  Transform out;
  out.t = applied(A, B.t);
  for (std::size_t i = 0; i < 3; ++i)
    for (std::size_t j = 0; j < 3; ++j) {
      out.R[3 * i + j] = 0;
      for (std::size_t k = 0; k < 3; ++k) out.R[3 * i + j] += A.R[3 * i + k] * B.R[3 * k + j];
    }
  return out;
}

/** Turn about an axis by its length [rad], then the translation [m]. */
inline Transform pose(const std::array<double, 3>& turn_rad, const std::array<double, 3>& t_m) {
  Transform T = moved({}, {turn_rad[0], turn_rad[1], turn_rad[2], 0, 0, 0});
  T.t = t_m;
  return T;
}

inline double distance_m(const Transform& A, const Transform& B) {
  return std::hypot(A.t[0] - B.t[0], A.t[1] - B.t[1], A.t[2] - B.t[2]);
}

inline double angle_rad(const Transform& A, const Transform& B) {
  const Transform D = inverse(A) * B;
  const double sine = 0.5 * std::hypot(D.R[7] - D.R[5], D.R[2] - D.R[6], D.R[3] - D.R[1]);
  return std::atan2(sine, 0.5 * (D.R[0] + D.R[4] + D.R[8] - 1));
}

/** A scan with the time of each point and the poses of the sensor. */
struct MovingScan {
  Points scan;
  std::vector<float> time_s;
  std::vector<Affine> T_end_lidar;
  float sweep_s = 0.1F;
  [[nodiscard]] SweepView sweep() const { return {T_end_lidar.data(), T_end_lidar.size(), sweep_s}; }
};

/** Sees `scan` in a sweep of a car at 70 m/s in a bend, from bottom to top and a turn a row, with a sensor 1.5 m above
 * the ground. */
inline MovingScan moving(Points scan) {
  MovingScan out{std::move(scan), {}, {}};
  constexpr int steps = 32;
  for (int k = 0; k <= steps; ++k) {
    const double back = 1 - static_cast<double>(k) / steps;  // 1 at the begin
    const Transform T = pose({0.01 * back, -0.02 * back, -0.1 * back}, {-7 * back, 0.3 * back * back, 0}) *
                        pose({0, 0.03, 0.02}, {1, 0, 1.5});
    Affine entries{};
    for (std::size_t r = 0; r < 3; ++r) {
      for (std::size_t c = 0; c < 3; ++c) entries[4 * r + c] = static_cast<float>(T.R[3 * r + c]);
      entries[4 * r + 3] = static_cast<float>(T.t[r]);
    }
    out.T_end_lidar.push_back(entries);
  }
  for (std::size_t i = 0; i < out.scan.size(); ++i) {
    const double turn = std::atan2(out.scan.y[i], out.scan.x[i]) / 6.283185307179586 + 0.5;
    out.time_s.push_back(out.sweep_s * static_cast<float>(turn));
  }
  return out;
}

struct ScanPair {
  Points source, target;
  Transform T_target_source;  ///< good to 0.03 m and 0.8 deg
};

/** Binary little-endian PLY of floats that begin with x y z; nothing if it cannot be read. */
inline std::optional<Points> readPly(const std::string& path) {
  std::ifstream file(path, std::ios::binary);
  std::size_t vertices = 0, floats = 0;
  for (std::string line; std::getline(file, line) && line.rfind("end_header", 0) != 0;) {
    if (line.rfind("element vertex ", 0) == 0) vertices = std::stoul(line.substr(15));
    if (line.rfind("property float ", 0) == 0) ++floats;
  }
  if (!file || floats < 3) return std::nullopt;
  Points p;
  std::vector<float> row(floats);
  for (std::size_t i = 0; i < vertices; ++i) {
    file.read(reinterpret_cast<char*>(row.data()), static_cast<std::streamsize>(floats * sizeof(float)));
    push(p, static_cast<double>(row[0]), static_cast<double>(row[1]), static_cast<double>(row[2]));
  }
  if (!file) return std::nullopt;
  return p;
}

inline std::optional<ScanPair> readScanPair(const std::string& shared_data) {
  const std::string folder = shared_data + "/scan_pair/";
  auto source = readPly(folder + "source.ply"), target = readPly(folder + "target.ply");
  std::ifstream truth(folder + "T_target_source.txt");
  ScanPair pair;
  for (std::size_t i = 0; i < 3; ++i)
    truth >> pair.T_target_source.R[3 * i] >> pair.T_target_source.R[3 * i + 1] >>
        pair.T_target_source.R[3 * i + 2] >> pair.T_target_source.t[i];
  if (!source || !target || !truth) return std::nullopt;
  pair.source = std::move(*source);
  pair.target = std::move(*target);
  return pair;
}

}  // namespace raceloc::gpu::test
