#include "pipeline/map_quality.h"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <numeric>
#include <vector>

namespace raceloc {

WallThickness wallThickness(const Cloud& points, double cell_m) {
  // 21 bits an axis: half a million metres each way at the default size.
  const auto index = [cell_m](float coordinate_m) {
    constexpr std::int64_t kBias = 1 << 20, kMask = (1 << 21) - 1;
    return static_cast<std::uint64_t>(
        (static_cast<std::int64_t>(std::floor(static_cast<double>(coordinate_m) / cell_m)) + kBias) & kMask);
  };
  std::vector<std::uint64_t> cell(points.size());
  for (std::size_t i = 0; i < points.size(); ++i)
    cell[i] = index(points.z[i]) << 42U | index(points.y[i]) << 21U | index(points.x[i]);
  std::vector<std::size_t> order(points.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::sort(order.begin(), order.end(),
            [&](std::size_t a, std::size_t b) { return cell[a] != cell[b] ? cell[a] < cell[b] : a < b; });

  constexpr std::size_t kMinPoints = 30;
  const double max_upright = std::sin(10 * M_PI / 180);
  std::vector<double> thickness_m;
  for (std::size_t first = 0; first < order.size();) {
    std::size_t last = first;
    Eigen::Vector3d mean = Eigen::Vector3d::Zero();
    for (; last < order.size() && cell[order[last]] == cell[order[first]]; ++last)
      mean += points.point(order[last]).cast<double>();
    const std::size_t n = last - first;
    mean /= static_cast<double>(n);
    if (n >= kMinPoints) {
      Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();
      for (std::size_t i = first; i < last; ++i) {
        const Eigen::Vector3d d = points.point(order[i]).cast<double>() - mean;
        covariance += d * d.transpose() / static_cast<double>(n);
      }
      const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> eigen(covariance);
      const Eigen::Vector3d& variance_m2 = eigen.eigenvalues();
      const bool flat = variance_m2(0) < 0.1 * variance_m2(1);
      const bool upright = std::abs(eigen.eigenvectors()(2, 0)) < max_upright;
      if (flat && upright) thickness_m.push_back(std::sqrt(std::max(0.0, variance_m2(0))));
    }
    first = last;
  }
  if (thickness_m.empty()) return {0, 0, 0};
  std::sort(thickness_m.begin(), thickness_m.end());
  return {thickness_m[thickness_m.size() / 2], thickness_m[thickness_m.size() * 9 / 10], thickness_m.size()};
}

}  // namespace raceloc
