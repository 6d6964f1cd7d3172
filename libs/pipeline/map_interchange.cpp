#include "pipeline/map_interchange.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <fstream>
#include <nlohmann/json.hpp>
#include <utility>
#include <vector>

#include "core/errors.h"
#include "core/output_file.h"
#include "graph/g2o_file.h"
#include "map/bytes.h"
#include "sensors/gps_conversion.h"

namespace raceloc {

namespace {

/** The header, then the points; in constant memory. */
void writePoints(const std::string& path, const std::string& header, const TiledMap& map) {
  OutputFile output(path);
  std::ofstream file(output.temporaryPath(), std::ios::binary);
  file << header;
  for (const auto& [index, tile] : map.tiles()) {
    const Eigen::Vector3d corner_m = tileCorner(tile, map.tileSize());
    Bytes bytes;
    for (std::size_t i = 0; i < tile.cloud.size(); ++i) {
      append(bytes, Eigen::Vector3f((corner_m + tile.cloud.point(i).cast<double>()).cast<float>()));
      if (!tile.cloud.intensity.empty()) append(bytes, tile.cloud.intensity[i]);
    }
    file.write(bytes.data(), static_cast<std::streamsize>(bytes.size()));
  }
  file.close();
  if (!file) throw cannotWrite(path);
  output.commit();
}

bool hasIntensity(const TiledMap& map) {
  return !map.tiles().empty() && !map.tiles().begin()->second.cloud.intensity.empty();
}

/** One line on the ground, in pieces. */
struct MapLine {
  std::string name, kind;
  std::vector<std::vector<Eigen::Vector3d>> pieces_map_m;
};

MapLine drivenLine(const MapContent& content, const std::string& session) {
  MapLine line{session, "driven", {{}}};
  for (const KeyPose& k : content.key_poses)
    if (k.session == session) line.pieces_map_m[0].push_back(k.T_map_body.translation());
  return line;
}

MapLine racingLine(const std::vector<MapWaypoint>& waypoints) {
  MapLine line{"racing line", "racing_line", {{}}};
  for (const MapWaypoint& w : waypoints) line.pieces_map_m[0].push_back(w.p_map_m);
  if (!waypoints.empty()) line.pieces_map_m[0].push_back(waypoints[0].p_map_m);
  return line;
}

/** Cut where a station has no wall; joined where it goes on over the start line. */
MapLine wallLine(const MapContent& content, WallSide side) {
  MapLine line{side == WallSide::left ? "left wall" : "right wall",
               side == WallSide::left ? "wall_left" : "wall_right",
               {}};
  const double spacing_m = content.info.waypoint_spacing_m;
  const double length_m = spacing_m * static_cast<double>(content.waypoints.size());
  const WallPoint *first = nullptr, *last = nullptr;
  for (const WallPoint& w : content.walls) {
    if (w.side != side) continue;
    if (last == nullptr || w.station_m - last->station_m > 1.5 * spacing_m) line.pieces_map_m.emplace_back();
    line.pieces_map_m.back().push_back(w.p_map_foot_m);
    if (first == nullptr) first = &w;
    last = &w;
  }
  if (first != last && first->station_m + length_m - last->station_m < 1.5 * spacing_m) {
    auto& end = line.pieces_map_m.back();
    const auto& start = line.pieces_map_m.front();
    if (line.pieces_map_m.size() == 1) {
      end.push_back(first->p_map_foot_m);
    } else {
      end.insert(end.end(), start.begin(), start.end());
      line.pieces_map_m.erase(line.pieces_map_m.begin());
    }
  }
  return line;
}

/** The lines that the map has; a piece of one point is none. */
std::vector<MapLine> linesOf(const MapContent& content) {
  std::vector<MapLine> lines;
  for (const std::string& session : content.info.sessions) lines.push_back(drivenLine(content, session));
  lines.push_back(racingLine(content.waypoints));
  lines.push_back(wallLine(content, WallSide::left));
  lines.push_back(wallLine(content, WallSide::right));
  for (MapLine& line : lines) {
    auto& pieces = line.pieces_map_m;
    pieces.erase(
        std::remove_if(pieces.begin(), pieces.end(), [](const auto& piece) { return piece.size() < 2; }),
        pieces.end());
  }
  lines.erase(std::remove_if(lines.begin(), lines.end(),
                             [](const MapLine& line) { return line.pieces_map_m.empty(); }),
              lines.end());
  return lines;
}

GeodeticPoint originFor(const std::string& path, const MapInfo& info) {
  if (!info.origin)
    throw InputError("output " + path +
                     ": the map has no origin (its survey had no GPS), so its lines have no "
                     "place on the globe");
  return *info.origin;
}

std::string escaped(const std::string& text) {
  std::string xml;
  for (const char c : text) {
    constexpr std::array<std::pair<char, const char*>, 5> kEntities{
        {{'&', "&amp;"}, {'<', "&lt;"}, {'>', "&gt;"}, {'"', "&quot;"}, {'\'', "&apos;"}}};
    const auto* found =
        std::find_if(kEntities.begin(), kEntities.end(), [c](const auto& e) { return e.first == c; });
    xml += found == kEntities.end() ? std::string(1, c) : found->second;
  }
  return xml;
}

}  // namespace

void writePly(const std::string& path, const TiledMap& map) {
  std::string header = "ply\nformat binary_little_endian 1.0\ncomment raceloc map frame\nelement vertex " +
                       std::to_string(map.pointCount()) +
                       "\nproperty float x\nproperty float y\nproperty float z\n";
  if (hasIntensity(map)) header += "property float intensity\n";
  writePoints(path, header + "end_header\n", map);
}

void writePcd(const std::string& path, const TiledMap& map) {
  const bool with_intensity = hasIntensity(map);
  const std::string count = std::to_string(map.pointCount());
  std::string header = "# .PCD v0.7 - raceloc map frame\nVERSION 0.7\n";
  header += with_intensity ? "FIELDS x y z intensity\nSIZE 4 4 4 4\nTYPE F F F F\nCOUNT 1 1 1 1\n"
                           : "FIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nCOUNT 1 1 1\n";
  header += "WIDTH " + count + "\nHEIGHT 1\nVIEWPOINT 0 0 0 1 0 0 0\nPOINTS " + count + "\nDATA binary\n";
  writePoints(path, header, map);
}

void writeOrigin(const std::string& path, const MapInfo& info) {
  nlohmann::ordered_json json;
  json["frame"] = info.origin ? "ENU" : "local";
  json["axes"] = info.origin ? "x east, y north, z up" : "x and y level, z up";
  json["unit"] = "m";
  if (info.origin) {
    json["datum"] = "WGS84";
    json["latitude_deg"] = info.origin->latitude_deg;
    json["longitude_deg"] = info.origin->longitude_deg;
    json["height_m"] = info.origin->height_m;
  }
  writeTextFile(path, json.dump(2) + "\n");
}

void writeGeoJson(const std::string& path, const MapContent& content) {
  using nlohmann::ordered_json;
  const GeodeticPoint origin = originFor(path, content.info);
  const auto rounded = [](double value, double per_unit) { return std::round(value * per_unit) / per_unit; };
  ordered_json features = ordered_json::array();
  for (const MapLine& line : linesOf(content)) {
    ordered_json pieces = ordered_json::array();
    for (const auto& piece : line.pieces_map_m) {
      ordered_json coordinates = ordered_json::array();
      for (const Eigen::Vector3d& p_m : piece) {
        const GeodeticPoint g = fromMap(p_m, origin);  // 1e-9 deg is 0.1 mm
        coordinates.push_back(
            {rounded(g.longitude_deg, 1e9), rounded(g.latitude_deg, 1e9), rounded(g.height_m, 1e4)});
      }
      pieces.push_back(std::move(coordinates));
    }
    features.push_back({{"type", "Feature"},
                        {"properties", {{"name", line.name}, {"kind", line.kind}}},
                        {"geometry", {{"type", "MultiLineString"}, {"coordinates", std::move(pieces)}}}});
  }
  ordered_json json;
  json["type"] = "FeatureCollection";
  json["features"] = std::move(features);
  // A session's name is a file's, in any encoding.
  writeTextFile(path, json.dump(-1, ' ', false, ordered_json::error_handler_t::replace) + "\n");
}

void writeKml(const std::string& path, const MapContent& content) {
  const GeodeticPoint origin = originFor(path, content.info);
  std::string xml =
      "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n<kml "
      "xmlns=\"http://www.opengis.net/kml/2.2\">\n<Document>\n";
  constexpr std::array<std::pair<const char*, const char*>, 4> kColours{{{"driven", "ffff00ff"},
                                                                         {"racing_line", "ff00ffff"},
                                                                         {"wall_left", "ff0000ff"},
                                                                         {"wall_right", "ff00ff00"}}};
  for (const auto& [kind, colour] : kColours)  // alpha, blue, green, red
    xml += std::string("<Style id=\"") + kind + "\"><LineStyle><color>" + colour +
           "</color><width>2</width></LineStyle></Style>\n";
  for (const MapLine& line : linesOf(content)) {
    xml += "<Placemark><name>" + escaped(line.name) + "</name><styleUrl>#" + line.kind +
           "</styleUrl><MultiGeometry>\n";
    for (const auto& piece : line.pieces_map_m) {
      xml += "<LineString><tessellate>1</tessellate><coordinates>\n";
      for (const Eigen::Vector3d& p_m : piece) {
        const GeodeticPoint g = fromMap(p_m, origin);
        char text[128];
        std::snprintf(text, sizeof text, "%.9f,%.9f,%.3f\n", g.longitude_deg, g.latitude_deg, g.height_m);
        xml += text;
      }
      xml += "</coordinates></LineString>\n";
    }
    xml += "</MultiGeometry></Placemark>\n";
  }
  writeTextFile(path, xml + "</Document>\n</kml>\n");
}

void writeG2o(const std::string& path, const MapContent& content) {
  std::vector<Pose> poses;
  poses.reserve(content.key_poses.size());
  for (const KeyPose& k : content.key_poses) poses.push_back(k.T_map_body);
  std::vector<G2oEdge> edges;
  edges.reserve(content.edges.size());
  for (const MapEdge& e : content.edges)
    edges.push_back({static_cast<std::size_t>(e.i), static_cast<std::size_t>(e.j), e.T_i_j, e.information});
  writeG2o(path, poses, poses.empty() ? std::nullopt : std::optional<std::size_t>(0), edges);
}

}  // namespace raceloc
