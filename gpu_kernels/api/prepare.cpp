#include "raceloc/gpu/prepare.h"

#include <utility>

#include "api/check.hpp"
#include "api/deskew_job.hpp"
#include "core/backend.hpp"
#include "raceloc/gpu/voxel_grid.h"

namespace raceloc::gpu {

PreparedScan prepare(Context& context, const PointsView& scan_lidar, const float* time_s,
                     const SweepView& sweep, const Crop& crop, float voxel_size_m,
                     const CovarianceOptions& options, Deskewed* full) {
  const std::vector<SweepStep> steps = sweepSteps(sweep, time_s != nullptr);
  const DeskewJob job = deskewJob(scan_lidar, time_s, sweep, steps, crop);
  requirePositive("voxel_size_m", voxel_size_m);
  requireGood(options);
  if (options.neighbourhood == Neighbourhood::nearest) {  // on the CPU, whatever the context
    Deskewed moved = context.implementation().deskew(job);
    PreparedScan out{voxelGrid(context, moved.points.view(), voxel_size_m), {}};
    out.covariances = covariances(context, out.points.view(), options);
    if (full != nullptr) *full = std::move(moved);
    return out;
  }
  return context.implementation().prepare(job, static_cast<double>(voxel_size_m), options, full);
}

}  // namespace raceloc::gpu
