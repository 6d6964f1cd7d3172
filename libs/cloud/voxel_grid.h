/** \file
 * One point a voxel. */
#pragma once

#include <raceloc/gpu/context.h>

#include "core/types.h"

namespace raceloc {

/** Centroids of the occupied voxels of edge `voxel_size_m`, in the order of their voxels; without intensity.
 * Points that are not finite are dropped. \param into  what is no longer needed: its memory is used again
 * \throws std::invalid_argument if the size is not > 0. */
[[nodiscard]] Cloud voxelGrid(gpu::Context& context, const Cloud& cloud, double voxel_size_m,
                              Cloud into = {});

}  // namespace raceloc
