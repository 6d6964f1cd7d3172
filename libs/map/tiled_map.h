/** \file
 * The map's points, cut into square tiles so that a car needs only those around it. */
#pragma once

#include <raceloc/gpu/types.h>

#include <cstddef>
#include <cstdint>
#include <map>
#include <utility>

#include "core/types.h"

namespace raceloc {

/** One square of the map, ready for the matcher. The tile's frame has the map's axes and its origin in the
 * square's south-west corner at z = 0 of the map: p_map = p_tile + (ix, iy, 0) * tile_size_m. So floats stay
 * fine-grained however far from the map's origin the track runs. */
struct Tile {
  std::int32_t ix, iy;           ///< floor(p_map / tile_size_m): east, north
  Cloud cloud;                   ///< tile frame: x and y in 0..tile_size_m (the end only by rounding) [m]
  gpu::Covariances covariances;  ///< one a point, in the map's axes [m^2]; `neighbours` stays empty
};

/** Points grow into tiles by insert(). Within a tile they keep the order in which they came. */
class TiledMap {
 public:
  /** \throws std::invalid_argument if tile_size_m is not finite or not > 0. */
  explicit TiledMap(double tile_size_m = 32);

  /** Adds points (map frame [m]) with their covariances (map's axes [m^2]), all or none of them.
   * \throws std::invalid_argument if the numbers differ, if a point is not finite or is more than 2^20 tiles
   *         away, or if only one of this and earlier clouds has intensities. */
  void insert(const Cloud& cloud_map, const gpu::CovariancesView& covariances);

  /** Adds a tile where the map has none, as it is. \throws std::invalid_argument if there is one already. */
  void insert(Tile&& tile);

  [[nodiscard]] const std::map<std::pair<int, int>, Tile>& tiles() const { return x_tiles; }  ///< by (ix, iy)
  [[nodiscard]] double tileSize() const { return x_tile_size_m; }                             ///< [m]
  [[nodiscard]] std::size_t pointCount() const { return x_points; }

 private:
  double x_tile_size_m;
  std::size_t x_points = 0;
  std::map<std::pair<int, int>, Tile> x_tiles;
};

using TileIndex = std::pair<int, int>;  ///< (ix, iy) of a tile

/** From a place to the nearest point of a tile's square [m]; 0 within it. */
[[nodiscard]] inline double distanceToTile(const TileIndex& tile, double tile_size_m,
                                           const Eigen::Vector2d& p_map_m) {
  const Eigen::Array2d from_corner_m =
      p_map_m.array() - Eigen::Array2d(tile.first, tile.second) * tile_size_m;
  return (from_corner_m - from_corner_m.max(0.0).min(tile_size_m)).matrix().norm();
}

/** South-west corner of a tile: the tile frame's origin in the map frame [m]. */
[[nodiscard]] inline Eigen::Vector3d tileCorner(const Tile& tile, double tile_size_m) {
  return {tile.ix * tile_size_m, tile.iy * tile_size_m, 0};
}

}  // namespace raceloc
