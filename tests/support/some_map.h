/** \file
 * A small map with something of everything, for tests of what is kept, exported and checked. */
#pragma once

#include <cmath>
#include <string>
#include <vector>

#include "map/map_content.h"
#include "map/tiled_map.h"
#include "support/forall.h"

namespace raceloc::test {

/** A point every `spacing_m` metres over a square of +-`size_m` about the origin; no covariance is zero. */
inline TiledMap groundMap(double tile_size_m, int size_m, int spacing_m) {
  Cloud cloud;
  for (int x = -size_m; x < size_m; x += spacing_m)
    for (int y = -size_m; y < size_m; y += spacing_m)
      cloud.push({static_cast<float>(x) + 0.5F, static_cast<float>(y) + 0.5F, 0.1F});
  std::vector<float> ones(cloud.size(), 1);
  const float* one = ones.data();
  TiledMap map(tile_size_m);
  map.insert(cloud, {one, one, one, one, one, one, ones.size()});
  return map;
}

/** Two sessions on a circle of 40 m radius about the origin, driven counter-clockwise: every value differs. */
inline MapContent someContent(Random& rnd, double tile_size_m) {
  constexpr int kWaypoints = 40, kKeyPoses = 20;
  constexpr double kRadius_m = 40;
  const double spacing_m = 2 * M_PI * kRadius_m / kWaypoints;
  MapContent content{{GeodeticPoint{48.982, 8.3904, 116.4},
                      tile_size_m,
                      0.25,
                      "0.1.0",
                      "[map]\ntile_size_m = 32\n",
                      {"morning", "noon"},
                      spacing_m},
                     {}};
  const auto onCircle = [&](int waypoint, double out_m) {
    const double angle_rad = 2 * M_PI * waypoint / kWaypoints;
    return poseFromRpy({(kRadius_m + out_m) * std::cos(angle_rad), (kRadius_m + out_m) * std::sin(angle_rad),
                        rnd.normal(0.1)},
                       rnd.normal(0.02), rnd.normal(0.02), wrapAngle(angle_rad + M_PI / 2));
  };
  const auto positive = [&](auto matrix) {
    matrix = decltype(matrix)::NullaryExpr([&] { return rnd.normal(); });
    return decltype(matrix)(matrix * matrix.transpose());
  };
  for (int i = 0; i < kWaypoints; ++i) {
    const Pose T = onCircle(i, 0);
    content.waypoints.push_back({T.translation(), yawOf(T)});
    content.road.push_back({i * spacing_m, rnd.normal(), rnd.normal(0.05), rnd.normal(0.2)});
  }
  for (const WallSide side : {WallSide::left, WallSide::right})
    for (int i = 0; i < kWaypoints; ++i)
      if (i < 10 || i >= 13)  // a gap
        content.walls.push_back({i * spacing_m, side,
                                 onCircle(i, side == WallSide::left ? -8 : 8).translation(),
                                 rnd.uniform(0.5, 1.5)});
  for (int i = 0; i < kKeyPoses; ++i) {
    const int waypoint = i * 3 % kWaypoints;
    KeyPose k{1.3e9 + i, onCircle(waypoint, rnd.normal(0.5)), i < 12 ? "morning" : "noon", waypoint};
    k.T_map_body_gps = k.T_map_body * rnd.pose(0.01, 0.1);
    k.T_map_body_lidar = k.T_map_body * rnd.pose(0.01, 0.1);
    if (i > 0)
      content.edges.push_back({i - 1, i, content.key_poses.back().T_map_body.inverse() * k.T_map_body,
                               positive(Matrix6d()), EdgeKind::odometry});
    content.fixes.push_back({i, i % 2 == 0 ? "gps_left" : "gps_right",
                             k.T_map_body.translation() + rnd.vectorWithin(0.1), positive(Eigen::Matrix3d()),
                             rnd.vectorWithin(1), rnd.uniform(0, 1)});
    content.key_poses.push_back(std::move(k));
  }
  content.key_poses.back().racetrack_id.reset();
  content.key_poses.back().T_map_body_gps.reset();
  content.edges.push_back({1, 14,
                           content.key_poses[1].T_map_body.inverse() * content.key_poses[14].T_map_body,
                           positive(Matrix6d()), EdgeKind::loop});
  return content;
}

}  // namespace raceloc::test
