/** \file
 * The map for other people's programs. What cannot be written whole is an InputError, and what was there stays. */
#pragma once

#include <string>

#include "map/map_content.h"
#include "map/tiled_map.h"

namespace raceloc {

/** \name Points in the map frame [m]: x, y, z and, if the map has it, intensity (0..1), as little-endian floats in a
 * binary PLY 1.0 or PCD 0.7 (unorganised), tile by tile. Floats are coarser the farther from the origin: 0.25 mm at 4
 * km. @{ */
void writePly(const std::string& path, const TiledMap& map);
void writePcd(const std::string& path, const TiledMap& map);
/** @} */

/** Where the map frame lies, as JSON: `frame` is "ENU" with datum, latitude_deg, longitude_deg and height_m (above the
 * ellipsoid) of its origin, or "local" for a survey without GPS. */
void writeOrigin(const std::string& path, const MapInfo& info);

/** \name The lines of the map on the globe: the driven line of each session, the racing line, the left and the right
 * wall at their feet (in pieces where they have gaps). WGS84, heights above the ellipsoid.
 * GeoJSON as RFC 7946 has it: longitude, latitude, height; `kind` is driven, racing_line, wall_left or wall_right. In
 * KML the lines lie on the ground, because its heights count from the sea.
 * \throws InputError if the map has no origin. @{ */
void writeGeoJson(const std::string& path, const MapContent& content);
void writeKml(const std::string& path, const MapContent& content);
/** @} */

/** The pose graph: VERTEX_SE3:QUAT of every key pose, the first one FIXed, EDGE_SE3:QUAT of every edge with the
 * information of translation and rotation vector, as GTSAM reads it (g2o itself takes the rotation for half of that
 * vector). The format has no antenna positions: the fixes of the receivers are left out. */
void writeG2o(const std::string& path, const MapContent& content);

}  // namespace raceloc
