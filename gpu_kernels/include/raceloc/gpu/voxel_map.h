/** \file
 * The target of VGICP: a hash of Gaussians, one a voxel. Source: Koide et al., ICRA 2021. */
#pragma once

#include <cstdint>
#include <memory>

#include "raceloc/gpu/context.h"
#include "raceloc/gpu/types.h"

namespace raceloc::gpu {

/** Gaussians of a set of voxels: mean [m], mean covariance [m^2] and number of points of each. */
struct VoxelGaussians {
  std::vector<std::int32_t> ix, iy, iz;  ///< voxel indices, floor(p / voxel_size)
  Points mean;
  Covariances covariance;  ///< its `neighbours` is the number of points merged
  [[nodiscard]] std::size_t size() const { return ix.size(); }
};

/** Grows by insert() and fill(), shrinks by keepWithin() and keepNewest(); reading it never changes it, so many
 * threads may. It serves the contexts of the device it was made with or brought to (linearize() throws
 * std::invalid_argument for a CUDA context with another's map). */
class VoxelMap {
 public:
  /** \throws std::invalid_argument if voxel_size_m is not > 0. */
  VoxelMap(Context& context, double voxel_size_m);
  /** One of the host's memory alone, which serves CPU contexts: no context is busy while it grows, so that another
   * thread can make it. \throws std::invalid_argument if voxel_size_m is not > 0. */
  explicit VoxelMap(double voxel_size_m);
  ~VoxelMap();
  VoxelMap(VoxelMap&&) noexcept;
  VoxelMap& operator=(VoxelMap&&) noexcept;

  /** Takes it to the context's device, where it then grows too; contents do not change. */
  void bringTo(Context& context);

  /** Merges points (moved by T_map_points, their covariances turned with them): a voxel's mean and covariance
   * are the averages over all points it ever took, in order of insertion. Points beyond 2^20 voxels or not
   * finite are dropped and counted in the result. \throws std::invalid_argument if the sizes differ. */
  std::size_t insert(const PointsView& points, const CovariancesView& covariances,
                     const Transform& T_map_points);

  /** As insert(), but a voxel that had points before stays as it was: what is matched against the map then does not
   * creep with it. */
  std::size_t fill(const PointsView& points, const CovariancesView& covariances,
                   const Transform& T_map_points);

  /** Drops the voxels whose mean is farther than `distance_m` from `centre_m`; returns how many. */
  std::size_t keepWithin(const std::array<double, 3>& centre_m, double distance_m);

  /** Drops the voxels that took no point for longest, until at most `voxels` are left (of equally old ones, those
   * last in (z, y, x)); returns how many. */
  std::size_t keepNewest(std::size_t voxels);

  [[nodiscard]] std::size_t size() const;  ///< occupied voxels
  [[nodiscard]] double voxelSize() const;  ///< [m]
  [[nodiscard]] VoxelGaussians contents()
      const;  ///< in ascending (z, y, x) voxel order, the same on every device

  class Storage;
  [[nodiscard]] const Storage& storage() const { return *x_storage; }

 private:
  std::unique_ptr<Storage> x_storage;
};

}  // namespace raceloc::gpu
