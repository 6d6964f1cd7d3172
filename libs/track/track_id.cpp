#include "track/track_id.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>

namespace raceloc {

void TrackIdOptions::describe(OptionList& keys) {
  keys.add("spacing_m", spacing_m, between(0.5, 100), "between way-points along the racing line [m]");
  keys.add("reach_m", reach_m, between(0.5, 100),
           "poses farther from the line, in the plane, have no ID; below the distance to the pit lane [m]");
  keys.add("max_turn_deg", max_turn_deg, between(1, 90),
           "nor have poses that turn farther from the direction of driving [deg]");
}

std::vector<WayPoint> wayPointsAlong(const std::vector<Eigen::Vector3d>& line_map_m, double spacing_m) {
  const std::size_t points = line_map_m.size();
  if (points < 3 || !(spacing_m > 0))
    throw std::invalid_argument("wayPointsAlong: needs 3 points and a positive spacing");
  std::vector<double> arc_m{0};
  arc_m.reserve(points + 1);
  for (std::size_t i = 0; i < points; ++i)
    arc_m.push_back(arc_m.back() + (line_map_m[(i + 1) % points] - line_map_m[i]).norm());
  const double length_m = arc_m.back();
  if (!std::isfinite(length_m)) throw std::invalid_argument("wayPointsAlong: a point is not finite");

  const auto n = static_cast<std::size_t>(std::max(3.0, std::round(length_m / spacing_m)));
  std::vector<WayPoint> way_points;
  way_points.reserve(n);
  std::size_t i = 0;
  for (std::size_t k = 0; k < n; ++k) {
    const double s_m = static_cast<double>(k) / static_cast<double>(n) * length_m;
    while (i + 1 < points && arc_m[i + 1] <= s_m) ++i;
    const double step_m = arc_m[i + 1] - arc_m[i];
    const double within = step_m > 0 ? (s_m - arc_m[i]) / step_m : 0;
    way_points.push_back({line_map_m[i] + within * (line_map_m[(i + 1) % points] - line_map_m[i]), 0});
  }
  for (std::size_t k = 0; k < n; ++k) {
    const Eigen::Vector3d chord = way_points[(k + 1) % n].p_map_m - way_points[(k + n - 1) % n].p_map_m;
    way_points[k].heading_rad = std::atan2(chord.y(), chord.x());
  }
  return way_points;
}

TrackIds::TrackIds(std::vector<WayPoint> way_points, const TrackIdOptions& options)
    : x_way_points(std::move(way_points)),
      x_reach_m(options.reach_m),
      x_max_turn_rad(options.max_turn_deg * kDegree),
      x_cells(options.reach_m) {
  if (x_way_points.empty() || !(x_reach_m > 0) || !(x_max_turn_rad > 0))
    throw std::invalid_argument("TrackIds: needs way-points, a reach and an angle");
  for (std::size_t i = 0; i < x_way_points.size(); ++i) x_cells.add(i, x_way_points[i].p_map_m);
}

std::optional<int> TrackIds::idAt(const Pose& T_map_body) const {
  return nearest(T_map_body.translation(), yawOf(T_map_body), true);
}

std::optional<int> TrackIds::idAt(const Eigen::Vector3d& p_map_m, double heading_rad) const {
  return nearest(p_map_m, heading_rad, true);
}

std::optional<int> TrackIds::idAt(const Eigen::Vector2d& p_map_m, double heading_rad) const {
  return nearest({p_map_m.x(), p_map_m.y(), 0}, heading_rad, false);
}

std::optional<int> TrackIds::nearest(const Eigen::Vector3d& p_map_m, double heading_rad,
                                     bool by_height) const {
  std::optional<int> best;
  double best_m2 = std::numeric_limits<double>::infinity();
  for (const std::size_t i : x_cells.near(p_map_m)) {
    const WayPoint& way_point = x_way_points[i];
    Eigen::Vector3d away_m = p_map_m - way_point.p_map_m;
    if (!by_height) away_m.z() = 0;
    if (away_m.squaredNorm() >= best_m2 || away_m.head<2>().norm() > x_reach_m ||
        !(std::abs(wrapAngle(heading_rad - way_point.heading_rad)) <= x_max_turn_rad))
      continue;
    best = static_cast<int>(i);
    best_m2 = away_m.squaredNorm();
  }
  return best;
}

}  // namespace raceloc
