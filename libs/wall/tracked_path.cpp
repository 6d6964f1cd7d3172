#include "wall/tracked_path.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <iterator>
#include <stdexcept>

namespace raceloc {

double curvatureAt(const Path& path, double s_m) {
  const auto next = std::find_if(path.begin(), path.end(), [&](const PathPoint& q) { return q.s_m >= s_m; });
  if (next == path.end()) return path.back().curvature_per_m;
  if (next == path.begin()) return next->curvature_per_m;
  const PathPoint& before = *std::prev(next);
  const double share = (s_m - before.s_m) / (next->s_m - before.s_m);
  return (1 - share) * before.curvature_per_m + share * next->curvature_per_m;
}

PathPoint beside(const Path& path, const Eigen::Vector2d& p_m) {
  const auto from_m = [&](const PathPoint& q) { return Eigen::Vector2d(p_m.x() - q.x_m, p_m.y() - q.y_m); };
  const PathPoint near =
      *std::min_element(path.begin(), path.end(), [&](const PathPoint& a, const PathPoint& b) {
        return from_m(a).squaredNorm() < from_m(b).squaredNorm();
      });
  const double along_m = (Eigen::Rotation2Dd(-near.heading_rad) * from_m(near)).x();
  const double middle_rad = near.heading_rad + 0.5 * along_m * near.curvature_per_m;
  return {near.s_m + along_m, near.x_m + along_m * std::cos(middle_rad),
          near.y_m + along_m * std::sin(middle_rad), near.heading_rad + along_m * near.curvature_per_m,
          curvatureAt(path, near.s_m + along_m)};
}

Path trackedPath(const Path& line, double ahead_m) {
  if (line.empty()) return {};
  const PathPoint here = beside(line, Eigen::Vector2d::Zero());
  double off_m = (Eigen::Rotation2Dd(-here.heading_rad) * -Eigen::Vector2d(here.x_m, here.y_m)).y();
  Path path;
  for (PathPoint q : line) {
    q.s_m -= here.s_m;
    if (q.s_m < 0) continue;
    const double slope = -std::clamp(off_m, -kMostOffset_m, kMostOffset_m) / ahead_m;
    off_m += slope * (q.s_m - (path.empty() ? 0 : path.back().s_m));
    q.x_m -= off_m * std::sin(q.heading_rad);
    q.y_m += off_m * std::cos(q.heading_rad);
    q.heading_rad += std::atan(slope);
    path.push_back(q);
  }
  return path;
}

ToldLine::ToldLine(const std::vector<Eigen::Vector3d>& line_map_m) {
  constexpr double kSame_m = 1e-3;
  const auto apart_m = [](const Eigen::Vector3d& a, const Eigen::Vector3d& b) {
    return (a - b).head<2>().norm();
  };
  for (const Eigen::Vector3d& p_m : line_map_m)
    if (x_line_map_m.empty() || apart_m(p_m, x_line_map_m.back()) > kSame_m) x_line_map_m.push_back(p_m);
  while (x_line_map_m.size() > 1 && apart_m(x_line_map_m.front(), x_line_map_m.back()) <= kSame_m)
    x_line_map_m.pop_back();
  if (x_line_map_m.size() < 3) throw std::invalid_argument("ToldLine: fewer than three points");
  x_s_m.push_back(0);
  for (std::size_t i = 0; i < x_line_map_m.size(); ++i)
    x_s_m.push_back(x_s_m.back() + apart_m(x_line_map_m[(i + 1) % x_line_map_m.size()], x_line_map_m[i]));
}

std::optional<double> ToldLine::stationOf(const Pose& T_map_body) const {
  constexpr double kNear_m = 10, kTurned_rad = 60 * kDegree;
  const Eigen::Vector2d p_m = T_map_body.translation().head<2>();
  const Eigen::Vector2d course(std::cos(yawOf(T_map_body)), std::sin(yawOf(T_map_body)));
  double nearest_m = kNear_m;
  std::optional<double> station_m;
  for (std::size_t i = 0; i < x_line_map_m.size(); ++i) {
    const double length_m = x_s_m[i + 1] - x_s_m[i];
    const Eigen::Vector2d from_m = x_line_map_m[i].head<2>();
    const Eigen::Vector2d along = (x_line_map_m[(i + 1) % x_line_map_m.size()].head<2>() - from_m) / length_m;
    if (along.dot(course) < std::cos(kTurned_rad)) continue;
    const double on_m = std::clamp(along.dot(p_m - from_m), 0.0, length_m);
    const double off_m = (from_m + on_m * along - p_m).norm();
    if (off_m > nearest_m) continue;
    nearest_m = off_m;
    station_m = x_s_m[i] + on_m;
  }
  return station_m;
}

Eigen::Vector3d ToldLine::at(double s_m) const {
  const double length_m = x_s_m.back();
  const double here_m = s_m - length_m * std::floor(s_m / length_m);
  const auto after = std::upper_bound(std::next(x_s_m.begin()), std::prev(x_s_m.end()), here_m);
  const auto i = static_cast<std::size_t>(std::distance(x_s_m.begin(), after)) - 1;
  const double share = (here_m - x_s_m[i]) / (x_s_m[i + 1] - x_s_m[i]);
  return x_line_map_m[i] + share * (x_line_map_m[(i + 1) % x_line_map_m.size()] - x_line_map_m[i]);
}

Path ToldLine::from(const Pose& T_map_body, double ahead_m) const {
  constexpr int kBehind_m = 5;
  const auto station_m = stationOf(T_map_body);
  if (!station_m) return {};
  const Eigen::Vector3d p_map_m = T_map_body.translation(), up = T_map_body.linear().col(2);
  const auto planeHeight_m = [&](const Eigen::Vector3d& off_m) {  // of the plane that the car stands on
    return -up.head<2>().dot(off_m.head<2>()) / up.z();
  };
  const Eigen::Vector3d beside_m = at(*station_m);
  const double beside_height_m = planeHeight_m(beside_m - p_map_m);
  const auto seen = [&](double s_m) -> Eigen::Vector2d {
    const Eigen::Vector3d q_m = at(*station_m + s_m);
    Eigen::Vector3d off_m = q_m - p_map_m;
    const double climb_m = q_m.z() - beside_m.z();
    off_m.z() = std::isfinite(climb_m) ? beside_height_m + climb_m : planeHeight_m(off_m);
    return (T_map_body.linear().transpose() * off_m).head<2>();
  };
  Path path;
  for (int at_m = -kBehind_m; at_m <= ahead_m; ++at_m) {
    const Eigen::Vector2d before_m = seen(at_m - 1), here_m = seen(at_m), next_m = seen(at_m + 1);
    const Eigen::Vector2d in_m = here_m - before_m, out_m = next_m - here_m, through_m = next_m - before_m;
    const double turn_rad = std::atan2(in_m.x() * out_m.y() - in_m.y() * out_m.x(), in_m.dot(out_m));
    path.push_back({path.empty() ? 0 : path.back().s_m + in_m.norm(), here_m.x(), here_m.y(),
                    std::atan2(through_m.y(), through_m.x()), 2 * turn_rad / (in_m.norm() + out_m.norm())});
  }
  return path;
}

}  // namespace raceloc
