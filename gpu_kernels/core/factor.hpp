/** \file
 * The VGICP factor: residual e = mean - (R p + t), combined covariance C_map + R C_source R', right increment
 * T Exp(xi), xi = (rotation, translation); the covariance is held while e is differentiated. All of it is
 * written turned into the sensor's frame, R'e and C_source + R' C_map R, where the Jacobian ([p]x, -I) has no
 * R and no large number. Sources: see raceloc/gpu/matcher.h. */
#pragma once

#include <cstdint>

#include "core/linear.hpp"
#include "core/voxel_hash.hpp"

namespace raceloc::gpu {

/** Places in the vector of sums of a pass. The counts are exact: floats over at most 2^24 pairs, then
 * doubles. */
enum Sum : int {
  kHtt = 0,
  kHrt = 6,
  kHrr = 15,
  kB = 21,
  kCost = 27,
  kPairs,
  kInliers,
  kFrozenCost,
  kDistance,
  kSums
};

template <class T>
struct Whitened {
  Vec3<T> e;  ///< residual [m]
  Sym3<T> W;  ///< inverse of the combined covariance [1/m^2]
  T squared;  ///< e' W e
  /** False if the covariance has no inverse in float, or anything is not finite. */
  decltype(T(0) > T(0)) valid;
};

/** \param v  mean of the voxel - t, map frame [m] */
template <class T>
RACELOC_HD Whitened<T> whitened(const Mat3<T>& R_source_map, const Vec3<T>& p, const Sym3<T>& C_source,
                                const Vec3<T>& v, const Sym3<T>& C_map) {
  Whitened<T> w{};
  w.e = R_source_map * v - p;
  const Sym3<T> C = C_source + turned(R_source_map, C_map);
  const Sym3<T> adj = adjugate(C);
  const T determinant = C.xx * adj.xx + C.xy * adj.xy + C.xz * adj.xz;
  const T size = trace(C);
  w.W = (T(1) / determinant) * adj;
  w.squared = dot(w.e, w.W * w.e);
  // A determinant below 1e-7 of the cube is rounding; a comparison with NaN is false.
  w.valid = (size > T(0)) & (determinant > T(1e-7 / 27) * size * size * size) & (w.squared >= T(0)) &
            (w.squared < T(1e30));
  return w;
}

/** A pair that does not count unless `counts`: all its shares are then 0. */
template <class T, class M>
RACELOC_HD Whitened<T> countedIf(const M& counts, const Whitened<T>& w) {
  const Vec3<T> nowhere{T(0), T(0), T(0)};
  return {select(counts, w.e, nowhere), select(counts, w.W, isotropic(T(0))), select(counts, w.squared, T(0)),
          counts};
}

/** Cauchy: rho(s) = c^2 log(1 + s/c^2), or s itself for c = 0. */
struct Robust {
  float squared_width;
  template <class T>
  RACELOC_HD T cost(T s) const {
    return squared_width > 0 ? T(squared_width) * logarithm(T(1) + s / T(squared_width)) : s;
  }
  /** drho/ds */
  template <class T>
  RACELOC_HD T weight(T s) const {
    return squared_width > 0 ? T(squared_width) / (T(squared_width) + s) : T(1);
  }
};

/** Adds a pair's share of H, b, the cost and the distance. H is symmetric: only H_tt, H_rt and H_rr are kept.
 */
template <class T>
RACELOC_HD void addPair(const Whitened<T>& w, const Vec3<T>& p, const Robust& robust, T* sums) {
  const Sym3<T> W = robust.weight(w.squared) * w.W;
  const Vec3<T> We = W * w.e;
  // M = [p]x W, H_rt = [p]x' W (-I) = M, H_rr = [p]x' W [p]x = M [p]x'
  const Mat3<T> M{p.y * W.xz - p.z * W.xy, p.y * W.yz - p.z * W.yy, p.y * W.zz - p.z * W.yz,
                  p.z * W.xx - p.x * W.xz, p.z * W.xy - p.x * W.yz, p.z * W.xz - p.x * W.zz,
                  p.x * W.xy - p.y * W.xx, p.x * W.yy - p.y * W.xy, p.x * W.yz - p.y * W.xz};
  const Vec3<T> b_r = cross(We, p);
  sums[kHtt + 0] += W.xx, sums[kHtt + 1] += W.xy, sums[kHtt + 2] += W.xz;
  sums[kHtt + 3] += W.yy, sums[kHtt + 4] += W.yz, sums[kHtt + 5] += W.zz;
  sums[kHrt + 0] += M.xx, sums[kHrt + 1] += M.xy, sums[kHrt + 2] += M.xz;
  sums[kHrt + 3] += M.yx, sums[kHrt + 4] += M.yy, sums[kHrt + 5] += M.yz;
  sums[kHrt + 6] += M.zx, sums[kHrt + 7] += M.zy, sums[kHrt + 8] += M.zz;
  sums[kHrr + 0] += M.xz * p.y - M.xy * p.z;
  sums[kHrr + 1] += M.xx * p.z - M.xz * p.x;
  sums[kHrr + 2] += M.xy * p.x - M.xx * p.y;
  sums[kHrr + 3] += M.yx * p.z - M.yz * p.x;
  sums[kHrr + 4] += M.yy * p.x - M.yx * p.y;
  sums[kHrr + 5] += M.zy * p.x - M.zx * p.y;
  sums[kB + 0] += b_r.x, sums[kB + 1] += b_r.y, sums[kB + 2] += b_r.z;
  sums[kB + 3] -= We.x, sums[kB + 4] -= We.y, sums[kB + 5] -= We.z;
  sums[kCost] += T(0.5) * robust.cost(w.squared);
  sums[kPairs] += select(w.valid, T(1), T(0));
  sums[kDistance] += w.squared / select(w.valid, trace(w.W), T(1));
}

/** A pass at one pose. Positions are relative to the corner of the voxel `anchor` at t: floats stay small. */
struct PassSetup {
  Mat3<float> R_map_source;
  Vec3<float> t_m;  ///< of the source, from the anchor's corner
  Cell anchor;
  float voxel_m, voxels_per_m;
  float squared_max_distance_m2;
  Robust robust;
  std::int32_t voxels_around;  ///< 1, 7 or 27
};

/** k-th voxel around one: first itself, then 6 faces (of 7) or the whole cube (of 27). */
RACELOC_HD Cell voxelAround(const Cell& c, std::int32_t k, std::int32_t voxels_around) {
  if (k == 0) return c;
  if (voxels_around == 7) {
    const std::int32_t side = (k & 1) != 0 ? -1 : 1, axis = (k - 1) / 2;
    return {c.x + (axis == 0 ? side : 0), c.y + (axis == 1 ? side : 0), c.z + (axis == 2 ? side : 0)};
  }
  const std::int32_t place = k <= 13 ? k - 1 : k;  // 13 is the middle of the cube
  return {c.x + place % 3 - 1, c.y + place / 3 % 3 - 1, c.z + place / 9 - 1};
}

RACELOC_HD Whitened<float> pairWith(const PassSetup& setup, const VoxelRecord& record, const Vec3<float>& p,
                                    const Sym3<float>& C_source) {
  const auto centre = [&](std::int32_t cell, std::int32_t anchor) {
    return (static_cast<float>(cell - anchor) + 0.5F) * setup.voxel_m;
  };
  const Vec3<float> mean =
      Vec3<float>{centre(record.cell.x, setup.anchor.x), centre(record.cell.y, setup.anchor.y),
                  centre(record.cell.z, setup.anchor.z)} +
      record.offset_m;
  return whitened(transposed(setup.R_map_source), p, C_source, mean - setup.t_m, record.covariance_m2);
}

/** The pass of one source point: adds to `sums` and notes its pairs (record or -1), pair k at fresh[k *
 * stride]. The frozen cost is that of the pairs in `frozen` (may be null) at this pose: what a step may be
 * judged by, since the fresh cost jumps where a point changes its voxel. */
RACELOC_HD void passPoint(const PassSetup& setup, const VoxelMapView& map, const Vec3<float>& p,
                          const Sym3<float>& C_source, std::size_t stride, const std::int32_t* frozen,
                          std::int32_t* fresh, float* sums) {
  const Vec3<float> q = setup.voxels_per_m * (setup.R_map_source * p + setup.t_m);
  constexpr auto limit = static_cast<float>(2 * kCellLimit);
  const bool somewhere =
      std::fabs(q.x) < limit && std::fabs(q.y) < limit && std::fabs(q.z) < limit;  // not NaN
  const Cell cell = somewhere ? Cell{setup.anchor.x + floorToInt(q.x), setup.anchor.y + floorToInt(q.y),
                                     setup.anchor.z + floorToInt(q.z)}
                              : Cell{-4 * kCellLimit, 0, 0};
  bool inlier = false;
  for (std::int32_t k = 0; k < setup.voxels_around; ++k) {
    std::int32_t found = findRecord(map, voxelAround(cell, k, setup.voxels_around));
    float cost = 0;
    if (found >= 0) {
      const Whitened<float> w = pairWith(setup, map.records[found], p, C_source);
      if (w.valid && dot(w.e, w.e) <= setup.squared_max_distance_m2) {
        inlier = true;
        addPair(w, p, setup.robust, sums);
        cost = 0.5F * setup.robust.cost(w.squared);
      } else {
        found = -1;
      }
    }
    fresh[static_cast<std::size_t>(k) * stride] = found;
    if (frozen == nullptr) continue;
    const std::int32_t before = frozen[static_cast<std::size_t>(k) * stride];
    if (before >= 0 && before != found) {
      cost = 0.5F * setup.robust.cost(pairWith(setup, map.records[before], p, C_source).squared);
    }
    if (before >= 0) sums[kFrozenCost] += cost;
  }
  if (inlier) sums[kInliers] += 1.0F;
}

}  // namespace raceloc::gpu
