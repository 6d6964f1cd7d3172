#pragma once

#include <cmath>

#include "map/map_content.h"
#include "support/centre_line.h"
#include "track/track_id.h"

namespace raceloc::test {

/** What a perfect survey along the centre line would know of a track: road everywhere, walls at its edges. */
inline MapContent surveyedTrack(const Track& track, double spacing_m) {
  const auto way_points = wayPointsAlong(centreLine(track, 0.5), spacing_m);
  MapContent content{{{}, 32, 0.25, "", "", {}, track.length_m() / static_cast<double>(way_points.size())},
                     {}};
  std::vector<WallPoint> right;
  for (const WayPoint& w : way_points) {
    const double station_m = content.info.waypoint_spacing_m * static_cast<double>(content.waypoints.size());
    const double s_m = track.locate(w.p_map_m)->s_m;
    const RoadFrame road = track.at(s_m);
    const Eigen::Vector3d up = road.T_map_road.linear().col(2);
    const Eigen::Vector2d along(std::cos(w.heading_rad), std::sin(w.heading_rad)),
        left(-along.y(), along.x());
    content.waypoints.push_back({w.p_map_m, w.heading_rad});
    content.road.push_back({station_m, road.T_map_road.translation().z(),
                            std::atan(-up.head<2>().dot(along) / up.z()),
                            std::atan(up.head<2>().dot(left) / up.z())});
    content.walls.push_back(
        {station_m, WallSide::left, track.surface(s_m, road.left_m).T_map_surface.translation(), 1});
    right.push_back(
        {station_m, WallSide::right, track.surface(s_m, -road.right_m).T_map_surface.translation(), 1});
  }
  content.walls.insert(content.walls.end(), right.begin(), right.end());
  return content;
}

}  // namespace raceloc::test
