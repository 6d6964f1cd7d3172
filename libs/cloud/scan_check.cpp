#include "cloud/scan_check.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

namespace raceloc {

bool isOneRing(const Scan& scan) {
  constexpr std::size_t kFewest = 20;
  constexpr float kSpread = 0.005F, kNear_m = 0.5F;
  std::size_t count = 0;
  float lowest = 1, highest = -1;  // sine of the elevation
  for (std::size_t i = 0; i < scan.cloud.size(); ++i) {
    const float range_m = scan.cloud.point(i).norm();
    if (!(range_m > kNear_m)) continue;
    const float sine = scan.cloud.z[i] / range_m;
    lowest = std::min(lowest, sine);
    highest = std::max(highest, sine);
    ++count;
  }
  return count >= kFewest && highest - lowest < kSpread;
}

std::optional<bool> showsGround(const Scan& scan) { return showsGround(scan.cloud, scan.T_body_lidar); }

std::optional<bool> showsGround(const Cloud& cloud, const Pose& T_body_cloud) {
  constexpr int kReach_m = 15, kSide = 2 * kReach_m, kFewestPoints = 3, kFewestCells = 15;
  constexpr float kOwnCar_m = 3, kFlat_m = 0.25F;
  constexpr double kDeepest_m = -2.5, kSlope = 0.05, kGroundShare = 0.2;
  struct Cell {
    float lowest_m = std::numeric_limits<float>::infinity();
    float highest_m = -std::numeric_limits<float>::infinity();
    int count = 0;
  };
  std::array<Cell, static_cast<std::size_t>(kSide * kSide)> cells;
  const Eigen::Isometry3f T = T_body_cloud.cast<float>();
  for (std::size_t i = 0; i < cloud.size(); ++i) {
    const Eigen::Vector3f p_cloud_m = cloud.point(i);
    if (!(p_cloud_m.squaredNorm() > kOwnCar_m * kOwnCar_m)) continue;
    const Eigen::Vector3f p_m = T * p_cloud_m;
    if (!(p_m.head<2>().squaredNorm() < kReach_m * kReach_m)) continue;
    const auto column = static_cast<std::size_t>(p_m.x() + kReach_m);
    const auto row = static_cast<std::size_t>(p_m.y() + kReach_m);
    Cell& cell =
        cells[std::min<std::size_t>(row, kSide - 1) * kSide + std::min<std::size_t>(column, kSide - 1)];
    cell.lowest_m = std::min(cell.lowest_m, p_m.z());
    cell.highest_m = std::max(cell.highest_m, p_m.z());
    ++cell.count;
  }
  int seen = 0, ground = 0;
  for (std::size_t i = 0; i < cells.size(); ++i) {
    const Cell& cell = cells[i];
    if (cell.count < kFewestPoints) continue;
    ++seen;
    const std::size_t row = i / kSide, column = i % kSide;
    const double x_m = static_cast<double>(column) + 0.5 - kReach_m;
    const double y_m = static_cast<double>(row) + 0.5 - kReach_m;
    const double slope_m = kSlope * std::hypot(x_m, y_m);
    if (cell.highest_m - cell.lowest_m < kFlat_m && cell.lowest_m > kDeepest_m - slope_m &&
        cell.highest_m < slope_m)
      ++ground;
  }
  if (seen < kFewestCells) return std::nullopt;
  return ground >= kGroundShare * seen;
}

}  // namespace raceloc
