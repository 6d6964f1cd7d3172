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

inline constexpr int kPassWarps = kPassThreads / simt::kWarp;

/** Lane k of the first warp gets the sum k over the blocks: each warp adds every kPassWarps-th block, in order, and the
 * warps are added in order. For a whole block. */
RACELOC_DEVICE double overBlocks(const double* partials, std::uint32_t blocks) {
  using PartSums = double[kPassWarps][kSums];
  RACELOC_SHARED(PartSums, of_part);
  double part = 0;
  std::uint32_t b = simt::warp();
  constexpr std::uint32_t at_once = 8;  // so that their loads overlap
  for (; b + (at_once - 1) * kPassWarps < blocks; b += at_once * kPassWarps) {
    double of_block[at_once];
    RACELOC_UNROLL
    for (std::uint32_t j = 0; j < at_once; ++j)
      of_block[j] = simt::fromOtherBlock(partials[(b + j * kPassWarps) * kSums + simt::lane()]);
    RACELOC_UNROLL
    for (const double one : of_block) part += one;
  }
  for (; b < blocks; b += kPassWarps) part += simt::fromOtherBlock(partials[b * kSums + simt::lane()]);
  of_part[simt::warp()][simt::lane()] = part;
  simt::barrier();
  double sum = 0;
  RACELOC_UNROLL
  for (const auto& sums : of_part) sum += sums[simt::lane()];
  return sum;
}

/** Sums of the block go to partials[block][kSums]; the last block to get there adds them. \param sums  of the host */
RACELOC_KERNEL(kPassThreads)
vgicpPass(PassInput in, double* partials, std::uint32_t* blocks_done, double* sums) {
  using WarpSums = float[kPassWarps][kSums];
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
  if (simt::warp() == 0) {
    double sum = 0;
    RACELOC_UNROLL
    for (const auto& warp_sums : of_warp) sum += static_cast<double>(warp_sums[simt::lane()]);
    partials[simt::block().x * kSums + simt::lane()] = sum;
  }
  if (!simt::lastBlockHere(*blocks_done)) return;
  const double sum = overBlocks(partials, simt::blocks().x);
  if (simt::warp() == 0) sums[simt::lane()] = sum;
}

}  // namespace raceloc::gpu
