/** \file
 * A raw scan made ready for a match, in one call. */
#pragma once

#include <cstdint>

#include "raceloc/gpu/context.h"
#include "raceloc/gpu/covariance.h"
#include "raceloc/gpu/deskew.h"
#include "raceloc/gpu/types.h"

namespace raceloc::gpu {

/** Points in the frame of the end of the sweep, one a voxel, with their covariances. */
struct PreparedScan {
  Points points;
  Covariances covariances;
  /** The copy that the context's device keeps until its next prepare(), voxelGrid() or covariances(); 0: none. */
  std::uint64_t on_device = 0;
};

/** The same bits as deskew(), voxelGrid() and covariances() one after another, but what is between them stays on the
 * device. \param full  may be null; else it takes what deskew() gives, at the price of its way back
 * \param into  what is no longer needed: its memory is used again, as that of `full`
 * \throws std::invalid_argument as they do */
[[nodiscard]] PreparedScan prepare(Context& context, const PointsView& scan_lidar, const float* time_s,
                                   const SweepView& sweep, const Crop& crop, float voxel_size_m,
                                   const CovarianceOptions& options, Deskewed* full = nullptr,
                                   PreparedScan into = {});

}  // namespace raceloc::gpu
