/** \file
 * What a map must be before a car drives by it. */
#pragma once

#include <string>

#include "core/samples.h"
#include "map/map_file.h"

namespace raceloc {

/** Where the map frame is. \throws InputError if the map has no georeference. */
[[nodiscard]] GeodeticPoint requireOrigin(const MapFile& map, const std::string& map_path);

/** \param hash  as MapFile::contentHash() gives it; empty: any will do
 * \throws InputError naming both hashes if the map has another. */
void requireHash(const MapFile& map, const std::string& map_path, const std::string& hash);

/** Tells a map of another place by the first fixes of a drive. */
class PlaceCheck {
 public:
  /** Keeps a reference to the map. \param reach_m  fixes within this distance of a tile, in the plane, are on the map
   * \throws InputError if the map has no tile. */
  PlaceCheck(const MapFile& map, std::string map_path, double reach_m);

  /** Looks at each fix until one of them is on the map; a few that are not may be a receiver's error.
   * \throws InputError at the tenth fix, when none was on the map, naming the map, its origin, the receiver and how far
   *         it is from the nearest tile. */
  void add(const GpsFix& fix);

 private:
  const MapFile& x_map;
  std::string x_map_path;
  double x_reach_m;
  int x_left = 10;  ///< fixes that may still be elsewhere; 0: settled
};

}  // namespace raceloc
