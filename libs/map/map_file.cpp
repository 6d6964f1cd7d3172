#include "map/map_file.h"

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <stdexcept>
#include <type_traits>

#include "core/errors.h"
#include "core/output_file.h"
#include "map/map_rules.h"
#include "map/map_tables.h"

namespace raceloc {

namespace {

constexpr std::uint32_t kMapId = 0x524C4D50;  // "RLMP"
constexpr std::uint32_t kMapVersion = 2;

constexpr char kFixedTables[] = R"(
CREATE TABLE meta(key TEXT PRIMARY KEY, value TEXT NOT NULL) WITHOUT ROWID;
CREATE TABLE tiles(ix INTEGER NOT NULL, iy INTEGER NOT NULL, points INTEGER NOT NULL, fields TEXT NOT NULL,
                   checksum TEXT NOT NULL, data BLOB NOT NULL, PRIMARY KEY(ix, iy));
)";
constexpr char kDictionary[] = R"(
CREATE VIEW racetrack_dict AS SELECT number AS key_gps, number AS key_lidar, racetrack_id
                              FROM key_poses WHERE racetrack_id IS NOT NULL;
)";

constexpr char kFields[] = "x y z xx xy xz yy yz zz";
constexpr char kFieldsWithIntensity[] = "x y z xx xy xz yy yz zz intensity";

/** A row of the table of tiles. */
struct TileRow {
  std::int32_t ix, iy;
  std::int64_t points;
  std::string fields;
  Bytes data;

  /** Of the whole row: two rows that changed places are found as well. */
  [[nodiscard]] std::string checksum() const {
    Bytes bytes;
    bytes.reserve(data.size() + 128);
    append(bytes, ix);
    append(bytes, iy);
    append(bytes, points);
    append(bytes, fields);
    bytes.insert(bytes.end(), data.begin(), data.end());
    return md5Of(bytes);
  }
};

/** The arrays of a tile in the order in which `fields` names them. */
template <class TileType>
auto arraysOf(TileType& tile) {
  auto& cloud = tile.cloud;
  auto& c = tile.covariances;
  return std::array{&cloud.x, &cloud.y, &cloud.z, &c.xx, &c.xy, &c.xz, &c.yy, &c.yz, &c.zz, &cloud.intensity};
}

TileRow rowOf(const Tile& tile) {
  TileRow row{tile.ix,
              tile.iy,
              static_cast<std::int64_t>(tile.cloud.size()),
              tile.cloud.intensity.empty() ? kFields : kFieldsWithIntensity,
              {}};
  const auto arrays = arraysOf(tile);
  row.data.reserve(arrays.size() * tile.cloud.size() * sizeof(float));
  for (const std::vector<float>* array : arrays) append(row.data, *array);
  return row;
}

Tile tileOf(const TileRow& row) {
  Tile tile{row.ix, row.iy, {}, {}};
  ByteReader reader(row.data);
  for (std::vector<float>* array : arraysOf(tile))
    if (reader.left() > 0)  // else no intensity
      *array = reader.numbers<float>(static_cast<std::size_t>(row.points));
  return tile;
}

/** Over the checksums of all tables, in their fixed order. */
std::string hashOf(const std::string& checksums) {
  return "md5:" + md5Of({checksums.begin(), checksums.end()});
}

std::string nameOf(int ix, int iy) { return "tile (" + std::to_string(ix) + ", " + std::to_string(iy) + ")"; }

std::uint32_t bigEndianAt(const std::array<char, 100>& header, std::size_t at, std::size_t size) {
  std::uint32_t value = 0;
  for (std::size_t i = at; i < at + size; ++i) value = value << 8U | static_cast<unsigned char>(header[i]);
  return value;
}

/** Judges a file by its first 100 bytes (sqlite.org/fileformat.html, section 1.3), before SQLite reads it.
 * \throws InputError */
void requireReadable(const std::string& path) {
  const auto bad = [&](const std::string& what) { return InputError("map " + path + ": " + what); };
  std::ifstream in(path, std::ios::binary);
  if (!in) throw bad(std::string("cannot be read (") + std::strerror(errno) + ")");
  std::array<char, 100> header{};
  in.read(header.data(), header.size());
  constexpr char kMagic[] = "SQLite format 3";
  if (std::memcmp(header.data(), kMagic, sizeof kMagic) != 0)
    throw bad("is not an .rlmap (not an SQLite file); give a map made by raceloc-map");
  if (in.gcount() == static_cast<std::streamsize>(header.size())) {
    if (bigEndianAt(header, 68, 4) != kMapId)
      throw bad("is an SQLite file, but not an .rlmap; give a map made by raceloc-map");
    const std::uint32_t version = bigEndianAt(header, 60, 4);
    if (version != kMapVersion)
      throw bad("is of map format " + std::to_string(version) + ", but this program reads format " +
                std::to_string(kMapVersion) + "; use the raceloc that made it or build the map again");
  }
  const std::uint32_t page_size = bigEndianAt(header, 16, 2) == 1 ? 65536 : bigEndianAt(header, 16, 2);
  const std::uintmax_t expected = std::uintmax_t{page_size} * bigEndianAt(header, 28, 4);
  const std::uintmax_t found = std::filesystem::file_size(path);
  if (found != expected || found < header.size())
    throw bad("is cut short or was appended to: " + std::to_string(found) + " bytes instead of " +
              std::to_string(expected) + "; copy it again");
}

/** URI under which SQLite neither locks the file nor looks for a journal beside it. */
std::string readOnlyUri(const std::string& path) {
  std::string uri = "file://";
  constexpr char kHex[] = "0123456789ABCDEF";
  for (const char c : std::filesystem::absolute(path).string()) {
    const auto byte = static_cast<unsigned char>(c);
    if (byte > 0x7F || c == '%' || c == '?' || c == '#')
      uri += {'%', kHex[byte >> 4U], kHex[byte & 0xFU]};
    else
      uri += c;
  }
  return uri + "?mode=ro&immutable=1";
}

}  // namespace

void saveMap(const std::string& path, const TiledMap& tiles, const MapContent& content) {
  if (content.info.tile_size_m != tiles.tileSize()) throw std::invalid_argument("saveMap: two tile sizes");
  if (const std::string fault = faultOf(content); !fault.empty())
    throw std::invalid_argument("saveMap: " + fault);
  OutputFile output(path);
  {
    SqliteFile file(output.temporaryPath(), "map " + path, SqliteFile::Mode::write);
    // What a journal guards against, the temporary name already does; OutputFile flushes to the disk.
    file.run("PRAGMA journal_mode=OFF; PRAGMA synchronous=OFF; PRAGMA application_id=" +
             std::to_string(kMapId) + "; PRAGMA user_version=" + std::to_string(kMapVersion) + "; BEGIN");
    file.run(kFixedTables);
    SqlStatement meta(file, "INSERT INTO meta VALUES(?, ?)", "meta");
    std::string checksums;
    const auto keep = [&](const std::string& table, const std::string& checksum) {
      meta.write("checksum " + table, checksum);
      checksums += checksum;
    };
    const auto write = [&](const auto& rows) {
      keep(SqlTable<typename std::decay_t<decltype(rows)>::value_type>::kName, writeTable(file, rows));
    };
    write(std::vector{rowOf(content.info)});
    write(content.info.sessions);
    write(content.key_poses);
    write(content.waypoints);
    write(content.edges);
    write(content.fixes);
    write(content.road);
    write(content.walls);
    file.run(kDictionary);

    SqlStatement insert(file, "INSERT INTO tiles VALUES(?, ?, ?, ?, ?, ?)", "tiles");
    RowChecksum index;
    for (const auto& [place, tile] : tiles.tiles()) {
      TileRow row = rowOf(tile);
      const std::vector<SqlValue> head{toSql(row.ix), toSql(row.iy), row.checksum()};
      index.add(head);
      insert.write(head[0], head[1], row.points, row.fields, head[2], std::move(row.data));
    }
    keep("tiles", index.md5());

    meta.write("content_hash", hashOf(checksums));
    meta.write("tool_version", content.info.tool_version);
    meta.write("datum", "WGS84, heights above the ellipsoid");
    meta.write(
        "frames",
        "map: x east, y north, z up about the origin; body: centre of the rear axle, x forward, y left");
    file.run("COMMIT");
  }
  output.commit();
}

MapFile::MapFile(const std::string& path) {
  requireReadable(path);
  x_database = std::make_unique<SqliteFile>(readOnlyUri(path), "map " + path, SqliteFile::Mode::read);
  readContent();
}

MapFile::~MapFile() = default;
MapFile::MapFile(MapFile&&) noexcept = default;
MapFile& MapFile::operator=(MapFile&&) noexcept = default;

void MapFile::readContent() {
  SqliteFile& file = *x_database;
  std::string checksums;
  const auto info = readTable<InfoRow>(file, checksums);
  if (info.size() != 1 || !(info[0].tile_size_m > 0)) throw file.damaged("info has no tile size > 0");
  auto sessions = readTable<std::string>(file, checksums);
  x_content.info = infoOf(info[0], std::move(sessions), metaText(file, "tool_version"));
  x_content.key_poses = readTable<KeyPose>(file, checksums);
  x_content.waypoints = readTable<MapWaypoint>(file, checksums);
  x_content.edges = readTable<MapEdge>(file, checksums);
  x_content.fixes = readTable<MapFix>(file, checksums);
  x_content.road = readTable<RoadStation>(file, checksums);
  x_content.walls = readTable<WallPoint>(file, checksums);

  SqlStatement tiles(file, "SELECT ix, iy, checksum, points FROM tiles ORDER BY ix, iy", "list of tiles");
  RowChecksum index;
  while (tiles.step()) {
    index.add({tiles.cell(0), tiles.cell(1), tiles.cell(2)});
    x_tile_indices.emplace_back(static_cast<int>(tiles.get<std::int64_t>(0)),
                                static_cast<int>(tiles.get<std::int64_t>(1)));
    x_points += tiles.get<std::int64_t>(3);
  }
  requireChecksum(file, "tiles", index.md5());
  x_content_hash = hashOf(checksums + index.md5());
  if (const std::string kept = metaText(file, "content_hash"); kept != x_content_hash)
    throw file.damaged("its content hash is " + x_content_hash + ", but it should be " + kept);
}

std::optional<Tile> MapFile::tile(int ix, int iy) const {
  if (!std::binary_search(x_tile_indices.begin(), x_tile_indices.end(), std::pair{ix, iy}))
    return std::nullopt;
  const std::string name = nameOf(ix, iy);
  SqlStatement statement(*x_database,
                         "SELECT points, fields, checksum, data FROM tiles WHERE ix = ? AND iy = ?", name);
  const std::vector<SqlValue> wanted{toSql(ix), toSql(iy)};
  statement.bind(wanted);
  if (!statement.step()) throw x_database->damaged(name + " is gone");
  const TileRow row{ix, iy, statement.get<std::int64_t>(0), statement.get<std::string>(1),
                    statement.get<Bytes>(3)};
  if (row.checksum() != statement.get<std::string>(2))
    throw x_database->damaged(name + " does not fit its checksum");
  const std::size_t arrays = row.fields == kFields ? 9 : 10;
  if ((row.fields != kFields && row.fields != kFieldsWithIntensity) || row.points < 0 ||
      row.data.size() % (arrays * sizeof(float)) != 0 ||
      row.data.size() / (arrays * sizeof(float)) != static_cast<std::size_t>(row.points))
    throw x_database->damaged(name + " has an unknown layout");
  return tileOf(row);
}

TiledMap MapFile::tiles() const {
  TiledMap map(info().tile_size_m);
  for (const auto& [ix, iy] : x_tile_indices) map.insert(*tile(ix, iy));
  return map;
}

void MapFile::verify() const {
  for (const auto& [ix, iy] : x_tile_indices) static_cast<void>(tile(ix, iy));
  std::string fault = faultOf(x_content);
  if (fault.empty()) fault = wrongIdOf(x_content);
  if (!fault.empty()) throw x_database->damaged(fault);
}

}  // namespace raceloc
