/** \file
 * Downsampling: one point a voxel. */
#pragma once

#include "raceloc/gpu/context.h"
#include "raceloc/gpu/types.h"

namespace raceloc::gpu {

/** Centroids of the points in each occupied voxel of the grid with corners at multiples of `voxel_size_m`,
 * in ascending order of (z, y, x) voxel: the same bits every time. Devices differ at most in the last place, and only
 * where a sum in double of a voxel's floats is not exact. Points that are not finite or farther than 2^20 voxels from
 * the origin are dropped; `dropped` (may be null) counts them. \param into  what is no longer needed: its memory is
 * used again
 * \throws std::invalid_argument if voxel_size_m is not > 0. */
[[nodiscard]] Points voxelGrid(Context& context, const PointsView& points, float voxel_size_m,
                               std::size_t* dropped = nullptr, Points into = {});

}  // namespace raceloc::gpu
