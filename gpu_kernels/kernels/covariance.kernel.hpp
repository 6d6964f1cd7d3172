/** \file
 * Covariances, a few threads a point in cell order: the threads of a warp share their cells. */
#pragma once

#include "core/neighbour_grid.hpp"
#include "kernels/simt.hpp"

namespace raceloc::gpu {

inline constexpr int kCovarianceThreads = 128;

/** Threads that share the neighbours of a point: a thinned scan alone has too few points to hide a load behind others. */
inline constexpr std::uint32_t kThreadsAPoint = 4;

/** The sums of the threads of a point, given to all of them. */
RACELOC_DEVICE Moments<float> overPoint(Moments<float> m) {
  RACELOC_UNROLL
  for (int mask = 1; mask < static_cast<int>(kThreadsAPoint); mask *= 2) {
    const auto from = [mask](float value) { return simt::fromLaneXor(value, mask); };
    m.add({from(m.weight),
           {from(m.first.x), from(m.first.y), from(m.first.z)},
           {from(m.second.xx), from(m.second.xy), from(m.second.xz), from(m.second.yy), from(m.second.yz),
            from(m.second.zz)},
           from(m.neighbours)});
  }
  return m;
}

template <class WeightOf>
RACELOC_KERNEL(kCovarianceThreads)
covarianceOfPoints(PointsView sorted, const std::uint32_t* order, const std::uint32_t* numbers,
                   const Run* runs, CovarianceSetup setup, WeightOf weightOf, CovariancesOut out) {
  const std::uint32_t place = simt::globalThread() / kThreadsAPoint,
                      part = simt::globalThread() % kThreadsAPoint;
  const bool is_there = place < sorted.size;
  const std::size_t k = is_there ? place : sorted.size - 1;  // to the end, because of the shuffles
  const Run* around = runs + static_cast<std::size_t>(numbers[k] - 1) * kRowsAround;
  const Moments<float> moments =
      overPoint(momentsAt({sorted.x[k], sorted.y[k], sorted.z[k]}, sorted, around, part, kThreadsAPoint,
                          setup.squared_radius_m2, weightOf));
  if (!is_there || part != 0) return;
  const Sym3<float> C = finished(moments, setup);
  const std::uint32_t i = order[k];
  out.xx[i] = C.xx;
  out.xy[i] = C.xy;
  out.xz[i] = C.xz;
  out.yy[i] = C.yy;
  out.yz[i] = C.yz;
  out.zz[i] = C.zz;
  out.neighbours[i] = static_cast<std::int32_t>(moments.neighbours);
}

}  // namespace raceloc::gpu
