/** \file
 * The `.rlmap`: a map in one SQLite file, made once by a survey and only read by cars.
 *
 * Format version 1 (`PRAGMA user_version`; `PRAGMA application_id` is 'RLMP'). All multi-byte values inside
 * blobs are little-endian, all strings UTF-8:
 * - info(key, value): tile_size_m, point_spacing_m, tool_version, config, content_hash; when the map has an
 *   origin, origin_latitude_deg, origin_longitude_deg and origin_height_m
 * - sessions(number, name), from 0
 * - key_poses(number, stamp_s, session, T_map_body): the last 12 doubles, the upper 3x4 of the matrix by rows
 * - tiles(ix, iy, points, fields, checksum, data): `fields` names the float arrays that `data` holds one
 *   after the other, `points` values each: "x y z xx xy xz yy yz zz", then " intensity" if the map has it
 *
 * A later version may add tables and keys; a change to these raises the version.
 * Checksums are MD5: they find damage and tell contents apart, they are no protection against forgery. */
#pragma once

#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "core/types.h"
#include "map/tiled_map.h"

namespace raceloc {

class SqliteFile;  // the open database: known to map_file.cpp alone

/** Where the survey car was when it took a scan that went into the map. */
struct KeyPose {
  double stamp_s;  ///< [s since the epoch, UTC]
  Pose T_map_body;
  std::string session;  ///< one of MapInfo::sessions
};

struct MapInfo {
  std::optional<GeodeticPoint> origin;  ///< of the map frame (ENU); none: the survey had no GPS
  double tile_size_m;                   ///< edge of a tile
  double point_spacing_m;               ///< edge of the voxels the points were averaged over
  std::string tool_version;             ///< the program that made the map; not part of the content hash
  std::string config;                   ///< ini text it was made with
  std::vector<std::string> sessions;    ///< the recordings, in order
};

/** Writes a map in one transaction; the file appears under its name when it is whole. The same input gives
 * the same content hash and the same blobs.
 * \throws InputError if the file cannot be written (no such folder, no right, disk full); what was there
 *         stays.
 * \throws std::invalid_argument if info.tile_size_m is not the map's, a number is not finite or a key pose's
 *         session is not listed. */
void saveMap(const std::string& path, const TiledMap& map, const MapInfo& info,
             const std::vector<KeyPose>& key_poses);

/** A map opened for reading: never changed, and no file appears beside it, so read-only media serve.
 * Everything that is handed out was checked first. One thread at a time. */
class MapFile {
 public:
  /** Reads all but the tiles' points. Cost: the key poses and a row of the index per tile.
   * \throws InputError naming the file and what is wrong: missing, not SQLite, not an .rlmap, of a version
   *         this program does not know, truncated, or info, key poses and tile checksums that do not fit the
   *         content hash. */
  explicit MapFile(const std::string& path);
  ~MapFile();
  MapFile(MapFile&&) noexcept;
  MapFile& operator=(MapFile&&) noexcept;

  [[nodiscard]] const MapInfo& info() const { return x_info; }
  [[nodiscard]] const std::vector<KeyPose>& keyPoses() const { return x_key_poses; }

  /** "md5:" and 32 hexadecimal digits over info (without tool_version), key poses and all tile checksums. */
  [[nodiscard]] const std::string& contentHash() const { return x_content_hash; }

  /** Of the tiles there are, ascending. */
  [[nodiscard]] const std::vector<std::pair<int, int>>& tileIndices() const { return x_tile_indices; }

  /** One tile, or nothing where the map has none. \throws InputError naming the tile if it is damaged. */
  [[nodiscard]] std::optional<Tile> tile(int ix, int iy) const;

  /** Reads every tile. With what opening checked, all content then fits the hash.
   * \throws InputError as tile() does. */
  void verify() const;

 private:
  void readInfo();
  void readKeyPoses();
  void checkContentHash();

  std::unique_ptr<SqliteFile> x_database;
  MapInfo x_info{};
  std::vector<KeyPose> x_key_poses;
  std::vector<std::pair<int, int>> x_tile_indices;
  std::string x_content_hash;
};

}  // namespace raceloc
