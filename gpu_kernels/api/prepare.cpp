#include "raceloc/gpu/prepare.h"

#include <utility>

#include "api/check.hpp"
#include "api/deskew_job.hpp"
#include "core/backend.hpp"
#include "raceloc/gpu/voxel_grid.h"

namespace raceloc::gpu {

PreparedScan prepare(Context& context, const PointsView& scan_lidar, const float* time_s,
                     const SweepView& sweep, const Crop& crop, float voxel_size_m,
                     const CovarianceOptions& options, Deskewed* full, PreparedScan into) {
  BackendBase& backend = context.implementation();
  backend.sweep_steps = sweepSteps(sweep, time_s != nullptr, std::move(backend.sweep_steps));
  const DeskewJob job = deskewJob(scan_lidar, time_s, sweep, backend.sweep_steps, crop);
  requirePositive("voxel_size_m", voxel_size_m);
  requireGood(options);
  if (options.neighbourhood == Neighbourhood::nearest) {  // on the CPU, whatever the context
    Deskewed moved = backend.deskew(job, full == nullptr ? Deskewed{} : std::move(*full));
    into.points = voxelGrid(context, moved.points.view(), voxel_size_m, nullptr, std::move(into.points));
    into.covariances = covariances(context, into.points.view(), options, std::move(into.covariances));
    into.on_device = 0;
    if (full != nullptr) *full = std::move(moved);
    return into;
  }
  return backend.prepare(job, static_cast<double>(voxel_size_m), options, full, std::move(into));
}

}  // namespace raceloc::gpu
