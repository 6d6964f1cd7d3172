#include "pipeline/map_check.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "core/errors.h"

namespace raceloc {

GeodeticPoint requireOrigin(const MapFile& map, const std::string& map_path) {
  if (!map.info().origin)
    throw InputError("map " + map_path +
                     ": has no georeference (it was made from a log without GPS); map a log with GPS");
  return *map.info().origin;
}

void requireHash(const MapFile& map, const std::string& map_path, const std::string& hash) {
  if (hash.empty() || map.contentHash() == hash) return;
  throw InputError("map " + map_path + ": its content hash is " + map.contentHash() +
                   ", but map_hash asks for " + hash +
                   "; give the map that is meant, or leave map_hash empty");
}

PlaceCheck::PlaceCheck(const MapFile& map, std::string map_path, double reach_m)
    : x_map(map), x_map_path(std::move(map_path)), x_reach_m(reach_m) {
  if (map.tileIndices().empty())
    throw InputError("map " + x_map_path + ": has no points; map a drive with a LiDAR");
}

void PlaceCheck::add(const GpsFix& fix) {
  if (x_left == 0) return;
  double nearest_m = std::numeric_limits<double>::max();
  for (const TileIndex& tile : x_map.tileIndices())
    nearest_m =
        std::min(nearest_m, distanceToTile(tile, x_map.info().tile_size_m, fix.p_map_antenna_m.head<2>()));
  if (nearest_m <= x_reach_m) {
    x_left = 0;
    return;
  }
  if (--x_left > 0) return;
  const GeodeticPoint origin = requireOrigin(x_map, x_map_path);
  throw InputError("map " + x_map_path + ": of another place: its origin is " +
                   std::to_string(origin.latitude_deg) + " " + std::to_string(origin.longitude_deg) +
                   " deg, and " + fix.label + " is " + std::to_string(std::llround(nearest_m)) +
                   " m from its nearest tile (map_reach_m = " + std::to_string(std::llround(x_reach_m)) +
                   "); give the map of this place");
}

}  // namespace raceloc
