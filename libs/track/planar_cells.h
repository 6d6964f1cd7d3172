/** \file
 * Squares of the map's plane as keys of a hash. */
#pragma once

#include <Eigen/Core>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <unordered_map>
#include <vector>

namespace raceloc {

/** The square of edge `edge_m` around a place, as one number; x and y less than 2^31 edges from 0. */
[[nodiscard]] inline std::uint64_t planarCell(double x_m, double y_m, double edge_m) {
  const auto index = [edge_m](double v_m) {
    return static_cast<std::uint32_t>(static_cast<std::int32_t>(std::floor(v_m / edge_m)));
  };
  return (static_cast<std::uint64_t>(index(x_m)) << 32) | index(y_m);
}

/** Numbers of points, filed by where they are: one look-up finds all within the reach of a place. */
class PlanarCells {
 public:
  explicit PlanarCells(double reach_m) : x_reach_m(reach_m) {}

  /** Files it under its own square and the eight around it; not at all if it is not finite or farther than 1000 km
   * from 0. */
  void add(std::size_t number, const Eigen::Vector3d& p_m) {
    if (!isNear(p_m)) return;
    for (int dx = -1; dx <= 1; ++dx)
      for (int dy = -1; dy <= 1; ++dy)
        x_cells[planarCell(p_m.x() + dx * x_reach_m, p_m.y() + dy * x_reach_m, x_reach_m)].push_back(number);
  }

  /** All within the planar reach of `p_m` and some farther ones, in the order in which they were added; none
   * for a place that is not finite or farther than 1000 km from 0. */
  [[nodiscard]] const std::vector<std::size_t>& near(const Eigen::Vector3d& p_m) const {
    static const std::vector<std::size_t> none;
    if (!isNear(p_m)) return none;
    const auto cell = x_cells.find(planarCell(p_m.x(), p_m.y(), x_reach_m));
    return cell == x_cells.end() ? none : cell->second;
  }

 private:
  static bool isNear(const Eigen::Vector3d& p_m) {
    constexpr double kFarthest_m = 1e6;
    return (p_m.array().abs() < kFarthest_m).all();  // NaN is not
  }

  double x_reach_m;
  std::unordered_map<std::uint64_t, std::vector<std::size_t>> x_cells;
};

}  // namespace raceloc
