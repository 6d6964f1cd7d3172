/** \file
 * The voxel map on the host: the master on every device, so that its content is the same on all. */
#pragma once

#include <array>
#include <vector>

#include "core/voxel_hash.hpp"
#include "raceloc/gpu/voxel_map.h"

namespace raceloc::gpu {

/** Voxels that take points: any, or those only that were empty before the insertion. */
enum class Into { any, empty };

class VoxelTable {
 public:
  explicit VoxelTable(double voxel_size_m) : x_voxel_size_m(voxel_size_m) { rehash(0); }

  std::size_t insert(const PointsView& points, const CovariancesView& covariances,
                     const Transform& T_map_points, Into into = Into::any);
  std::size_t keepWithin(const std::array<double, 3>& centre_m, double distance_m);
  std::size_t keepNewest(std::size_t voxels);
  [[nodiscard]] VoxelGaussians contents() const;

  [[nodiscard]] double voxelSize() const { return x_voxel_size_m; }
  [[nodiscard]] const std::vector<VoxelSlot>& slots() const { return x_slots; }
  [[nodiscard]] const std::vector<VoxelRecord>& records() const { return x_records; }
  [[nodiscard]] VoxelMapView view() const { return {x_slots.data(), x_records.data(), x_shift}; }
  [[nodiscard]] std::int32_t shift() const { return x_shift; }

 private:
  /** What a voxel has taken: sums in double, in order of insertion; means are offsets from the voxel's
   * centre. */
  struct Accumulator {
    Vec3<double> offset_m{0, 0, 0};
    Sym3<double> covariance_m2{0, 0, 0, 0, 0, 0};
    std::int64_t count = 0;
    std::int64_t last_insertion = 0;
  };

  [[nodiscard]] std::int32_t findOrAdd(const Cell& cell);
  void rehash(std::size_t expected_voxels);
  void enter(std::int32_t record);
  template <class Keep>
  std::size_t keepIf(const Keep& keep);
  [[nodiscard]] double centre(std::int32_t index) const { return (index + 0.5) * x_voxel_size_m; }

  double x_voxel_size_m;
  std::int32_t x_shift = 0;
  std::int64_t x_insertions = 0;
  std::vector<VoxelSlot> x_slots;
  std::vector<VoxelRecord> x_records;       ///< what a pass reads, in order of first insertion
  std::vector<Accumulator> x_accumulators;  ///< beside x_records
  std::vector<std::int32_t> x_touched;      ///< by the newest insertion; memory kept from call to call
};

}  // namespace raceloc::gpu
