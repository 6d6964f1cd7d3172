/** \file
 * One VGICP pass: one thread a source point, floats within a block, doubles over the blocks, every sum in a
 * fixed order. */
#pragma once

#include "core/factor.hpp"
#include "kernels/simt.hpp"

namespace raceloc::gpu {

inline constexpr int kPassThreads = 128;
static_assert(kSums == simt::kWarp, "one lane a sum");

/** Sums v[k] over the warp and leaves sum k in v[0] of lane k: each step halves the values a lane still
 * carries, 31 shuffles instead of 160. A template, because a loop that is not unrolled would index v in
 * memory. */
template <int Half>
RACELOC_DEVICE void transposeReduce(float (&v)[kSums]) {
  const bool upper = (simt::lane() & Half) != 0;
  RACELOC_UNROLL
  for (int i = 0; i < Half; ++i) {
    const float keep = upper ? v[i + Half] : v[i], give = upper ? v[i] : v[i + Half];
    v[i] = keep + simt::fromLaneXor(give, Half);
  }
  if constexpr (Half > 1) transposeReduce<Half / 2>(v);
}

struct PassInput {
  PointsView points;
  CovariancesView covariances;
  VoxelMapView map;
  PassSetup setup;
  const std::int32_t* frozen;  ///< may be null
  std::int32_t* fresh;
};

/** Partial sums of the block go to partials[block][kSums]. */
RACELOC_KERNEL(kPassThreads)
vgicpPass(PassInput in, double* partials) {
  using WarpSums = float[kPassThreads / simt::kWarp][kSums];
  RACELOC_SHARED(WarpSums, of_warp);
  float v[kSums] = {};
  const std::uint32_t i = simt::globalThread();
  if (i < in.points.size) {
    const CovariancesView& C = in.covariances;
    passPoint(in.setup, in.map, {in.points.x[i], in.points.y[i], in.points.z[i]},
              {C.xx[i], C.xy[i], C.xz[i], C.yy[i], C.yz[i], C.zz[i]}, in.points.size,
              in.frozen == nullptr ? nullptr : in.frozen + i, in.fresh + i, v);
  }
  transposeReduce<simt::kWarp / 2>(v);
  of_warp[simt::warp()][simt::lane()] = v[0];
  simt::barrier();
  if (simt::warp() != 0) return;
  double sum = 0;
  RACELOC_UNROLL
  for (const auto& sums : of_warp) sum += static_cast<double>(sums[simt::lane()]);
  partials[static_cast<std::size_t>(simt::block().x) * kSums + simt::lane()] = sum;
}

/** One warp: lane k adds the blocks' sums k in order. */
RACELOC_KERNEL(simt::kWarp)
addPartials(const double* partials, std::uint32_t blocks, double* sums) {
  double sum = 0;
  for (std::uint32_t b = 0; b < blocks; ++b)
    sum += partials[static_cast<std::size_t>(b) * kSums + simt::lane()];
  sums[simt::lane()] = sum;
}

}  // namespace raceloc::gpu
