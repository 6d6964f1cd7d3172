/** \file
 * Cell list for neighbours within a radius: points sorted by cell, x fastest, so that the three cells beside
 * each other in x are one run of points and a neighbourhood is nine runs. */
#pragma once

#include <algorithm>
#include <cstdint>

#include "core/cell.hpp"
#include "core/eig3.hpp"
#include "core/linear.hpp"
#include "core/moments.hpp"
#include "raceloc/gpu/types.h"

namespace raceloc::gpu {

/** Points [first, last) of the sorted cloud. */
struct Run {
  std::uint32_t first, last;
};

inline constexpr int kRowsAround = 9;

struct NeighbourGrid {
  KeyLayout layout;
  double cell_m = 1;

  /** Cell of a point. Indices are clamped: that keeps neighbours in neighbouring cells whatever the extent.
   */
  [[nodiscard]] RACELOC_HD Cell cell(double x, double y, double z) const {
    return {clamped(x / cell_m), clamped(y / cell_m), clamped(z / cell_m)};
  }

  /** Key of the first cell of row `row` around the cell with key `key`; the row's last cell is two further.
   */
  [[nodiscard]] RACELOC_HD std::uint64_t rowKey(std::uint64_t key, int row) const {
    const std::uint64_t y = std::uint64_t{1} << layout.shift_y, z = std::uint64_t{1} << layout.shift_z;
    return key - z - y - 1 + static_cast<std::uint64_t>(row / 3) * z +
           static_cast<std::uint64_t>(row % 3) * y;
  }

  /** Grid over all points of a box. It has an empty ring, so that a row beside the border is no other row. */
  static NeighbourGrid over(const Vec3<double>& low_m, const Vec3<double>& high_m, float radius_m) {
    NeighbourGrid grid;
    grid.cell_m =
        static_cast<double>(radius_m) * (1 + 1e-6);  // rounding must not put neighbours two cells apart
    const Cell low = grid.cell(low_m.x, low_m.y, low_m.z), high = grid.cell(high_m.x, high_m.y, high_m.z);
    grid.layout = KeyLayout::of({low.x - 1, low.y - 1, low.z - 1}, {high.x + 1, high.y + 1, high.z + 1});
    return grid;
  }

  /** Grid over finite points. */
  static NeighbourGrid over(const PointsView& p, float radius_m) {
    if (p.size == 0) return over(Vec3<double>{0, 0, 0}, Vec3<double>{0, 0, 0}, radius_m);
    const Range x = rangeOf(p.x, p.size), y = rangeOf(p.y, p.size), z = rangeOf(p.z, p.size);
    return over(Vec3<double>{x.low, y.low, z.low}, Vec3<double>{x.high, y.high, z.high}, radius_m);
  }

 private:
  struct Range {
    float low, high;
  };

  /** Eight running ranges, which a compiler makes vectors of. */
  static Range rangeOf(const float* v, std::size_t n) {
    constexpr std::size_t lanes = 8;
    float low[lanes], high[lanes];
    for (std::size_t k = 0; k < lanes; ++k) low[k] = high[k] = v[0];
    const auto take = [&](std::size_t i, std::size_t k) {
      low[k] = v[i] < low[k] ? v[i] : low[k];
      high[k] = v[i] > high[k] ? v[i] : high[k];
    };
    std::size_t i = 0;
    for (; i + lanes <= n; i += lanes)
      for (std::size_t k = 0; k < lanes; ++k) take(i + k, k);
    for (; i < n; ++i) take(i, 0);
    return {*std::min_element(low, low + lanes), *std::max_element(high, high + lanes)};
  }

  static RACELOC_HD std::int32_t clamped(double index) {
    constexpr double limit = kCellLimit - 2;  // with the ring, still 21 bits
    return floorToInt(index < -limit ? -limit : (index > limit ? limit : index));
  }
};

/** Where covariances go, in the order of the caller's points. */
struct CovariancesOut {
  float *xx, *xy, *xz, *yy, *yz, *zz;
  std::int32_t* neighbours;
};

/** What one point's covariance needs besides its neighbours. */
struct CovarianceSetup {
  float squared_radius_m2, epsilon;
  Regularisation regularisation;
  std::int32_t min_neighbours;

  RACELOC_HD static CovarianceSetup of(const CovarianceOptions& o) {
    return {o.radius_m * o.radius_m, o.plane_epsilon, o.regularisation, o.min_neighbours};
  }
};

/** What a neighbourhood's moments say of the surface. */
template <class T>
RACELOC_HD Sym3<T> finished(const Moments<T>& moments, const CovarianceSetup& setup) {
  const T squared_radius_m2(setup.squared_radius_m2);
  return select(moments.neighbours < T(setup.min_neighbours),
                unknownSurface(setup.regularisation, squared_radius_m2),
                regularised(moments.covariance(), setup.regularisation, T(setup.epsilon), squared_radius_m2));
}

/** Takes every `stride`-th point of each of nine runs, from the one numbered `first` on, as neighbours of the point q;
 * `p` is the sorted cloud. */
template <class WeightOf>
RACELOC_HD Moments<float> momentsAt(const Vec3<float>& q, const PointsView& p, const Run* runs,
                                    std::uint32_t first, std::uint32_t stride, float squared_radius_m2,
                                    const WeightOf& weightOf) {
  Moments<float> moments;
  for (int row = 0; row < kRowsAround; ++row) {
    const Run run = runs[row];
    for (std::uint32_t j = run.first + first; j < run.last; j += stride)
      moments.add({p.x[j] - q.x, p.y[j] - q.y, p.z[j] - q.z}, squared_radius_m2, weightOf);
  }
  return moments;
}

}  // namespace raceloc::gpu
