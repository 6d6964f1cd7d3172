#include "pipeline/map_quality.h"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <vector>

#include "core/statistics.h"
#include "map/voxel_key.h"

namespace raceloc {

void WallSharpness::add(const Cloud& points_map) {
  std::pair<const std::uint64_t, Cell>* last = nullptr;  // points that follow each other often share a cube
  for (std::size_t i = 0; i < points_map.size(); ++i) {
    const Eigen::Vector3d p = points_map.point(i).cast<double>();
    const Eigen::Vector3d index = (p / x_cell_m).array().floor();
    const auto key = voxelKey(index);
    if (!key) continue;
    if (last == nullptr || last->first != *key) last = &*x_cells.try_emplace(*key).first;
    Cell& cell = last->second;
    const Eigen::Vector3d d = p - x_cell_m * index;
    ++cell.points;
    cell.sum += d;
    cell.squares += d * d.transpose();
  }
}

WallThickness WallSharpness::thickness() const {
  constexpr std::size_t kMinPoints = 30;
  const double max_upright = std::sin(10 * kDegree);
  std::vector<double> thickness_m;
  for (const auto& entry : x_cells) {
    const Cell& cell = entry.second;
    if (cell.points < kMinPoints) continue;
    const auto n = static_cast<double>(cell.points);
    const Eigen::Vector3d mean = cell.sum / n;
    const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> eigen(cell.squares / n - mean * mean.transpose());
    const Eigen::Vector3d& variance_m2 = eigen.eigenvalues();
    const bool flat = variance_m2(0) < 0.1 * variance_m2(1);
    const bool upright = std::abs(eigen.eigenvectors()(2, 0)) < max_upright;
    if (flat && upright) thickness_m.push_back(std::sqrt(std::max(0.0, variance_m2(0))));
  }
  return {quantile(thickness_m, 0.5), quantile(thickness_m, 0.9), thickness_m.size()};
}

}  // namespace raceloc
