/** \file
 * A scan into the frame of its end: one thread a point; what is kept is then brought together, in the order of the
 * scan. */
#pragma once

#include <cmath>

#include "core/deskew.hpp"
#include "kernels/rows.hpp"
#include "kernels/simt.hpp"

namespace raceloc::gpu {

inline constexpr int kDeskewThreads = 256;

/** kept[i] is 1 or 0; their inclusive sum numbers the kept points from 1. The others are moved to NaN. */
RACELOC_KERNEL(kDeskewThreads)
deskewPoints(DeskewJob job, PointsOut moved, std::uint32_t* kept) {
  const std::uint32_t i = simt::globalThread();
  if (i >= job.scan.size) return;
  Vec3<float> p_end{};
  kept[i] = deskewed(job, i, p_end) ? 1 : 0;
  moved.x[i] = kept[i] != 0 ? p_end.x : NAN;
  moved.y[i] = p_end.y;
  moved.z[i] = p_end.z;
}

RACELOC_KERNEL(kDeskewThreads)
compact(PointsView moved, const std::uint32_t* kept, const std::uint32_t* numbers, DeskewedOut out) {
  const std::uint32_t i = simt::globalThread();
  if (i >= moved.size || kept[i] == 0) return;
  const std::uint32_t to = numbers[i] - 1;
  out.x[to] = moved.x[i];
  out.y[to] = moved.y[i];
  out.z[to] = moved.z[i];
  out.index[to] = i;
}

}  // namespace raceloc::gpu
