/** \file
 * The part of a map around the car, as the matcher's target. */
#pragma once

#include <raceloc/gpu/context.h>
#include <raceloc/gpu/voxel_map.h>

#include <Eigen/Core>
#include <cstddef>
#include <map>
#include <utility>
#include <vector>

#include "map/map_file.h"

namespace raceloc {

/** A sliding window of tiles. The distance of a tile is that of the nearest point of its square.
 *
 * The target is built anew only when a tile within radius_m is missing from it or one of it is farther than
 * radius_m plus a whole tile; it then holds all tiles within radius_m plus half a tile. So the car drives at
 * least half a tile between two rebuilds, wherever it turns, and memory is bounded by the square of radius_m
 * plus two tiles. */
class TileWindow {
 public:
  /** Keeps references to both. \throws std::invalid_argument if a length is not finite or not > 0. */
  TileWindow(gpu::Context& context, const MapFile& map, double voxel_size_m, double radius_m);

  /** Makes every tile of the map within the radius of a position (map frame) resident.
   * \return whether there is one
   * \throws InputError for a damaged tile; the window then stays as it was.
   * \throws std::invalid_argument if the position is not finite. */
  bool moveTo(const Eigen::Vector2d& p_map_m);

  /** Voxel Gaussians of the resident tiles, map frame; empty where the map has no tile. */
  [[nodiscard]] const gpu::VoxelMap& target() const { return x_target; }
  [[nodiscard]] std::size_t residentTiles() const { return x_tiles.size(); }
  [[nodiscard]] std::size_t rebuilds() const { return x_rebuilds; }  ///< so far

 private:
  [[nodiscard]] double distanceTo(const std::pair<int, int>& tile, const Eigen::Vector2d& p_map_m) const;
  [[nodiscard]] std::vector<std::pair<int, int>> tilesWithin(double distance_m,
                                                             const Eigen::Vector2d& p_map_m) const;
  void rebuild(const Eigen::Vector2d& p_map_m);

  gpu::Context& x_context;
  const MapFile& x_map;
  double x_voxel_size_m, x_radius_m, x_tile_size_m;
  std::map<std::pair<int, int>, Tile> x_tiles;
  gpu::VoxelMap x_target;
  std::size_t x_rebuilds = 0;
};

}  // namespace raceloc
