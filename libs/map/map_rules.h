/** \file
 * What every map keeps to: the rule for who writes one and for who checks one. */
#pragma once

#include <string>

#include "map/map_content.h"

namespace raceloc {

/** The first contradiction in a map's content, in words; empty if there is none. */
[[nodiscard]] std::string faultOf(const MapContent& content);

/** The first key pose that the way-point of its racetrack ID cannot belong to: more than 50 m away or headed more than
 * 90 deg another way; empty if there is none. The IDs must be those of way-points. */
[[nodiscard]] std::string wrongIdOf(const MapContent& content);

}  // namespace raceloc
