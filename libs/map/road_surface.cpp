#include "map/road_surface.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <optional>

#include "core/statistics.h"
#include "map/cross_section.h"

namespace raceloc {

namespace {

constexpr double kHalfWidth_m = 4, kHalfLength_m = 2;
constexpr double kNear_m = 20;     // of a key pose
constexpr double kOffPlane_m = 1;  // of the ground from the car's plane: its axle height and its lean
constexpr double kWidth_m = 0.15;  // of Tukey's weights: several times the roughness of a road in a map
constexpr std::size_t kMinPoints = 20;

/** z = height + slope . (along, left) */
struct Plane {
  double height_m;
  Eigen::Vector2d slope;
  [[nodiscard]] double off(const SectionPoint& p) const {
    return p.z_map_m - height_m - slope.dot(Eigen::Vector2d(p.along_m, p.left_m));
  }
};

const KeyPose* nearestKeyPose(const std::vector<KeyPose>& key_poses, const MapWaypoint& at) {
  const Eigen::Vector2d along(std::cos(at.heading_rad), std::sin(at.heading_rad));
  const KeyPose* nearest = nullptr;
  double nearest_m = kNear_m;
  for (const KeyPose& k : key_poses) {
    const double away_m = (k.T_map_body.translation() - at.p_map_m).head<2>().norm();
    const Eigen::Vector2d forward = k.T_map_body.linear().col(0).head<2>();
    if (away_m >= nearest_m || forward.dot(along) < 0.5 * forward.norm()) continue;
    nearest = &k;
    nearest_m = away_m;
  }
  return nearest;
}

/** The car's own plane, x-y of the body, in the way-point's frame; none for a car on its side. */
std::optional<Plane> planeOf(const Pose& T_map_body, const MapWaypoint& at) {
  const Eigen::Vector3d up = T_map_body.linear().col(2);
  if (up.z() < 0.5) return std::nullopt;
  const Eigen::Vector2d gradient = -up.head<2>() / up.z();
  const Eigen::Vector2d along(std::cos(at.heading_rad), std::sin(at.heading_rad)),
      left(-along.y(), along.x());
  const Eigen::Vector2d to_line_m = (at.p_map_m - T_map_body.translation()).head<2>();
  return Plane{T_map_body.translation().z() + gradient.dot(to_line_m),
               {gradient.dot(along), gradient.dot(left)}};
}

/** One step of iteratively re-weighted least squares; none if the points do not fix a plane. */
std::optional<Plane> refined(const Plane& plane, const std::vector<SectionPoint>& points, double width_m) {
  Eigen::Matrix3d A = Eigen::Matrix3d::Zero();
  Eigen::Vector3d b = Eigen::Vector3d::Zero();
  std::size_t used = 0;
  for (const SectionPoint& p : points) {
    const double u = plane.off(p) / width_m;
    if (std::abs(u) >= 1) continue;
    const double weight = (1 - u * u) * (1 - u * u);
    const Eigen::Vector3d row(1, p.along_m, p.left_m);
    A += weight * row * row.transpose();
    b += weight * p.z_map_m * row;
    ++used;
  }
  if (used < kMinPoints) return std::nullopt;
  // The spread of points on one side of the line, or in a row, leaves the slope there to noise.
  const Eigen::Vector2d mean = A.col(0).tail<2>() / A(0, 0);
  const Eigen::Vector2d spread_m =
      (A.diagonal().tail<2>() / A(0, 0) - mean.cwiseAbs2()).cwiseMax(0).cwiseSqrt();
  if (spread_m.x() < 0.25 * kHalfLength_m || spread_m.y() < 0.25 * kHalfWidth_m) return std::nullopt;
  const Eigen::Vector3d x = A.ldlt().solve(b);
  return Plane{x(0), x.tail<2>()};
}

std::optional<Plane> ground(const Plane& car, std::vector<SectionPoint> points) {
  points.erase(std::remove_if(points.begin(), points.end(),
                              [&](const SectionPoint& p) { return std::abs(car.off(p)) > kOffPlane_m; }),
               points.end());
  if (points.size() < kMinPoints) return std::nullopt;
  std::vector<double> off_m;
  off_m.reserve(points.size());
  for (const SectionPoint& p : points) off_m.push_back(car.off(p));
  std::optional<Plane> plane = car;
  plane->height_m += quantile(std::move(off_m), 0.5);
  constexpr int kSteps = 10;
  for (int step = 0; plane && step < kSteps; ++step)  // from wide to narrow: the car may lean by some degrees
    plane = refined(*plane, points, kWidth_m * std::max(1.0, 4.0 - step));
  return plane;
}

}  // namespace

std::vector<RoadStation> roadSurface(const TiledMap& map, const std::vector<MapWaypoint>& waypoints,
                                     double spacing_m, const std::vector<KeyPose>& key_poses) {
  std::vector<RoadStation> road;
  for (std::size_t i = 0; i < waypoints.size(); ++i) {
    const MapWaypoint& at = waypoints[i];
    const KeyPose* key_pose = nearestKeyPose(key_poses, at);
    if (key_pose == nullptr) continue;
    const auto car = planeOf(key_pose->T_map_body, at);
    if (!car) continue;
    const auto plane = ground(*car, crossSection(map, at, kHalfLength_m, kHalfWidth_m));
    if (plane)
      road.push_back({static_cast<double>(i) * spacing_m, plane->height_m, std::atan(plane->slope.x()),
                      -std::atan(plane->slope.y())});
  }
  return road;
}

}  // namespace raceloc
