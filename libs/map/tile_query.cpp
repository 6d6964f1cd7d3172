#include "map/tile_query.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>
#include <string>

namespace raceloc {

namespace {

/** Index of the tile at a coordinate, held within the range of int: no tile is beyond. */
int tileAt(double coordinate_m, double tile_size_m) {
  const double index = std::floor(coordinate_m / tile_size_m);
  constexpr double kLimit = std::numeric_limits<int>::max();
  return static_cast<int>(std::clamp(index, -kLimit, kLimit));
}

double requirePositive(double value, const char* what) {
  if (!(value > 0) || !std::isfinite(value))
    throw std::invalid_argument(std::string("TileWindow: bad ") + what);
  return value;
}

}  // namespace

TileWindow::TileWindow(gpu::Context& context, const MapFile& map, double voxel_size_m, double radius_m)
    : x_context(context),
      x_map(map),
      x_voxel_size_m(requirePositive(voxel_size_m, "voxel size")),
      x_radius_m(requirePositive(radius_m, "radius")),
      x_tile_size_m(map.info().tile_size_m),
      x_target(context, voxel_size_m) {}

bool TileWindow::moveTo(const Eigen::Vector2d& p_map_m) {
  if (!p_map_m.allFinite()) throw std::invalid_argument("TileWindow: the position is not finite");
  const auto needed = tilesWithin(x_radius_m, p_map_m);
  const bool missing =
      std::any_of(needed.begin(), needed.end(), [&](const auto& index) { return x_tiles.count(index) == 0; });
  const bool too_far = std::any_of(x_tiles.begin(), x_tiles.end(), [&](const auto& tile) {
    return distanceTo(tile.first, p_map_m) > x_radius_m + x_tile_size_m;
  });
  if (missing || too_far) rebuild(p_map_m);
  return !needed.empty();
}

double TileWindow::distanceTo(const std::pair<int, int>& tile, const Eigen::Vector2d& p_map_m) const {
  const Eigen::Array2d from_corner_m =
      p_map_m.array() - Eigen::Array2d(tile.first, tile.second) * x_tile_size_m;
  return (from_corner_m - from_corner_m.max(0.0).min(x_tile_size_m)).matrix().norm();
}

std::vector<std::pair<int, int>> TileWindow::tilesWithin(double distance_m,
                                                         const Eigen::Vector2d& p_map_m) const {
  const auto& all = x_map.tileIndices();  // ascending: column by column
  const int last_ix = tileAt(p_map_m.x() + distance_m, x_tile_size_m);
  const int first_iy = tileAt(p_map_m.y() - distance_m, x_tile_size_m);
  std::vector<std::pair<int, int>> found;
  auto next = std::lower_bound(all.begin(), all.end(),
                               std::pair{tileAt(p_map_m.x() - distance_m, x_tile_size_m), first_iy});
  while (next != all.end() && next->first <= last_ix) {
    if (distanceTo(*next, p_map_m) <= distance_m) found.push_back(*next);
    ++next;
  }
  return found;
}

void TileWindow::rebuild(const Eigen::Vector2d& p_map_m) {
  std::map<std::pair<int, int>, Tile> tiles;
  gpu::VoxelMap target(x_context, x_voxel_size_m);
  for (const auto& index : tilesWithin(x_radius_m + 0.5 * x_tile_size_m, p_map_m)) {
    const auto resident = x_tiles.find(index);
    const Tile& tile =
        tiles
            .emplace(index, resident != x_tiles.end() ? resident->second
                                                      : x_map.tile(index.first, index.second).value())
            .first->second;
    gpu::Transform T_map_tile;
    const Eigen::Vector3d corner_m = tileCorner(tile, x_tile_size_m);
    T_map_tile.t = {corner_m.x(), corner_m.y(), corner_m.z()};
    const Cloud& cloud = tile.cloud;
    target.insert({cloud.x.data(), cloud.y.data(), cloud.z.data(), cloud.size()}, tile.covariances.view(),
                  T_map_tile);
  }
  x_tiles.swap(tiles);
  x_target = std::move(target);
  ++x_rebuilds;
}

}  // namespace raceloc
