/** \file
 * The structs of a map's content as tables: their columns, how a row is written, read and summed. */
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <type_traits>
#include <utility>
#include <variant>
#include <vector>

#include "map/map_content.h"
#include "map/sqlite_file.h"

namespace raceloc {

/** \name A table's name, and its columns told once: for the schema, for writing, for reading and for the checksum. @{
 * */
struct InfoRow {
  std::optional<double> origin_latitude_deg, origin_longitude_deg, origin_height_m;
  double tile_size_m, point_spacing_m, waypoint_spacing_m;
  std::string config;
};
template <class Row>
struct SqlTable;
template <>
struct SqlTable<InfoRow> {
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
struct SqlTable<std::string> {
  static constexpr char kName[] = "sessions";
  template <class Row, class Visit>
  static void columns(Row& row, const Visit& visit) {
    visit("name", row);
  }
};
template <>
struct SqlTable<KeyPose> {
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
struct SqlTable<MapWaypoint> {
  static constexpr char kName[] = "waypoints";
  template <class Row, class Visit>
  static void columns(Row& row, const Visit& visit) {
    visit("p_map_m", row.p_map_m);
    visit("heading_rad", row.heading_rad);
  }
};
template <>
struct SqlTable<MapEdge> {
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
struct SqlTable<MapFix> {
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
struct SqlTable<RoadStation> {
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
struct SqlTable<WallPoint> {
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

/** \name A member as a cell, and back. fromSql() returns false for a cell that cannot be one. @{ */
template <class T>
SqlValue toSql(const T& value) {
  if constexpr (std::is_floating_point_v<T>)
    return double{value};
  else if constexpr (std::is_same_v<T, std::string>)
    return value;
  else
    return static_cast<std::int64_t>(value);  // numbers and enumerations
}
template <int Rows, int Columns>
SqlValue toSql(const Eigen::Matrix<double, Rows, Columns>& matrix) {
  Bytes bytes;
  append(bytes, matrix);
  return bytes;
}
inline SqlValue toSql(const Pose& T) {
  Bytes bytes;
  append(bytes, T.matrix().topRows<3>());
  return bytes;
}
template <class T>
SqlValue toSql(const std::optional<T>& value) {
  return value ? toSql(*value) : SqlValue();
}

template <class T>
bool fromSql(const SqlValue& cell, T& value) {
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
bool fromSql(const SqlValue& cell, Eigen::Matrix<double, Rows, Columns>& matrix) {
  const auto* bytes = std::get_if<Bytes>(&cell);
  if (bytes == nullptr || bytes->size() != sizeof(double) * Rows * Columns) return false;
  matrix = ByteReader(*bytes).matrix<Eigen::Matrix<double, Rows, Columns>>();
  return true;
}
inline bool fromSql(const SqlValue& cell, Pose& T) {
  Eigen::Matrix<double, 3, 4> rows;
  if (!fromSql(cell, rows)) return false;
  T.setIdentity();
  T.matrix().topRows<3>() = rows;
  return true;
}
template <class T>
bool fromSql(const SqlValue& cell, std::optional<T>& value) {
  if (std::holds_alternative<std::monostate>(cell)) return true;
  return fromSql(cell, value.emplace());
}
/** @} */

/** One table's rows as what its checksum is over: of every cell what it is and what is in it. */
class RowChecksum {
 public:
  void add(const std::vector<SqlValue>& row) {
    for (const SqlValue& cell : row) {
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
std::vector<SqlValue> cellsOf(const Row& row) {
  std::vector<SqlValue> cells;
  SqlTable<Row>::columns(row,
                         [&](const char* /*name*/, const auto& value) { cells.push_back(toSql(value)); });
  return cells;
}

/** Makes the table and fills it. \return its checksum */
template <class Row>
std::string writeTable(SqliteFile& file, const std::vector<Row>& rows) {
  const std::string name = SqlTable<Row>::kName;
  std::string columns = "number INTEGER PRIMARY KEY", places = "?";
  const Row any{};
  SqlTable<Row>::columns(any, [&](const char* column, const auto& /*value*/) {
    columns += std::string(", ") + column;
    places += ", ?";
  });
  file.run("CREATE TABLE " + name + "(" + columns + ")");
  SqlStatement insert(file, "INSERT INTO " + name + " VALUES(" + places + ")", name);
  RowChecksum checksum;
  std::int64_t number = 0;
  for (const Row& row : rows) {
    std::vector<SqlValue> cells = cellsOf(row);
    checksum.add(cells);
    cells.insert(cells.begin(), SqlValue(number++));
    insert.writeCells(cells);
  }
  return checksum.md5();
}

inline std::string metaText(SqliteFile& file, const std::string& key) {
  SqlStatement statement(file, "SELECT value FROM meta WHERE key = ?", "meta");
  const std::vector<SqlValue> wanted{key};
  statement.bind(wanted);
  if (!statement.step()) throw file.damaged("meta has no " + key);
  return statement.get<std::string>(0);
}

inline void requireChecksum(SqliteFile& file, const std::string& table, const std::string& found) {
  if (found != metaText(file, "checksum " + table)) throw file.damaged(table + " does not fit its checksum");
}

/** Reads a table whole. \param checksums  gets its checksum \throws InputError naming it if it is damaged */
template <class Row>
std::vector<Row> readTable(SqliteFile& file, std::string& checksums) {
  const std::string name = SqlTable<Row>::kName;
  std::string columns;
  const Row any{};
  SqlTable<Row>::columns(any, [&](const char* column, const auto& /*value*/) {
    columns += (columns.empty() ? "" : ", ") + std::string(column);
  });
  SqlStatement select(file, "SELECT " + columns + " FROM " + name + " ORDER BY number", name);
  RowChecksum checksum;
  std::vector<Row> rows;
  while (select.step()) {
    Row row{};
    int column = 0;
    bool fits = true;
    std::vector<SqlValue> cells;
    SqlTable<Row>::columns(row, [&](const char* /*name*/, auto& value) {
      cells.push_back(select.cell(column++));
      fits = fromSql(cells.back(), value) && fits;
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

inline InfoRow rowOf(const MapInfo& info) {
  InfoRow row{{}, {}, {}, info.tile_size_m, info.point_spacing_m, info.waypoint_spacing_m, info.config};
  if (info.origin) {
    row.origin_latitude_deg = info.origin->latitude_deg;
    row.origin_longitude_deg = info.origin->longitude_deg;
    row.origin_height_m = info.origin->height_m;
  }
  return row;
}

inline MapInfo infoOf(const InfoRow& row, std::vector<std::string> sessions, std::string tool_version) {
  std::optional<GeodeticPoint> origin;
  if (row.origin_latitude_deg && row.origin_longitude_deg && row.origin_height_m)
    origin = GeodeticPoint{*row.origin_latitude_deg, *row.origin_longitude_deg, *row.origin_height_m};
  return {origin,     row.tile_size_m,     row.point_spacing_m,   std::move(tool_version),
          row.config, std::move(sessions), row.waypoint_spacing_m};
}

}  // namespace raceloc
