#include "cli/map_tools.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <functional>
#include <map>
#include <memory>
#include <utility>

#include "cli/app.h"
#include "cli/text_options.h"
#include "core/trajectory.h"
#include "map/map_file.h"
#include "pipeline/map_exports.h"
#include "pipeline/map_interchange.h"

namespace raceloc {

namespace {

constexpr char kInfoManual[] = R"(NAME
  raceloc-map info - what is in a map

SYNOPSIS
  raceloc-map info MAP.rlmap

DESCRIPTION
  Prints where the map lies, what it was made from and how much of everything it has. The points are not read.

EXAMPLES
  raceloc-map info lvms.rlmap

EXIT STATUS
  0 done; 2 the map is missing or damaged (one line says how); 1 a fault of raceloc.
)";

constexpr char kExportManual[] = R"(NAME
  raceloc-map export - a map in other formats

SYNOPSIS
  raceloc-map export MAP.rlmap -o PREFIX [--replace] FORMAT...

DESCRIPTION
  Writes PREFIX and the format's extension; a file that is there already stays without --replace. Coordinates are metres
  in the map's frame (east, north, up), except in GeoJSON and KML (WGS84); PREFIX.origin.json, always written, says
  where that frame lies.

EXAMPLES
  raceloc-map export lvms.rlmap -o lvms --ply --geojson --kml
  raceloc-map export lvms.rlmap -o out/lvms --tum --g2o    lvms.tum, lvms_gps_graph.tum, lvms_lidar_graph.tum, lvms.g2o

EXIT STATUS
  0 done; 2 an input or output is missing or wrong (one line says which); 1 a fault of raceloc.
)";

constexpr char kCheckManual[] = R"(NAME
  raceloc-map check - whether a map is whole

SYNOPSIS
  raceloc-map check MAP.rlmap

DESCRIPTION
  Reads all of the map: every checksum, the content hash, racetrack IDs against their way-points, key poses, edges and
  fixes, stations of road and walls.

EXAMPLES
  raceloc-map check lvms.rlmap && cp lvms.rlmap /media/car/

EXIT STATUS
  0 the map is good; 2 it is not (one line says what is wrong); 1 a fault of raceloc.
)";

/** An option of `export`. */
struct Format {
  const char *name, *meaning;
};
constexpr Format kFormats[] = {
    {"ply", "points, for CloudCompare and others"},
    {"pcd", "points, for PCL and Autoware"},
    {"tum", "key poses: of the map, and of each graph alone as PREFIX_gps_graph and PREFIX_lidar_graph"},
    {"geojson", "driven lines, racing line and walls, for QGIS and others"},
    {"kml", "the same for Google Earth"},
    {"g2o", "the pose graph"},
    {"simplemap", "points at their nearest key poses, for robot-map-gui"},
    {"3dscene", "a scene for SceneViewer3D"}};

/** A map's name as the only argument without an option. */
class MapName {
 public:
  explicit MapName(CommandLine& cmd) : x_name("map", "the map", false, "", "MAP.rlmap", cmd) {}
  /** \throws InputError */
  [[nodiscard]] std::string path() {
    const std::string& path = x_name.getValue();
    if (path.substr(0, 1) == "-")  // TCLAP takes an option that it does not know for the map
      throw InputError("unknown option " + path + " (see --help)");
    if (path.empty()) throw InputError("no map given (see --help)");
    return path;
  }

 private:
  TCLAP::UnlabeledValueArg<std::string> x_name;
};

template <class Args>
std::optional<Args> parseMapAlone(const char* manual, std::vector<std::string> words) {
  CommandLine cmd(manual);
  MapName map(cmd);
  if (!cmd.parse(std::move(words))) return std::nullopt;
  return Args{map.path()};
}

/** \throws InputError for the first output that is there already and is not to be replaced */
void requireNew(const MapExportArgs& args) {
  std::vector<std::string> extensions{".origin.json"};
  for (const std::string& format : args.formats)
    if (format == "tum")
      extensions.insert(extensions.end(), {".tum", "_gps_graph.tum", "_lidar_graph.tum"});
    else
      extensions.push_back(format == "3dscene" ? ".3Dscene" : "." + format);
  std::error_code unknown;  // who writes it knows better what is wrong
  for (const std::string& extension : extensions)
    if (!args.replace && std::filesystem::exists(args.prefix + extension, unknown))
      throw InputError("output " + args.prefix + extension + ": is there already; --replace writes it anew");
}

double driven_m(const std::vector<KeyPose>& key_poses, const std::string& session) {
  double length_m = 0;
  const KeyPose* last = nullptr;
  for (const KeyPose& k : key_poses) {
    if (k.session != session) continue;
    if (last != nullptr) length_m += (k.T_map_body.translation() - last->T_map_body.translation()).norm();
    last = &k;
  }
  return length_m;
}

/** Least and greatest of a value over some things. */
template <class Things, class Value>
std::pair<double, double> rangeOf(const Things& things, const Value& value) {
  const auto [low, high] = std::minmax_element(
      things.begin(), things.end(), [&](const auto& a, const auto& b) { return value(a) < value(b); });
  return {value(*low), value(*high)};
}

void printGraph(const MapContent& content) {
  const auto loops = std::count_if(content.edges.begin(), content.edges.end(),
                                   [](const MapEdge& e) { return e.kind == EdgeKind::loop; });
  std::printf("graph            %zu key poses, %zu odometry edges, %td loops\n", content.key_poses.size(),
              content.edges.size() - static_cast<std::size_t>(loops), loops);
  std::map<std::string, std::vector<double>> weights;
  for (const MapFix& f : content.fixes) weights[f.receiver].push_back(f.weight);
  for (const auto& [receiver, of] : weights)
    std::printf("fixes            %s: %zu, of which %td are believed by less than half\n", receiver.c_str(),
                of.size(), std::count_if(of.begin(), of.end(), [](double w) { return w < 0.5; }));
}

void printLines(const MapContent& content) {
  const double spacing_m = content.info.waypoint_spacing_m;
  if (content.waypoints.empty()) {
    std::printf("racing line      none\n");
    return;
  }
  const auto with_id = std::count_if(content.key_poses.begin(), content.key_poses.end(),
                                     [](const KeyPose& k) { return k.racetrack_id.has_value(); });
  std::printf("racing line      %zu way-points every %.2f m, %.0f m in all; %td key poses have an ID\n",
              content.waypoints.size(), spacing_m, spacing_m * static_cast<double>(content.waypoints.size()),
              with_id);
  if (!content.road.empty()) {
    const auto height_m = rangeOf(content.road, [](const RoadStation& r) { return r.height_m; });
    const auto grade_rad = rangeOf(content.road, [](const RoadStation& r) { return r.grade_rad; });
    const auto bank_rad = rangeOf(content.road, [](const RoadStation& r) { return r.bank_rad; });
    std::printf(
        "road             %zu stations: height %.2f .. %.2f m, grade %.1f .. %.1f %%, bank %.1f .. %.1f "
        "deg\n",
        content.road.size(), height_m.first, height_m.second, 100 * std::tan(grade_rad.first),
        100 * std::tan(grade_rad.second), bank_rad.first / kDegree, bank_rad.second / kDegree);
  }
  const auto left = std::count_if(content.walls.begin(), content.walls.end(),
                                  [](const WallPoint& w) { return w.side == WallSide::left; });
  std::printf("walls            %td stations on the left, %td on the right\n", left,
              static_cast<std::ptrdiff_t>(content.walls.size()) - left);
}

}  // namespace

void writePoses(const std::string& path, const MapContent& content,
                const std::function<std::optional<Pose>(const KeyPose&)>& poseOf) {
  Trajectory trajectory{content.info.origin, {}};
  for (const KeyPose& k : content.key_poses)
    if (const auto T = poseOf(k)) trajectory.poses.push_back({k.stamp_s, *T});
  if (trajectory.poses.empty()) {
    std::printf("left out         %s: the map has no such poses\n", path.c_str());
    return;
  }
  std::stable_sort(trajectory.poses.begin(), trajectory.poses.end(),
                   [](const StampedPose& a, const StampedPose& b) { return a.stamp_s < b.stamp_s; });
  writeTum(path, trajectory);
  std::printf("written          %s\n", path.c_str());
}

std::optional<MapInfoArgs> parseMapInfo(std::vector<std::string> words) {
  return parseMapAlone<MapInfoArgs>(kInfoManual, std::move(words));
}

std::optional<MapCheckArgs> parseMapCheck(std::vector<std::string> words) {
  return parseMapAlone<MapCheckArgs>(kCheckManual, std::move(words));
}

std::optional<MapExportArgs> parseMapExport(std::vector<std::string> words) {
  CommandLine cmd(kExportManual);
  TCLAP::SwitchArg replace("", "replace", "write files anew that are there already", cmd);
  std::vector<std::unique_ptr<TCLAP::SwitchArg>> formats;
  for (auto format = std::rbegin(kFormats); format != std::rend(kFormats);
       ++format)  // TCLAP lists them backwards
    formats.push_back(std::make_unique<TCLAP::SwitchArg>("", format->name, format->meaning, cmd));
  Text out("o", "output", "the files to write, without their extensions", false, "", "PREFIX", cmd);
  MapName map(cmd);
  if (!cmd.parse(std::move(words))) return std::nullopt;
  MapExportArgs args{map.path(), out.getValue(), {}, replace.getValue()};
  for (const auto& format : formats)
    if (format->getValue()) args.formats.insert(format->getName());
  if (args.prefix.empty()) throw InputError("no output given: -o PREFIX (see --help)");
  if (args.formats.empty()) {
    std::string all;
    for (const Format& format : kFormats) all += std::string(" --") + format.name;
    throw InputError("no format given: one or more of" + all);
  }
  return args;
}

void mapInfo(const MapInfoArgs& args) {
  const MapFile file(args.map_path);
  const MapContent& content = file.content();
  const MapInfo& info = content.info;
  std::printf("content hash     %s\n", file.contentHash().c_str());
  std::printf("made by          raceloc %s\n", info.tool_version.c_str());
  if (info.origin)
    std::printf("georeference     origin %.9f %.9f deg, %.3f m (WGS84, above the ellipsoid)\n",
                info.origin->latitude_deg, info.origin->longitude_deg, info.origin->height_m);
  else
    std::printf("georeference     NONE: the survey had no GPS\n");
  for (const std::string& session : info.sessions)
    std::printf("session          %s: %td key poses, %.0f m\n", session.c_str(),
                std::count_if(content.key_poses.begin(), content.key_poses.end(),
                              [&](const KeyPose& k) { return k.session == session; }),
                driven_m(content.key_poses, session));
  printGraph(content);
  printLines(content);
  std::printf("points           %lld in %zu tiles of %g m, one every %g m\n",
              static_cast<long long>(file.pointCount()), file.tileIndices().size(), info.tile_size_m,
              info.point_spacing_m);
}

void mapExport(const MapExportArgs& args) {
  requireNew(args);
  const MapFile file(args.map_path);
  const MapContent& content = file.content();
  const auto wants = [&](const std::string& format) { return args.formats.count(format) > 0; };
  const auto write = [&](const std::string& extension, const auto& writer) {
    const std::string path = args.prefix + extension;
    writer(path);
    std::printf("written          %s\n", path.c_str());
  };
  if (wants("geojson")) write(".geojson", [&](const std::string& path) { writeGeoJson(path, content); });
  if (wants("kml")) write(".kml", [&](const std::string& path) { writeKml(path, content); });
  write(".origin.json", [&](const std::string& path) { writeOrigin(path, content.info); });
  if (wants("g2o")) write(".g2o", [&](const std::string& path) { writeG2o(path, content); });
  if (wants("tum")) {
    writePoses(args.prefix + ".tum", content, [](const KeyPose& k) { return k.T_map_body; });
    writePoses(args.prefix + "_gps_graph.tum", content, [](const KeyPose& k) { return k.T_map_body_gps; });
    writePoses(args.prefix + "_lidar_graph.tum", content,
               [](const KeyPose& k) { return k.T_map_body_lidar; });
  }
  if (!wants("ply") && !wants("pcd") && !wants("simplemap") && !wants("3dscene")) return;
  const TiledMap tiles = file.tiles();
  if (wants("ply")) write(".ply", [&](const std::string& path) { writePly(path, tiles); });
  if (wants("pcd")) write(".pcd", [&](const std::string& path) { writePcd(path, tiles); });
  if (wants("simplemap"))
    write(".simplemap",
          [&](const std::string& path) { writeSimplemap(path, scansOf(tiles, content.key_poses)); });
  if (wants("3dscene"))
    write(".3Dscene", [&](const std::string& path) { writeScene(path, tiles, content.key_poses); });
}

void mapCheck(const MapCheckArgs& args) {
  const MapFile file(args.map_path);
  file.verify();
  const MapContent& content = file.content();
  std::printf(
      "good             %s: %zu tiles, %zu key poses, %zu way-points, %zu edges, %zu fixes, %zu stations of "
      "road and %zu of walls; %s\n",
      args.map_path.c_str(), file.tileIndices().size(), content.key_poses.size(), content.waypoints.size(),
      content.edges.size(), content.fixes.size(), content.road.size(), content.walls.size(),
      file.contentHash().c_str());
}

}  // namespace raceloc
