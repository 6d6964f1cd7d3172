/** \file
 * The `.rlmap`: a map in one SQLite file, made by surveys and only read by cars.
 *
 * Format version 2 (`PRAGMA user_version`; `PRAGMA application_id` is 'RLMP'). Blobs as in bytes.h, poses as the upper
 * 3x4 of their matrix; texts UTF-8; columns that an optional value leaves empty are NULL:
 * - meta(key, value): tool_version, content_hash, one "checksum TABLE" a table below, and what datum and frames are
 * - info, sessions, key_poses, waypoints, edges, fixes, road, walls: a row has `number` (from 0) and then the members
 * of
 *   its struct in map_content.h, spelled as there; kinds are 0 odometry and 1 loop, sides 0 left and 1 right
 * - racetrack_dict(key_gps, key_lidar, racetrack_id): a view, the paper's dictionary
 * - tiles(ix, iy, points, fields, checksum, data): `fields` names the float arrays that `data` holds one
 *   after the other, `points` values each: "x y z xx xy xz yy yz zz", then " intensity" if the map has it
 *
 * A change to these raises the version; a reader takes its own version only.
 * Checksums are MD5: they find damage and tell contents apart, they are no protection against forgery. */
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "map/map_content.h"
#include "map/tiled_map.h"

namespace raceloc {

class SqliteFile;

/** Writes a map in one transaction; the file appears under its name when it is whole. The same input gives
 * the same content hash and the same blobs.
 * \throws InputError if the file cannot be written (no such folder, no right, disk full); what was there
 *         stays.
 * \throws std::invalid_argument saying what is wrong if the content contradicts the tiles or itself: another tile size,
 *         a number that is not finite, a pose that is not rigid, a session, key pose or way-point that is not there,
 *         an information or covariance that is not symmetric and positive semidefinite, stations out of order. */
void saveMap(const std::string& path, const TiledMap& tiles, const MapContent& content);

/** A map opened for reading: never changed, and no file appears beside it, so read-only media serve.
 * Everything that is handed out was checked first. One thread at a time. */
class MapFile {
 public:
  /** Reads all but the tiles' points. Cost: the content's rows and a row of the index per tile.
   * \throws InputError naming the file and what is wrong: missing, not SQLite, not an .rlmap, of a version
   *         this program does not know, truncated, or the part that does not fit its checksum. */
  explicit MapFile(const std::string& path);
  ~MapFile();
  MapFile(MapFile&&) noexcept;
  MapFile& operator=(MapFile&&) noexcept;

  [[nodiscard]] const MapContent& content() const { return x_content; }
  [[nodiscard]] const MapInfo& info() const { return x_content.info; }

  /** "md5:" and 32 hexadecimal digits over the content (without tool_version) and all tile checksums. */
  [[nodiscard]] const std::string& contentHash() const { return x_content_hash; }

  /** Of the tiles there are, ascending. */
  [[nodiscard]] const std::vector<std::pair<int, int>>& tileIndices() const { return x_tile_indices; }
  [[nodiscard]] std::int64_t pointCount() const { return x_points; }

  /** One tile, or nothing where the map has none. \throws InputError naming the tile if it is damaged. */
  [[nodiscard]] std::optional<Tile> tile(int ix, int iy) const;

  /** All of them, as saveMap() took them: with content(), what a further session is added to.
   * \throws InputError as tile() does. */
  [[nodiscard]] TiledMap tiles() const;

  /** Reads every tile, and holds the content to what saveMap() demands of it and the key poses to their racetrack IDs:
   * a way-point is within 50 m of its key pose and heads the same way within 90 deg.
   * \throws InputError as tile() does, or saying what is wrong. */
  void verify() const;

 private:
  void readContent();

  std::unique_ptr<SqliteFile> x_database;
  MapContent x_content{};
  std::vector<std::pair<int, int>> x_tile_indices;
  std::int64_t x_points = 0;
  std::string x_content_hash;
};

}  // namespace raceloc
