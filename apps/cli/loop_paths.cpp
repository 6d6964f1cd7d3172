#include "cli/loop_paths.h"

#include <algorithm>
#include <cmath>

#include "wall/tracked_path.h"

namespace raceloc {

Path linePath(const Track& track, const RacingLine& line, const Eigen::Vector3d& x_y_theta, double ahead_m) {
  const double z_m = track.at(0).T_map_road.translation().z();
  const auto place = track.locate({x_y_theta.x(), x_y_theta.y(), z_m});
  if (!place) return {};
  // Seen from above, what lies across the road is shorter than it is in the surface.
  const RoadFrame road = track.at(place->s_m);
  const Eigen::Vector2d left = road.T_map_road.linear().col(1).head<2>();
  const double n_m =
      (x_y_theta.head<2>() - road.T_map_road.translation().head<2>()).dot(left) / left.squaredNorm();
  const Pose T_map_surface = track.surface(place->s_m, n_m).T_map_surface;
  const double turn_rad = x_y_theta.z() - yawOf(T_map_surface);
  const double heading_rad = std::atan2(std::sin(turn_rad), left.norm() * std::cos(turn_rad));
  const Pose T_body_map =
      (T_map_surface * Eigen::AngleAxisd(heading_rad, Eigen::Vector3d::UnitZ())).inverse();

  constexpr int kBehind_m = 5;
  Path path;
  for (int at_m = -kBehind_m; at_m <= ahead_m; ++at_m) {
    const double s_m = at_m;
    const auto point = line.at(place->s_m + s_m);
    const Pose T_body_point = T_body_map * track.surface(place->s_m + s_m, point.n_m).T_map_surface;
    const Eigen::Vector3d p_m = T_body_point.translation();
    const double length_m =
        path.empty() ? 0 : path.back().s_m + std::hypot(p_m.x() - path.back().x_m, p_m.y() - path.back().y_m);
    path.push_back(
        {length_m, p_m.x(), p_m.y(), yawOf(T_body_point) + point.direction_rad, point.curvature_per_m});
  }
  return path;
}

PathAhead aheadOn(const Path& path, const Pose& T_path_body, double speed_mps,
                  const Eigen::Vector3d& up_body) {
  const Eigen::Vector2d p_m = T_path_body.translation().head<2>();
  const PathPoint here = beside(path, p_m);
  const double curvature_per_m = curvatureAt(path, here.s_m + speed_mps * kReaction_s);
  const double left_m =
      (Eigen::Rotation2Dd(-here.heading_rad) * (p_m - Eigen::Vector2d(here.x_m, here.y_m))).y();
  return {std::clamp(left_m, -kMostOffset_m, kMostOffset_m),
          yawOf(T_path_body),
          here.heading_rad,
          curvature_per_m,
          -curvature_per_m * up_body.y() / up_body.z(),  // a level turn, seen from a road that leans
          up_body.y(),
          up_body.z()};
}

}  // namespace raceloc
