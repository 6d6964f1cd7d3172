#include "map/map_file.h"

#include <mrpt/system/md5.h>
#include <sqlite3.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <stdexcept>
#include <type_traits>

#include "core/errors.h"
#include "core/output_file.h"

namespace raceloc {

/** One connection. Every failure becomes an InputError: what can fail in fixed statements is the file. */
class SqliteFile {
 public:
  enum class Mode { read, write };

  /** `path` is what SQLite opens, `name` what errors call it. */
  SqliteFile(const std::string& path, std::string name, Mode mode) : x_name(std::move(name)), x_mode(mode) {
    const int flags = mode == Mode::read ? SQLITE_OPEN_READONLY | SQLITE_OPEN_URI
                                         : SQLITE_OPEN_READWRITE | SQLITE_OPEN_CREATE;
    if (sqlite3_open_v2(path.c_str(), &x_handle, flags, nullptr) != SQLITE_OK) {
      const InputError why = error();
      sqlite3_close(x_handle);
      throw why;
    }
  }
  ~SqliteFile() { sqlite3_close(x_handle); }
  SqliteFile(const SqliteFile&) = delete;
  SqliteFile& operator=(const SqliteFile&) = delete;

  void run(const std::string& sql) {
    if (sqlite3_exec(x_handle, sql.c_str(), nullptr, nullptr, nullptr) != SQLITE_OK) throw error();
  }

  /** The newest failure, for the user. `part` is the part of the file it happened in. */
  [[nodiscard]] InputError error(const std::string& part = "") const {
    const std::string reason = " (" + std::string(sqlite3_errmsg(x_handle)) + ")";
    if (x_mode == Mode::write)
      return InputError("map " + x_name + ": cannot be written" + reason + "; check the space left");
    return damaged(part + " cannot be read" + reason);
  }
  [[nodiscard]] InputError damaged(const std::string& what) const {
    return InputError("map " + x_name + ": damaged: " + what + "; copy it again or build it again");
  }

  [[nodiscard]] sqlite3* handle() const { return x_handle; }

 private:
  sqlite3* x_handle = nullptr;
  std::string x_name;
  Mode x_mode;
};

namespace {

constexpr std::uint32_t kApplicationId = 0x524C4D50;  // "RLMP"
constexpr std::uint32_t kFormatVersion = 1;

constexpr char kSchema[] = R"(
CREATE TABLE info(key TEXT PRIMARY KEY, value NOT NULL) WITHOUT ROWID;
CREATE TABLE sessions(number INTEGER PRIMARY KEY, name TEXT NOT NULL);
CREATE TABLE key_poses(number INTEGER PRIMARY KEY, stamp_s REAL NOT NULL,
                       session INTEGER NOT NULL REFERENCES sessions(number), T_map_body BLOB NOT NULL);
CREATE TABLE tiles(ix INTEGER NOT NULL, iy INTEGER NOT NULL, points INTEGER NOT NULL, fields TEXT NOT NULL,
                   checksum TEXT NOT NULL, data BLOB NOT NULL, PRIMARY KEY(ix, iy));
)";

using Bytes = std::vector<char>;

/** A prepared statement; `part` is what its failures are about. Blobs and texts bound to it must outlive
 * step(). */
class Statement {
 public:
  Statement(SqliteFile& file, const std::string& sql, std::string part)
      : x_file(file), x_part(std::move(part)) {
    check(sqlite3_prepare_v2(file.handle(), sql.c_str(), -1, &x_handle, nullptr));
  }
  ~Statement() { sqlite3_finalize(x_handle); }
  Statement(const Statement&) = delete;
  Statement& operator=(const Statement&) = delete;

  /** Binds all parameters in order and runs a statement that returns no row. */
  template <class... Values>
  void write(const Values&... values) {
    bind(values...);
    step();
    check(sqlite3_reset(x_handle));
  }
  template <class... Values>
  void bind(const Values&... values) {
    int index = 0;
    (bindOne(++index, values), ...);
  }
  bool step() {  ///< whether there is a row
    const int result = sqlite3_step(x_handle);
    if (result != SQLITE_ROW && result != SQLITE_DONE) throw x_file.error(x_part);
    return result == SQLITE_ROW;
  }
  [[nodiscard]] std::int64_t integer(int column) const { return sqlite3_column_int64(x_handle, column); }
  [[nodiscard]] double real(int column) const { return sqlite3_column_double(x_handle, column); }
  [[nodiscard]] Bytes blob(int column) const {
    const auto* data =
        static_cast<const char*>(sqlite3_column_blob(x_handle, column));  // null if it is empty
    return data == nullptr ? Bytes() : Bytes(data, data + sqlite3_column_bytes(x_handle, column));
  }
  [[nodiscard]] std::string text(int column) const {
    const Bytes bytes = blob(column);
    return {bytes.begin(), bytes.end()};
  }

 private:
  void check(int result) const {
    if (result != SQLITE_OK) throw x_file.error(x_part);
  }
  void bindOne(int index, const std::string& text) {
    check(sqlite3_bind_text64(x_handle, index, text.data(), text.size(), SQLITE_STATIC, SQLITE_UTF8));
  }
  void bindOne(int index, const Bytes& blob) {
    check(sqlite3_bind_blob64(x_handle, index, blob.data(), blob.size(), SQLITE_STATIC));
  }
  template <class Number>
  void bindOne(int index, Number value) {
    if constexpr (std::is_floating_point_v<Number>)
      check(sqlite3_bind_double(x_handle, index, value));
    else
      check(sqlite3_bind_int64(x_handle, index, static_cast<std::int64_t>(value)));
  }

  SqliteFile& x_file;
  std::string x_part;
  sqlite3_stmt* x_handle = nullptr;
};

/** \name Bytes that are the same on every machine: little-endian, strings with their length before them. @{
 */
template <class Number>
using BitsOf = std::conditional_t<sizeof(Number) == 4, std::uint32_t, std::uint64_t>;

template <class Number>
void append(Bytes& bytes, Number value) {
  static_assert(sizeof(Number) == 4 || sizeof(Number) == 8);
  BitsOf<Number> bits{};
  std::memcpy(&bits, &value, sizeof bits);
  std::array<char, sizeof bits> little_endian{};
  for (std::size_t i = 0; i < sizeof bits; ++i) little_endian[i] = static_cast<char>(bits >> (8 * i) & 0xFF);
  bytes.insert(bytes.end(), little_endian.begin(), little_endian.end());
}
void append(Bytes& bytes, const std::string& text) {
  append(bytes, static_cast<std::uint64_t>(text.size()));
  bytes.insert(bytes.end(), text.begin(), text.end());
}
template <class Number>
Number numberAt(const char* bytes) {
  BitsOf<Number> bits = 0;
  for (std::size_t i = 0; i < sizeof bits; ++i)
    bits |= static_cast<BitsOf<Number>>(static_cast<unsigned char>(bytes[i])) << (8 * i);
  Number value{};
  std::memcpy(&value, &bits, sizeof value);
  return value;
}
/** @} */

std::string md5Of(const Bytes& bytes) {
  return mrpt::system::md5(reinterpret_cast<const unsigned char*>(bytes.data()), bytes.size());
}

/** SQLite does not keep the sign of a zero; the hash shall not see it either. */
double withoutNegativeZero(double value) { return value + 0.0; }

Bytes bytesOf(const Pose& T) {
  Bytes bytes;
  for (int row = 0; row < 3; ++row)
    for (int column = 0; column < 4; ++column) append(bytes, T.matrix()(row, column));
  return bytes;
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
  for (const std::vector<float>* array : arrays)
    for (const float value : *array) append(row.data, value);
  return row;
}

Tile tileOf(const TileRow& row) {
  Tile tile{row.ix, row.iy, {}, {}};
  const auto n = static_cast<std::size_t>(row.points);
  const char* next = row.data.data();
  for (std::vector<float>* array : arraysOf(tile)) {
    if (next == row.data.data() + row.data.size()) break;  // no intensity
    array->reserve(n);
    for (std::size_t i = 0; i < n; ++i, next += sizeof(float)) array->push_back(numberAt<float>(next));
  }
  return tile;
}

/** The numbers of a map as a whole. */
std::vector<double> numbersOf(const MapInfo& info) {
  std::vector<double> numbers{info.tile_size_m, info.point_spacing_m};
  if (info.origin)
    numbers.insert(numbers.end(),
                   {info.origin->latitude_deg, info.origin->longitude_deg, info.origin->height_m});
  return numbers;
}

struct TileChecksum {
  std::int32_t ix, iy;
  std::string checksum;
};

std::string contentHashOf(const MapInfo& info, const std::vector<KeyPose>& key_poses,
                          const std::vector<TileChecksum>& tiles) {
  Bytes bytes;
  append(bytes, static_cast<std::uint64_t>(numbersOf(info).size()));
  for (const double value : numbersOf(info)) append(bytes, withoutNegativeZero(value));
  append(bytes, info.config);
  append(bytes, static_cast<std::uint64_t>(info.sessions.size()));
  for (const std::string& session : info.sessions) append(bytes, session);
  append(bytes, static_cast<std::uint64_t>(key_poses.size()));
  for (const KeyPose& key_pose : key_poses) {
    append(bytes, withoutNegativeZero(key_pose.stamp_s));
    append(bytes, key_pose.session);
    const Bytes pose = bytesOf(key_pose.T_map_body);
    bytes.insert(bytes.end(), pose.begin(), pose.end());
  }
  append(bytes, static_cast<std::uint64_t>(tiles.size()));
  for (const TileChecksum& tile : tiles) {
    append(bytes, tile.ix);
    append(bytes, tile.iy);
    append(bytes, tile.checksum);
  }
  return "md5:" + md5Of(bytes);
}

std::int64_t sessionNumber(const MapInfo& info, const std::string& session) {
  const auto found = std::find(info.sessions.begin(), info.sessions.end(), session);
  if (found == info.sessions.end())
    throw std::invalid_argument("saveMap: a key pose of session " + session + ", which is not listed");
  return found - info.sessions.begin();
}

void requireSound(const TiledMap& map, const MapInfo& info, const std::vector<KeyPose>& key_poses) {
  if (info.tile_size_m != map.tileSize()) throw std::invalid_argument("saveMap: two tile sizes");
  for (const double value : numbersOf(info))
    if (!std::isfinite(value)) throw std::invalid_argument("saveMap: a number of the info is not finite");
  for (const KeyPose& key_pose : key_poses) {
    if (!std::isfinite(key_pose.stamp_s) || !key_pose.T_map_body.matrix().allFinite())
      throw std::invalid_argument("saveMap: a key pose is not finite");
    sessionNumber(info, key_pose.session);
  }
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

void saveMap(const std::string& path, const TiledMap& map, const MapInfo& info,
             const std::vector<KeyPose>& key_poses) {
  requireSound(map, info, key_poses);
  OutputFile output(path);
  {
    SqliteFile file(output.temporaryPath(), path, SqliteFile::Mode::write);
    // What a journal guards against, the temporary name already does; OutputFile flushes to the disk.
    file.run("PRAGMA journal_mode=OFF; PRAGMA synchronous=OFF; PRAGMA application_id=" +
             std::to_string(kApplicationId) + "; PRAGMA user_version=" + std::to_string(kFormatVersion) +
             "; BEGIN");
    file.run(kSchema);

    Statement session(file, "INSERT INTO sessions VALUES(?, ?)", "sessions");
    for (std::size_t i = 0; i < info.sessions.size(); ++i) session.write(i, info.sessions[i]);

    Statement pose(file, "INSERT INTO key_poses VALUES(?, ?, ?, ?)", "key poses");
    for (std::size_t i = 0; i < key_poses.size(); ++i)
      pose.write(i, key_poses[i].stamp_s, sessionNumber(info, key_poses[i].session),
                 bytesOf(key_poses[i].T_map_body));

    Statement tile_statement(file, "INSERT INTO tiles VALUES(?, ?, ?, ?, ?, ?)", "tiles");
    std::vector<TileChecksum> checksums;
    for (const auto& [index, tile] : map.tiles()) {
      const TileRow row = rowOf(tile);
      checksums.push_back({row.ix, row.iy, row.checksum()});
      tile_statement.write(row.ix, row.iy, row.points, row.fields, checksums.back().checksum, row.data);
    }

    Statement entry(file, "INSERT INTO info VALUES(?, ?)", "info");
    const auto write = [&](const std::string& key, const auto& value) { entry.write(key, value); };
    if (info.origin) {
      write("origin_latitude_deg", info.origin->latitude_deg);
      write("origin_longitude_deg", info.origin->longitude_deg);
      write("origin_height_m", info.origin->height_m);
    }
    write("tile_size_m", info.tile_size_m);
    write("point_spacing_m", info.point_spacing_m);
    write("tool_version", info.tool_version);
    write("config", info.config);
    write("content_hash", contentHashOf(info, key_poses, checksums));
    file.run("COMMIT");
  }
  output.commit();
}

MapFile::MapFile(const std::string& path) {
  requireReadable(path);
  x_database = std::make_unique<SqliteFile>(readOnlyUri(path), path, SqliteFile::Mode::read);
  readInfo();
  readKeyPoses();
  checkContentHash();
}

MapFile::~MapFile() = default;
MapFile::MapFile(MapFile&&) noexcept = default;
MapFile& MapFile::operator=(MapFile&&) noexcept = default;

void MapFile::readInfo() {
  const auto find = [&](const std::string& key) {
    auto statement = std::make_unique<Statement>(*x_database, "SELECT value FROM info WHERE key = ?", "info");
    statement->bind(key);
    return statement->step() ? std::move(statement) : nullptr;
  };
  const auto get = [&](const std::string& key) {
    auto found = find(key);
    if (!found) throw x_database->damaged("info has no " + key);
    return found;
  };
  if (find("origin_latitude_deg"))
    x_info.origin = {get("origin_latitude_deg")->real(0), get("origin_longitude_deg")->real(0),
                     get("origin_height_m")->real(0)};
  x_info.tile_size_m = get("tile_size_m")->real(0);
  if (!(x_info.tile_size_m > 0)) throw x_database->damaged("info has no tile size > 0");
  x_info.point_spacing_m = get("point_spacing_m")->real(0);
  x_info.tool_version = get("tool_version")->text(0);
  x_info.config = get("config")->text(0);
  x_content_hash = get("content_hash")->text(0);
  Statement sessions(*x_database, "SELECT name FROM sessions ORDER BY number", "sessions");
  while (sessions.step()) x_info.sessions.push_back(sessions.text(0));
}

void MapFile::readKeyPoses() {
  Statement statement(*x_database, "SELECT stamp_s, session, T_map_body FROM key_poses ORDER BY number",
                      "key poses");
  while (statement.step()) {
    const std::int64_t session = statement.integer(1);
    const Bytes bytes = statement.blob(2);
    if (session < 0 || static_cast<std::size_t>(session) >= x_info.sessions.size() ||
        bytes.size() != 12 * sizeof(double))
      throw x_database->damaged("key pose " + std::to_string(x_key_poses.size()) +
                                " has no session or no pose");
    KeyPose key_pose{statement.real(0), Pose::Identity(), x_info.sessions[static_cast<std::size_t>(session)]};
    for (int i = 0; i < 12; ++i)
      key_pose.T_map_body.matrix()(i / 4, i % 4) =
          numberAt<double>(bytes.data() + static_cast<std::size_t>(i) * sizeof(double));
    x_key_poses.push_back(std::move(key_pose));
  }
}

void MapFile::checkContentHash() {
  Statement statement(*x_database, "SELECT ix, iy, checksum FROM tiles ORDER BY ix, iy", "list of tiles");
  std::vector<TileChecksum> checksums;
  while (statement.step()) {
    const auto ix = static_cast<std::int32_t>(statement.integer(0));
    const auto iy = static_cast<std::int32_t>(statement.integer(1));
    checksums.push_back({ix, iy, statement.text(2)});
    x_tile_indices.emplace_back(ix, iy);
  }
  const std::string found = contentHashOf(x_info, x_key_poses, checksums);
  if (found != x_content_hash)
    throw x_database->damaged("its content hash is " + found + ", but it should be " + x_content_hash);
}

std::optional<Tile> MapFile::tile(int ix, int iy) const {
  if (!std::binary_search(x_tile_indices.begin(), x_tile_indices.end(), std::pair{ix, iy}))
    return std::nullopt;
  const std::string name = nameOf(ix, iy);
  Statement statement(*x_database, "SELECT points, fields, checksum, data FROM tiles WHERE ix = ? AND iy = ?",
                      name);
  statement.bind(ix, iy);
  if (!statement.step()) throw x_database->damaged(name + " is gone");
  const TileRow row{ix, iy, statement.integer(0), statement.text(1), statement.blob(3)};
  if (row.checksum() != statement.text(2)) throw x_database->damaged(name + " does not fit its checksum");
  const std::size_t arrays = row.fields == kFields ? 9 : 10;
  if ((row.fields != kFields && row.fields != kFieldsWithIntensity) || row.points < 0 ||
      row.data.size() % (arrays * sizeof(float)) != 0 ||
      row.data.size() / (arrays * sizeof(float)) != static_cast<std::size_t>(row.points))
    throw x_database->damaged(name + " has an unknown layout");
  return tileOf(row);
}

void MapFile::verify() const {
  for (const auto& [ix, iy] : x_tile_indices) static_cast<void>(tile(ix, iy));
}

}  // namespace raceloc
