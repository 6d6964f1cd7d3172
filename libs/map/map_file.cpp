#include "map/map_file.h"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <array>
#include <cerrno>
#include <cmath>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <limits>
#include <stdexcept>
#include <type_traits>

#include "core/errors.h"
#include "core/output_file.h"
#include "map/sqlite_file.h"

namespace raceloc {

namespace {

constexpr std::uint32_t kApplicationId = 0x524C4D50;  // "RLMP"
constexpr std::uint32_t kFormatVersion = 2;

constexpr char kFixedTables[] = R"(
CREATE TABLE meta(key TEXT PRIMARY KEY, value TEXT NOT NULL) WITHOUT ROWID;
CREATE TABLE tiles(ix INTEGER NOT NULL, iy INTEGER NOT NULL, points INTEGER NOT NULL, fields TEXT NOT NULL,
                   checksum TEXT NOT NULL, data BLOB NOT NULL, PRIMARY KEY(ix, iy));
)";
constexpr char kDictionary[] = R"(
CREATE VIEW racetrack_dict AS SELECT number AS key_gps, number AS key_lidar, racetrack_id
                              FROM key_poses WHERE racetrack_id IS NOT NULL;
)";

/** \name A table's name, and its columns told once: for the schema, for writing, for reading and for the checksum. @{ */
struct InfoRow {
  std::optional<double> origin_latitude_deg, origin_longitude_deg, origin_height_m;
  double tile_size_m, point_spacing_m, waypoint_spacing_m;
  std::string config;
};
template <class Row>
struct Table;
template <>
struct Table<InfoRow> {
  static constexpr char kName[] = "info";
  template <class Row, class Visit>
  static void columns(Row& row, const Visit& visit) {
    visit("origin_latitude_deg", row.origin_latitude_deg);
    visit("origin_longitude_deg", row.origin_longitude_deg);
    visit("origin_height_m", row.origin_height_m);
    visit("tile_size_m", row.tile_size_m);
    visit("point_spacing_m", row.point_spacing_m);
    visit("waypoint_spacing_m", row.waypoint_spacing_m);
    visit("config", row.config);
  }
};
template <>
struct Table<std::string> {
  static constexpr char kName[] = "sessions";
  template <class Row, class Visit>
  static void columns(Row& row, const Visit& visit) {
    visit("name", row);
  }
};
template <>
struct Table<KeyPose> {
  static constexpr char kName[] = "key_poses";
  template <class Row, class Visit>
  static void columns(Row& row, const Visit& visit) {
    visit("stamp_s", row.stamp_s);
    visit("T_map_body", row.T_map_body);
    visit("session", row.session);
    visit("racetrack_id", row.racetrack_id);
    visit("T_map_body_gps", row.T_map_body_gps);
    visit("T_map_body_lidar", row.T_map_body_lidar);
  }
};
template <>
struct Table<MapWaypoint> {
  static constexpr char kName[] = "waypoints";
  template <class Row, class Visit>
  static void columns(Row& row, const Visit& visit) {
    visit("p_map_m", row.p_map_m);
    visit("heading_rad", row.heading_rad);
  }
};
template <>
struct Table<MapEdge> {
  static constexpr char kName[] = "edges";
  template <class Row, class Visit>
  static void columns(Row& row, const Visit& visit) {
    visit("i", row.i);
    visit("j", row.j);
    visit("T_i_j", row.T_i_j);
    visit("information", row.information);
    visit("kind", row.kind);
  }
};
template <>
struct Table<MapFix> {
  static constexpr char kName[] = "fixes";
  template <class Row, class Visit>
  static void columns(Row& row, const Visit& visit) {
    visit("key", row.key);
    visit("receiver", row.receiver);
    visit("p_map_antenna_m", row.p_map_antenna_m);
    visit("cov_map_m2", row.cov_map_m2);
    visit("p_body_antenna_m", row.p_body_antenna_m);
    visit("weight", row.weight);
  }
};
template <>
struct Table<RoadStation> {
  static constexpr char kName[] = "road";
  template <class Row, class Visit>
  static void columns(Row& row, const Visit& visit) {
    visit("station_m", row.station_m);
    visit("height_m", row.height_m);
    visit("grade_rad", row.grade_rad);
    visit("bank_rad", row.bank_rad);
  }
};
template <>
struct Table<WallPoint> {
  static constexpr char kName[] = "walls";
  template <class Row, class Visit>
  static void columns(Row& row, const Visit& visit) {
    visit("station_m", row.station_m);
    visit("side", row.side);
    visit("p_map_foot_m", row.p_map_foot_m);
    visit("height_m", row.height_m);
  }
};
/** @} */

/** \name A member as a cell, and back. fromCell() returns false for a cell that cannot be one. @{ */
template <class T>
Cell toCell(const T& value) {
  if constexpr (std::is_floating_point_v<T>)
    return double{value};
  else if constexpr (std::is_same_v<T, std::string>)
    return value;
  else
    return static_cast<std::int64_t>(value);  // numbers and enumerations
}
template <int Rows, int Columns>
Cell toCell(const Eigen::Matrix<double, Rows, Columns>& matrix) {
  Bytes bytes;
  append(bytes, matrix);
  return bytes;
}
Cell toCell(const Pose& T) {
  Bytes bytes;
  append(bytes, T.matrix().topRows<3>());
  return bytes;
}
template <class T>
Cell toCell(const std::optional<T>& value) {
  return value ? toCell(*value) : Cell();
}

template <class T>
bool fromCell(const Cell& cell, T& value) {
  if constexpr (std::is_floating_point_v<T> || std::is_same_v<T, std::string>) {
    const auto* found = std::get_if<T>(&cell);
    if (found != nullptr) value = *found;
    return found != nullptr;
  } else {
    const auto* found = std::get_if<std::int64_t>(&cell);
    if (found != nullptr) value = static_cast<T>(*found);
    return found != nullptr;
  }
}
template <int Rows, int Columns>
bool fromCell(const Cell& cell, Eigen::Matrix<double, Rows, Columns>& matrix) {
  const auto* bytes = std::get_if<Bytes>(&cell);
  if (bytes == nullptr || bytes->size() != sizeof(double) * Rows * Columns) return false;
  matrix = ByteReader(*bytes).matrix<Eigen::Matrix<double, Rows, Columns>>();
  return true;
}
bool fromCell(const Cell& cell, Pose& T) {
  Eigen::Matrix<double, 3, 4> rows;
  if (!fromCell(cell, rows)) return false;
  T.setIdentity();
  T.matrix().topRows<3>() = rows;
  return true;
}
template <class T>
bool fromCell(const Cell& cell, std::optional<T>& value) {
  if (std::holds_alternative<std::monostate>(cell)) return true;
  return fromCell(cell, value.emplace());
}
/** @} */

/** One table's rows as what its checksum is over: of every cell what it is and what is in it. */
class RowChecksum {
 public:
  void add(const std::vector<Cell>& row) {
    for (const Cell& cell : row) {
      append(x_bytes, static_cast<std::uint32_t>(cell.index()));
      std::visit([this](const auto& value) { addValue(value); }, cell);
    }
  }
  [[nodiscard]] std::string md5() const { return md5Of(x_bytes); }

 private:
  void addValue(std::monostate /*nothing*/) {}
  void addValue(const Bytes& value) { addValue(std::string(value.begin(), value.end())); }
  template <class T>
  void addValue(const T& value) {
    append(x_bytes, value);
  }
  Bytes x_bytes;
};

template <class Row>
std::vector<Cell> cellsOf(const Row& row) {
  std::vector<Cell> cells;
  Table<Row>::columns(row, [&](const char* /*name*/, const auto& value) { cells.push_back(toCell(value)); });
  return cells;
}

/** Makes the table and fills it. \return its checksum */
template <class Row>
std::string writeTable(SqliteFile& file, const std::vector<Row>& rows) {
  const std::string name = Table<Row>::kName;
  std::string columns = "number INTEGER PRIMARY KEY", places = "?";
  const Row any{};
  Table<Row>::columns(any, [&](const char* column, const auto& /*value*/) {
    columns += std::string(", ") + column;
    places += ", ?";
  });
  file.run("CREATE TABLE " + name + "(" + columns + ")");
  Statement insert(file, "INSERT INTO " + name + " VALUES(" + places + ")", name);
  RowChecksum checksum;
  std::int64_t number = 0;
  for (const Row& row : rows) {
    std::vector<Cell> cells = cellsOf(row);
    checksum.add(cells);
    cells.insert(cells.begin(), Cell(number++));
    insert.writeCells(cells);
  }
  return checksum.md5();
}

std::string metaText(SqliteFile& file, const std::string& key) {
  Statement statement(file, "SELECT value FROM meta WHERE key = ?", "meta");
  const std::vector<Cell> wanted{key};
  statement.bind(wanted);
  if (!statement.step()) throw file.damaged("meta has no " + key);
  return statement.get<std::string>(0);
}

void requireChecksum(SqliteFile& file, const std::string& table, const std::string& found) {
  if (found != metaText(file, "checksum " + table)) throw file.damaged(table + " does not fit its checksum");
}

/** Reads a table whole. \param checksums  gets its checksum \throws InputError naming it if it is damaged */
template <class Row>
std::vector<Row> readTable(SqliteFile& file, std::string& checksums) {
  const std::string name = Table<Row>::kName;
  std::string columns;
  const Row any{};
  Table<Row>::columns(any, [&](const char* column, const auto& /*value*/) {
    columns += (columns.empty() ? "" : ", ") + std::string(column);
  });
  Statement select(file, "SELECT " + columns + " FROM " + name + " ORDER BY number", name);
  RowChecksum checksum;
  std::vector<Row> rows;
  while (select.step()) {
    Row row{};
    int column = 0;
    bool fits = true;
    std::vector<Cell> cells;
    Table<Row>::columns(row, [&](const char* /*name*/, auto& value) {
      cells.push_back(select.cell(column++));
      fits = fromCell(cells.back(), value) && fits;
    });
    if (!fits)
      throw file.damaged(name + " row " + std::to_string(rows.size()) + " has a column of the wrong type");
    checksum.add(cells);
    rows.push_back(std::move(row));
  }
  requireChecksum(file, name, checksum.md5());
  checksums += checksum.md5();
  return rows;
}

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

InfoRow rowOf(const MapInfo& info) {
  InfoRow row{{}, {}, {}, info.tile_size_m, info.point_spacing_m, info.waypoint_spacing_m, info.config};
  if (info.origin) {
    row.origin_latitude_deg = info.origin->latitude_deg;
    row.origin_longitude_deg = info.origin->longitude_deg;
    row.origin_height_m = info.origin->height_m;
  }
  return row;
}

MapInfo infoOf(const InfoRow& row, std::vector<std::string> sessions, std::string tool_version) {
  std::optional<GeodeticPoint> origin;
  if (row.origin_latitude_deg && row.origin_longitude_deg && row.origin_height_m)
    origin = GeodeticPoint{*row.origin_latitude_deg, *row.origin_longitude_deg, *row.origin_height_m};
  return {origin,     row.tile_size_m,     row.point_spacing_m,   std::move(tool_version),
          row.config, std::move(sessions), row.waypoint_spacing_m};
}

template <class Matrix>
bool isPositive(const Matrix& matrix) {  // semidefinite, up to rounding
  const double scale = matrix.cwiseAbs().maxCoeff();
  return (matrix - matrix.transpose()).cwiseAbs().maxCoeff() <= 1e-6 * scale &&
         Eigen::SelfAdjointEigenSolver<Matrix>(matrix, Eigen::EigenvaluesOnly).eigenvalues()(0) >=
             -1e-6 * scale;
}
bool isRigid(const Pose& T) {
  const Eigen::Matrix3d R = T.linear();
  return (R.transpose() * R - Eigen::Matrix3d::Identity()).cwiseAbs().maxCoeff() < 1e-6 &&
         R.determinant() > 0;
}

/** Whether all numbers in a row are finite: in its cells, where every one of them is. */
template <class Row>
bool isFinite(const Row& row) {
  for (const Cell& cell : cellsOf(row)) {
    if (const auto* number = std::get_if<double>(&cell); number != nullptr && !std::isfinite(*number))
      return false;
    if (const auto* bytes = std::get_if<Bytes>(&cell); bytes != nullptr)
      for (const double value : ByteReader(*bytes).numbers<double>(bytes->size() / sizeof(double)))
        if (!std::isfinite(value)) return false;
  }
  return true;
}
template <class Row>
std::string notFinite(const std::vector<Row>& rows) {
  for (std::size_t i = 0; i < rows.size(); ++i)
    if (!isFinite(rows[i]))
      return std::string(Table<Row>::kName) + " row " + std::to_string(i) +
             " has a number that is not finite";
  return "";
}

/** What contradicts itself in a map's content, or nothing. The rule for writers and for `check`. */
std::string faultOf(const MapContent& content) {
  const MapInfo& info = content.info;
  for (const std::string& fault :
       {notFinite(std::vector{rowOf(info)}), notFinite(content.key_poses), notFinite(content.waypoints),
        notFinite(content.edges), notFinite(content.fixes), notFinite(content.road),
        notFinite(content.walls)})
    if (!fault.empty()) return fault;
  if (!content.waypoints.empty() && !(info.waypoint_spacing_m > 0))
    return "the way-points have no spacing > 0";
  const auto hasKey = [&](std::int32_t key) {
    return key >= 0 && static_cast<std::size_t>(key) < content.key_poses.size();
  };

  for (std::size_t i = 0; i < content.key_poses.size(); ++i) {
    const KeyPose& k = content.key_poses[i];
    const std::string name = "key pose " + std::to_string(i);
    if (!isRigid(k.T_map_body) || (k.T_map_body_gps && !isRigid(*k.T_map_body_gps)) ||
        (k.T_map_body_lidar && !isRigid(*k.T_map_body_lidar)))
      return name + " has a pose that is not rigid";
    if (std::find(info.sessions.begin(), info.sessions.end(), k.session) == info.sessions.end())
      return name + " is of session " + k.session + ", which is not listed";
    if (k.racetrack_id &&
        (*k.racetrack_id < 0 || static_cast<std::size_t>(*k.racetrack_id) >= content.waypoints.size()))
      return name + " has racetrack ID " + std::to_string(*k.racetrack_id) + ", but there are " +
             std::to_string(content.waypoints.size()) + " way-points";
  }
  for (std::size_t i = 0; i < content.edges.size(); ++i) {
    const MapEdge& e = content.edges[i];
    const std::string name = "edge " + std::to_string(i);
    if (!hasKey(e.i) || !hasKey(e.j) || e.i == e.j) return name + " does not tie two key poses";
    if (!isRigid(e.T_i_j)) return name + " has a pose that is not rigid";
    if (!isPositive(e.information)) return name + " has no positive information";
    if (e.kind != EdgeKind::odometry && e.kind != EdgeKind::loop) return name + " is of an unknown kind";
  }
  for (std::size_t i = 0; i < content.fixes.size(); ++i) {
    const MapFix& f = content.fixes[i];
    const std::string name = "fix " + std::to_string(i);
    if (!hasKey(f.key)) return name + " is of a key pose that is not there";
    if (!isPositive(f.cov_map_m2)) return name + " has no positive covariance";
    if (!(f.weight >= 0 && f.weight <= 1)) return name + " has a weight beyond 0 .. 1";
  }
  const double length_m = info.waypoint_spacing_m * static_cast<double>(content.waypoints.size());
  double last_m = -1;
  for (const RoadStation& r : content.road) {
    if (!(r.station_m > last_m && r.station_m >= 0 && r.station_m < length_m))
      return "stations of the road are out of order";
    last_m = r.station_m;
  }
  std::pair last(-1, -1.0);
  for (const WallPoint& w : content.walls) {
    const std::pair now(static_cast<int>(w.side), w.station_m);
    if (!(now > last && (w.side == Side::left || w.side == Side::right) && w.station_m >= 0 &&
          w.station_m < length_m))
      return "stations of the walls are out of order";
    last = now;
  }
  return "";
}

/** The first key pose that its way-point cannot belong to, or nothing. */
std::string wrongIdOf(const MapContent& content) {
  constexpr double kWithin_m = 50;  // half the widest road, with the pit lane beside it
  for (std::size_t i = 0; i < content.key_poses.size(); ++i) {
    const KeyPose& k = content.key_poses[i];
    if (!k.racetrack_id) continue;
    const MapWaypoint& w = content.waypoints[static_cast<std::size_t>(*k.racetrack_id)];
    const double away_m = (w.p_map_m - k.T_map_body.translation()).head<2>().norm();
    const double turned_rad = std::abs(wrapAngle(yawOf(k.T_map_body) - w.heading_rad));
    if (away_m > kWithin_m || turned_rad > 90 * kDegree)
      return "key pose " + std::to_string(i) + " is " + std::to_string(away_m) + " m and " +
             std::to_string(turned_rad / kDegree) + " deg away from the way-point of its racetrack ID " +
             std::to_string(*k.racetrack_id);
  }
  return "";
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
    if (bigEndianAt(header, 68, 4) != kApplicationId)
      throw bad("is an SQLite file, but not an .rlmap; give a map made by raceloc-map");
    const std::uint32_t version = bigEndianAt(header, 60, 4);
    if (version != kFormatVersion)
      throw bad("is of map format " + std::to_string(version) + ", but this program reads format " +
                std::to_string(kFormatVersion) + "; use the raceloc that made it or build the map again");
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
             std::to_string(kApplicationId) + "; PRAGMA user_version=" + std::to_string(kFormatVersion) +
             "; BEGIN");
    file.run(kFixedTables);
    Statement meta(file, "INSERT INTO meta VALUES(?, ?)", "meta");
    std::string checksums;
    const auto keep = [&](const std::string& table, const std::string& checksum) {
      meta.write("checksum " + table, checksum);
      checksums += checksum;
    };
    const auto write = [&](const auto& rows) {
      keep(Table<typename std::decay_t<decltype(rows)>::value_type>::kName, writeTable(file, rows));
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

    Statement insert(file, "INSERT INTO tiles VALUES(?, ?, ?, ?, ?, ?)", "tiles");
    RowChecksum index;
    for (const auto& [place, tile] : tiles.tiles()) {
      TileRow row = rowOf(tile);
      const std::vector<Cell> head{toCell(row.ix), toCell(row.iy), row.checksum()};
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

  Statement tiles(file, "SELECT ix, iy, checksum, points FROM tiles ORDER BY ix, iy", "list of tiles");
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
  Statement statement(*x_database, "SELECT points, fields, checksum, data FROM tiles WHERE ix = ? AND iy = ?",
                      name);
  const std::vector<Cell> wanted{toCell(ix), toCell(iy)};
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
