/** \file
 * The part of a map around the car, as the matcher's target. */
#pragma once

#include <raceloc/gpu/context.h>
#include <raceloc/gpu/voxel_map.h>

#include <Eigen/Core>
#include <cstddef>
#include <future>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "map/map_file.h"

namespace raceloc {

/** A sliding window of tiles. The distance of a tile is that of the nearest point of its square.
 *
 * A target holds all tiles within radius_m plus a whole tile of its centre. When the car has gone half a tile from the
 * centre, the next target, whose centre is half a tile ahead in that direction, is read and built on another thread. It
 * comes into use at the first call after half a tile has been driven since it was asked for, or before, when the car is
 * a whole tile from the centre; if it is not ready then, the call waits. A target that would not do (the car jumped or
 * turned round) is dropped, and one about the car is built within the call. So both what is resident and when it
 * changes follow from the positions alone, whatever the threads do, and a car whose positions are at most half a tile
 * apart does not wait as long as a target is built while it drives that far: 0.17 s at 90 m/s with tiles of 32 m.
 * Memory: two targets, and the points of one.
 *
 * A tile that is damaged or gone is left out and named once. */
class TileWindow {
 public:
  /** Keeps references to both. While it lives, nobody else reads tiles of the map; the context is used within moveTo()
   * alone. \throws std::invalid_argument if a length is not finite or not > 0. */
  TileWindow(gpu::Context& context, const MapFile& map, double voxel_size_m, double radius_m);
  TileWindow(const TileWindow&) = delete;  // the other thread knows this one
  TileWindow& operator=(const TileWindow&) = delete;

  /** Makes every tile of the map within the radius of a position (map frame) resident.
   * \return whether there is one
   * \throws std::invalid_argument if the position is not finite. */
  bool moveTo(const Eigen::Vector2d& p_map_m);

  /** Voxel Gaussians of the resident tiles, map frame; empty where the map has no tile. */
  [[nodiscard]] const gpu::VoxelMap& target() const { return x_now.voxels; }
  [[nodiscard]] std::size_t residentTiles() const { return x_now.tiles.size(); }
  [[nodiscard]] std::size_t rebuilds() const { return x_rebuilds; }  ///< targets that came into use so far
  [[nodiscard]] std::size_t waits() const {
    return x_waits;
  }  ///< calls that had to wait for one, the first included

  /** What was found wrong with tiles since the last call of this: each of them is named once, by an error of MapFile,
   * when the target without it comes into use. */
  [[nodiscard]] std::vector<std::string> takeFaults();
  /** Whether a tile within the radius of the newest position is left out. */
  [[nodiscard]] bool isDegraded() const { return x_degraded; }

 private:
  struct Target {
    Eigen::Vector2d centre_map_m;
    gpu::VoxelMap voxels;
    std::vector<TileIndex> tiles, left_out;
    std::vector<std::string> faults;
  };
  [[nodiscard]] std::vector<TileIndex> tilesWithin(double distance_m, const Eigen::Vector2d& p_map_m) const;
  [[nodiscard]] bool anyNear(const std::vector<TileIndex>& tiles, const Eigen::Vector2d& p_map_m) const;
  [[nodiscard]] double fromCentre(const Eigen::Vector2d& p_map_m) const;
  /** Reads what is missing and builds a target in the host's memory. One thread at a time. */
  [[nodiscard]] Target built(const Eigen::Vector2d& centre_map_m);
  void use(Target target);
  /** The target that was asked for; waits for it. */
  void useNext();

  gpu::Context& x_context;
  const MapFile& x_map;
  double x_voxel_size_m, x_radius_m, x_tile_size_m;
  bool x_degraded = false;
  Target x_now;
  std::size_t x_rebuilds = 0, x_waits = 0;
  std::vector<std::string> x_faults;
  std::optional<Eigen::Vector2d> x_last_map_m;  ///< position; none before the first
  double x_driven_m = 0;                        ///< since the next target was asked for

  // Of whoever builds: the other thread while x_next is valid, else this one.
  std::map<TileIndex, Tile> x_points;  ///< of the target that was built last
  std::set<TileIndex> x_damaged;
  std::future<Target> x_next;  ///< last, so that it has ended before the rest goes
};

}  // namespace raceloc
