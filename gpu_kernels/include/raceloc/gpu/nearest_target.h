/** \file
 * The target of GICP: points with covariances, of which the nearest one is a source point's pair. Source: Segal et
 * al., RSS 2009. */
#pragma once

#include <memory>

#include "raceloc/gpu/context.h"
#include "raceloc/gpu/types.h"

namespace raceloc::gpu {

/** Built once; reading it never changes it, so many threads may. Searches run on the CPU, with the threads of the
 * context if that is the CPU's; a GPU has the voxel map. */
class NearestTarget {
 public:
  /** Takes copies. Points that are not finite are left out; `dropped()` counts them.
   * \throws std::invalid_argument if the sizes differ */
  NearestTarget(const PointsView& points, const CovariancesView& covariances);
  ~NearestTarget();
  NearestTarget(NearestTarget&&) noexcept;
  NearestTarget& operator=(NearestTarget&&) noexcept;

  [[nodiscard]] std::size_t size() const;     ///< points
  [[nodiscard]] std::size_t dropped() const;  ///< points that were not taken

  class Storage;
  [[nodiscard]] const Storage& storage() const { return *x_storage; }

 private:
  std::unique_ptr<Storage> x_storage;
};

}  // namespace raceloc::gpu
