/** \file
 * Height, grade and bank of the road along the racing line. */
#pragma once

#include <vector>

#include "map/map_content.h"
#include "map/tiled_map.h"

namespace raceloc {

/** At each way-point a plane through the map's ground, within 4 m across the line and 2 m along it. Where to look for
 * ground is told by the nearest key pose that heads the same way (so that a bridge does not lend its height to the road
 * under it): the road is parallel to the car's own plane. The plane is then fitted by least squares with Tukey's
 * weights, so that walls, kerbs and grass beside the road do not bend it. A station has no value without such a key
 * pose within 20 m, or with fewer than 20 points of ground or all of them on one side.
 * \param waypoints  round the racing line, map frame; their heights are not used
 * \param spacing_m  from one to the next along the line */
[[nodiscard]] std::vector<RoadStation> roadSurface(const TiledMap& map,
                                                   const std::vector<MapWaypoint>& waypoints,
                                                   double spacing_m, const std::vector<KeyPose>& key_poses);

}  // namespace raceloc
