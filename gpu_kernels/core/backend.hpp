/** \file
 * The seam between the border (api/) and a device: what cpu/, cuda/ and cuda_stub/ each implement. */
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "core/deskew.hpp"
#include "core/factor.hpp"
#include "raceloc/gpu/context.h"
#include "raceloc/gpu/covariance.h"
#include "raceloc/gpu/deskew.h"
#include "raceloc/gpu/matcher.h"
#include "raceloc/gpu/nearest_target.h"
#include "raceloc/gpu/prepare.h"
#include "raceloc/gpu/standing.h"
#include "raceloc/gpu/types.h"

namespace raceloc::gpu {

struct Loops;
class VoxelTable;

/** A voxel map's copy on a device. */
class MapMirror {
 public:
  virtual ~MapMirror() = default;
  virtual void upload(const VoxelTable& table) = 0;
};

/** Sums of a pass over all source points. */
struct Pass {
  std::array<double, kSums> sums{};
};

/** VGICP passes of one source against one map. The caller keeps both alive and does not change them. */
class PassRunner {
 public:
  virtual ~PassRunner() = default;
  /** The sums at a pose; kFrozenCost is over the frozen pairs, 0 before the first freeze(). */
  virtual Pass run(const Transform& T_map_source) = 0;
  /** The pairs of the newest pass become the frozen ones. */
  virtual void freeze() = 0;
};

class BackendBase {
 public:
  virtual ~BackendBase() = default;
  [[nodiscard]] virtual Backend kind() const = 0;
  [[nodiscard]] virtual std::string description() const = 0;  ///< device, for the log
  // What comes back is in the memory of `into`, as far as that goes.
  virtual Deskewed deskew(const DeskewJob& job, Deskewed into = {}) = 0;
  virtual Points voxelGrid(const PointsView& points, double voxel_size_m, std::size_t& dropped,
                           Points into = {}) = 0;
  virtual Covariances covariances(const PointsView& points, const CovarianceOptions& options,
                                  Covariances into = {}) = 0;
  virtual PreparedScan prepare(const DeskewJob& job, double voxel_size_m, const CovarianceOptions& options,
                               Deskewed* full, PreparedScan into = {}) = 0;
  virtual StandingCells standingCells(const PointsView& points, const StandingOptions& options,
                                      std::vector<std::uint8_t>* is_standing, StandingCells into = {}) = 0;
  virtual std::vector<std::int32_t> clusters(const PointsView& points, float radius_m,
                                             std::vector<std::int32_t> into = {}) = 0;
  virtual std::unique_ptr<MapMirror> mirror() = 0;  ///< null where the host's table serves
  /** Good until the next call: a backend has one runner, which works in its buffers. \param mirror of this
   * backend */
  virtual PassRunner& passes(const PointsView& source, const CovariancesView& covariances,
                             const VoxelTable& table, const MapMirror* mirror,
                             const MatchOptions& options) = 0;
  /** As passes(); a device takes its own copy of the source if it has one. */
  virtual PassRunner& passes(const PreparedScan& source, const VoxelTable& table, const MapMirror* mirror,
                             const MatchOptions& options) {
    return passes(source.points.view(), source.covariances.view(), table, mirror, options);
  }
  /** As passes(), with the nearest point as pair; of the CPU's backend only. */
  virtual PassRunner& nearestPasses(const PointsView&, const CovariancesView&, const NearestTarget::Storage&,
                                    const MatchOptions&) {
    throw std::logic_error("nearest-point passes run on the CPU");
  }

  std::vector<SweepStep> sweep_steps;  ///< of the newest job, which refers to them; kept from call to call
};

/** \param threads >= 1; without TBB in the build it is 1 */
std::unique_ptr<BackendBase> makeCpuBackend(int threads);
std::unique_ptr<BackendBase> makeCpuBackend(int threads, const Loops& loops);  ///< with loops of loopsHere()

/** \throws DeviceError with the reason if there is no usable device or CUDA was not built in */
std::unique_ptr<BackendBase> makeCudaBackend(int device);

/** The float setup of a pass. \param voxel_size_m 0 for a target of points: they are their records' offsets. */
PassSetup passSetup(const Transform& T_map_source, double voxel_size_m, const MatchOptions& options);

/** The Gauss-Newton system of a pass. */
Linearization linearization(const Pass& pass);

}  // namespace raceloc::gpu
