/** \file
 * The map's points beside one way-point of the racing line. */
#pragma once

#include <vector>

#include "map/map_content.h"
#include "map/tiled_map.h"

namespace raceloc {

/** A point in the way-point's horizontal frame: x along the line, y to the left, z up from the map's zero. */
struct SectionPoint {
  double along_m, left_m, z_map_m;
};

/** The points within +-half_length_m along the line and +-half_width_m across it, tile by tile. */
[[nodiscard]] std::vector<SectionPoint> crossSection(const TiledMap& map, const MapWaypoint& at,
                                                     double half_length_m, double half_width_m);

}  // namespace raceloc
