#include "wall/wall_follower.h"

#include <algorithm>
#include <cmath>

namespace raceloc {

namespace {

/** The line at a distance from a wall, on the car's side. */
PathPoint beside(const Wall& wall, double x_m, double clearance_m) {
  const double slope = wall.slope(x_m), length = std::hypot(1.0, slope);
  const double left_m = wall.side == Side::left ? -clearance_m : clearance_m;
  const double bend_per_m = 2 * wall.beta[2] / (length * length * length);
  return {0, x_m - left_m * slope / length, wall.y_m(x_m) + left_m / length, std::atan(slope),
          bend_per_m / (1 - left_m * bend_per_m)};
}

}  // namespace

WallFollower::Shift WallFollower::shiftAt(double s_m) const {
  const auto next =
      std::find_if(x_shifts.begin(), x_shifts.end(), [&](const Shift& a) { return a.s_m > s_m; });
  if (next == x_shifts.end()) return x_shifts.back();
  if (next == x_shifts.begin()) return x_shifts.front();
  const Shift& before = *std::prev(next);
  const double b = (s_m - before.s_m) / (next->s_m - before.s_m), a = 1 - b;
  return {s_m, a * before.clearance_m + b * next->clearance_m, a * before.heading_rad + b * next->heading_rad,
          a * before.curvature_per_m + b * next->curvature_per_m};
}

void WallFollower::plan(const Wall& wall, double gap_m, double speed_mps, double curvature_per_m,
                        double course_rad) {
  constexpr double kWhole_s = 10;  // until it has settled
  WallPathOptions options = x_options;
  options.horizon_s = kWhole_s;
  const Wall seen = moved(wall, poseFromRpy(Eigen::Vector3d::Zero(), 0, 0, course_rad), 0);
  // Of what keeps off the wall, the best that the tyres can do.
  constexpr double kStep_m = 0.25;
  const double most_per_m = options.lateral_limit_mps2 / (speed_mps * speed_mps);
  const auto isTooHard = [&](const PathPoint& p) { return std::abs(p.curvature_per_m) > most_per_m; };
  WallPath path = planAlong(seen, gap_m, speed_mps, curvature_per_m, options);
  while (options.least_gap_m > 0 && std::any_of(path.points.begin(), path.points.end(), isTooHard)) {
    options.least_gap_m = std::max(0.0, options.least_gap_m - kStep_m);
    path = planAlong(seen, gap_m, speed_mps, curvature_per_m, options);
  }
  x_shifts.clear();
  for (const PathPoint& p : path.points) {
    const double clearance_m = seen.clearance_m({p.x_m, p.y_m});
    const PathPoint line = beside(seen, p.x_m, clearance_m);
    x_shifts.push_back(
        {p.s_m, clearance_m, p.heading_rad - line.heading_rad, p.curvature_per_m - line.curvature_per_m});
    if (p.s_m > path.settled_m) break;
  }
  x_shifts.push_back({x_shifts.back().s_m + options.step_m, gap_m, 0, 0});
}

Path WallFollower::follow(const Wall& seen, double gap_m, double speed_mps, double curvature_per_m,
                          double course_rad, double moved_m) {
  const Wall wall = ahead(seen);
  if (x_side == wall.side && x_gap_m == gap_m) {
    x_driven_m += moved_m;
  } else {
    plan(wall, gap_m, speed_mps, curvature_per_m, course_rad);
    x_side = wall.side;
    x_gap_m = gap_m;
    x_driven_m = 0;
  }
  Path path;
  const double length_m = std::max(x_options.min_length_m, x_options.horizon_s * speed_mps);
  for (double x_m = 0; path.empty() || path.back().s_m < length_m; x_m += x_options.step_m) {
    if (std::abs(wall.slope(x_m)) > 1) break;  // y over x is no way to write it any more
    const double s_m =
        path.empty() ? 0 : path.back().s_m + x_options.step_m * std::hypot(1.0, wall.slope(x_m));
    const Shift shift = shiftAt(x_driven_m + s_m);
    PathPoint point = beside(wall, x_m, shift.clearance_m);
    point.s_m = s_m;
    point.heading_rad += shift.heading_rad;
    point.curvature_per_m += shift.curvature_per_m;
    path.push_back(point);
  }
  return path;
}

}  // namespace raceloc
