/** \file
 * Covariances, one thread a point in cell order: the threads of a warp share their cells. */
#pragma once

#include "core/neighbour_grid.hpp"
#include "kernels/simt.hpp"

namespace raceloc::gpu {

inline constexpr int kCovarianceThreads = 128;

template <class WeightOf>
RACELOC_KERNEL(kCovarianceThreads)
covarianceOfPoints(PointsView sorted, const std::uint32_t* order, const std::uint32_t* numbers,
                   const Run* runs, CovarianceSetup setup, WeightOf weightOf, CovariancesOut out) {
  const std::uint32_t k = simt::globalThread();
  if (k >= sorted.size) return;
  std::int32_t neighbours = 0;
  const Run* around = runs + static_cast<std::size_t>(numbers[k] - 1) * kRowsAround;
  const Sym3<float> C =
      covarianceAt({sorted.x[k], sorted.y[k], sorted.z[k]}, sorted, around, setup, weightOf, neighbours);
  const std::uint32_t i = order[k];
  out.xx[i] = C.xx;
  out.xy[i] = C.xy;
  out.xz[i] = C.xz;
  out.yy[i] = C.yy;
  out.yz[i] = C.yz;
  out.zz[i] = C.zz;
  out.neighbours[i] = neighbours;
}

}  // namespace raceloc::gpu
