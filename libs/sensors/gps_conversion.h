/** \file
 * Geodetic positions (WGS84) and local map frames: x east, y north, z up about an origin; weeks of GPS time. */
#pragma once

#include "core/types.h"

namespace raceloc {

/** Position in the map frame of `origin` [m]. */
[[nodiscard]] Eigen::Vector3d toMap(const GeodeticPoint& point, const GeodeticPoint& origin);

/** Inverse of toMap(): the round trip stays below 0.1 mm within 100 km of the origin, at any latitude. */
[[nodiscard]] GeodeticPoint fromMap(const Eigen::Vector3d& p_map_m, const GeodeticPoint& origin);

/** Position in the earth-centred, earth-fixed frame [m]. */
[[nodiscard]] Eigen::Vector3d toEarth(const GeodeticPoint& point);

/** T_to_from between the map frames of two origins: p_to = T_to_from * p_from. Exactly the identity when the
 * origins are equal. */
[[nodiscard]] Pose mapFromMap(const GeodeticPoint& origin_to, const GeodeticPoint& origin_from);

/** How often the week number of a receiver has rolled over, to 0 after 1023, whose stamps are so long behind; 0 if that is
 * no such time, to a day. */
[[nodiscard]] int weekRollovers(double behind_s);

}  // namespace raceloc
