/** \file
 * What a NearestTarget owns. */
#pragma once

#include <vector>

#include "core/voxel_hash.hpp"
#include "cpu/box_tree.hpp"
#include "raceloc/gpu/nearest_target.h"

namespace raceloc::gpu {

class NearestTarget::Storage {
 public:
  Storage(const PointsView& points, const CovariancesView& covariances);

  [[nodiscard]] const std::vector<VoxelRecord>& records() const { return x_records; }
  [[nodiscard]] BoxTreeView tree() const { return x_tree.view(); }
  [[nodiscard]] std::size_t dropped() const { return x_dropped; }

 private:
  std::vector<VoxelRecord> x_records;  ///< of the points taken; the offset is the point, the cell (0, 0, 0)
  BoxTree x_tree;
  std::size_t x_dropped = 0;
};

}  // namespace raceloc::gpu
