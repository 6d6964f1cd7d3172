/** \file
 * The walls beside the racing line. */
#pragma once

#include <vector>

#include "map/map_content.h"
#include "map/tiled_map.h"

namespace raceloc {

/** At each way-point and on each side the nearest structure that stands 0.4 m or more over at most 0.3 m across the
 * line, within 30 m and without gaps of 0.4 m upward: banked ground is none, nor is a bridge or a sign above the
 * road. Its foot is where its face (median of the points that stand) meets the lowest points there. Where no such
 * structure is, the station has no value.
 * \param waypoints  round the racing line, map frame
 * \param spacing_m  from one to the next along the line
 * \return the left wall, then the right one, ascending stations */
[[nodiscard]] std::vector<WallPoint> wallLines(const TiledMap& map, const std::vector<MapWaypoint>& waypoints,
                                               double spacing_m);

}  // namespace raceloc
