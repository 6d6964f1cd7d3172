/** \file
 * Plain values of the kernels' border: no CUDA, Eigen or MRPT type crosses it.
 * Points and covariances travel as structures of arrays of float, poses in double. */
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <stdexcept>
#include <string>
#include <vector>

namespace raceloc::gpu {

/** Points that somebody else owns [m]. */
struct PointsView {
  const float* x;
  const float* y;
  const float* z;
  std::size_t size;
};

/** Symmetric 3x3 covariances that somebody else owns, upper triangles [m^2]. */
struct CovariancesView {
  const float *xx, *xy, *xz, *yy, *yz, *zz;
  std::size_t size;
};

/** Points with storage. */
struct Points {
  std::vector<float> x, y, z;
  [[nodiscard]] std::size_t size() const { return x.size(); }
  [[nodiscard]] PointsView view() const { return {x.data(), y.data(), z.data(), x.size()}; }
};

/** Covariances with storage, and the number of neighbours each was made from (the point itself included). */
struct Covariances {
  std::vector<float> xx, xy, xz, yy, yz, zz;
  std::vector<std::int32_t> neighbours;
  [[nodiscard]] std::size_t size() const { return xx.size(); }
  [[nodiscard]] CovariancesView view() const {
    return {xx.data(), xy.data(), xz.data(), yy.data(), yz.data(), zz.data(), xx.size()};
  }
};

/** Rigid transform p -> R p + t; R row by row. */
struct Transform {
  std::array<double, 9> R{1, 0, 0, 0, 1, 0, 0, 0, 1};
  std::array<double, 3> t{0, 0, 0};
};

/** A device that was asked for and is not there, or a call of its driver that failed: call, place and reason.
 */
class DeviceError : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

}  // namespace raceloc::gpu
