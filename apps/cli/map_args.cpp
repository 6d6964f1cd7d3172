#include "cli/map_args.h"

#include <cstdio>
#include <filesystem>
#include <iostream>
#include <memory>
#include <utility>
#include <vector>

#include "cli/app.h"
#include "cli/odometry_text.h"
#include "core/errors.h"

namespace raceloc {

namespace {

constexpr char kHelp[] = R"(NAME
  raceloc-map - survey rawlog in, georeferenced map out

SYNOPSIS
  raceloc-map -c INI -o MAP.rlmap SURVEY.rawlog
  raceloc-map info MAP.rlmap
  raceloc-map export MAP.rlmap -o PREFIX FORMAT...
  raceloc-map check MAP.rlmap

DESCRIPTION
  Reads a survey log, de-skews each LiDAR sweep by the car's motion, merges those of several LiDARs,
  registers them (VGICP) against the map so far, ties the key poses to the GPS in a pose graph, and
  writes the map: one SQLite file, and beside it MAP.simplemap (robot-map-gui) and MAP.3Dscene
  (SceneViewer3D). Files appear under their names when they are whole; an interrupted run leaves what
  was there before.

EXAMPLES
  raceloc-map -c ini/map.ini -o monza.rlmap survey.rawlog
  raceloc-map --print-ini > my_map.ini       every key with its meaning, range and default
  raceloc-map -c ini/map.ini -o lap.rlmap --odometry lap_odometry.tum survey.rawlog
  raceloc-map check monza.rlmap
  raceloc-map export --help                  PLY, PCD, TUM, GeoJSON, KML, g2o and MRPT's own

EXIT STATUS
  0 the map was written; 2 an input is missing or wrong (one line says which); 1 a fault of raceloc.
)";

std::string besides(const std::string& map_path, const std::string& extension) {
  return std::filesystem::path(map_path).replace_extension(extension).string();
}

void print(const MapReport& r, const MapInfo& info) {
  std::printf("device           %s\n", r.device_reason.c_str());
  printOdometry(r.odometry, r.recorded_s, r.dropped_late);
  std::printf("scan match       residual %.3f m across the surface, inlier share %.2f (medians)\n",
              r.match_residual_m, r.match_inlier_share);
  std::printf("pose graph       %zu key poses, %zu with GPS, %zu with INS attitude; cost %.4g -> %.4g%s\n",
              r.key_poses, r.gps_factors, r.attitude_factors, r.graph_initial_cost, r.graph_final_cost,
              r.graph_converged ? "" : ", NOT converged");
  if (info.origin)
    std::printf("georeference     origin %.7f %.7f deg, %.2f m; GPS against the map %.3f m rmse\n",
                info.origin->latitude_deg, info.origin->longitude_deg, info.origin->height_m, r.gps_rmse_m);
  else
    std::printf("georeference     NONE: the log has no GPS; raceloc-live will refuse this map\n");
  std::printf("map              %zu points in %zu tiles\n", r.points, r.tiles);
  if (r.walls.cells > 0)
    std::printf("wall thickness   %.3f m median, %.3f m p90, over %zu pieces of wall\n", r.walls.median_m,
                r.walls.p90_m, r.walls.cells);
  else
    std::printf("wall thickness   not measured: no piece of wall with enough points\n");
}

}  // namespace

std::optional<MapArgs> parseMapArgs(int argc, char** argv) {
  if (argc > 1) {
    std::vector<std::string> words(argv + 1, argv + argc);
    const std::string command = std::exchange(words[0], argv[0]);
    if (command == "info") return parseMapInfo(std::move(words));
    if (command == "export") return parseMapExport(std::move(words));
    if (command == "check") return parseMapCheck(std::move(words));
  }
  CommandLine cmd(kHelp);
  TCLAP::ValueArg<std::string> ini("c", "config", "options; see --print-ini", false, "", "INI", cmd);
  TCLAP::ValueArg<std::string> out("o", "output", "the map to write", false, "", "MAP.rlmap", cmd);
  TCLAP::ValueArg<std::string> odometry(
      "", "odometry", "also write the LiDAR odometry before the graph, in its own frame (TUM)", false, "",
      "FILE.tum", cmd);
  TCLAP::ValueArg<std::string> trajectory("", "trajectory", "also write the key poses in the map frame (TUM)",
                                          false, "", "FILE.tum", cmd);
  TCLAP::SwitchArg print_ini("", "print-ini", "print every key with its default and end", cmd);
  TCLAP::SwitchArg verbose("v", "verbose", "also print the options in force and the time taken", cmd);
  TCLAP::UnlabeledValueArg<std::string> log("rawlog", "the survey log", false, "", "SURVEY.rawlog", cmd);
  if (!cmd.parse(argc, argv)) return std::nullopt;

  if (log.getValue().substr(0, 1) == "-")  // TCLAP takes an option that it does not know for the log
    throw InputError("unknown option " + log.getValue() + " (see --help)");
  if (!print_ini.getValue()) {
    if (log.getValue().empty()) throw InputError("no survey log given (see --help)");
    if (!ini.isSet()) throw InputError("no options given: -c ini/map.ini (see --help)");
    if (!out.isSet()) throw InputError("no output given: -o MAP.rlmap (see --help)");
  }
  return BuildArgs{ini.getValue(),        log.getValue(),     out.getValue(),      odometry.getValue(),
                   trajectory.getValue(), verbose.getValue(), print_ini.getValue()};
}

namespace {

void build(const BuildArgs& args) {
  if (args.print_ini) {
    std::cout << MapperOptions{}.iniText();
    return;
  }
  const MapperOptions options = MapperOptions::fromIni(args.ini_path);
  if (args.verbose) std::cout << options.iniText() << "\n";
  if (std::filesystem::path(args.map_path).extension() != ".rlmap")
    throw InputError("output " + args.map_path + ": a map's name ends in .rlmap");
  // An output that cannot be written is told before the work, not after.
  std::vector<std::unique_ptr<OutputFile>> probes;
  for (const auto& path : {args.map_path, args.odometry_path, args.trajectory_path})
    if (!path.empty()) probes.push_back(std::make_unique<OutputFile>(path));

  const auto start = std::chrono::steady_clock::now();
  std::optional<BuiltMap> built;
  {
    Progress progress("mapping");
    built.emplace(buildMap(args.rawlog_path, options, toolVersion(), [&](double share) { progress(share); }));
  }
  saveMap(args.map_path, built->tiles, {built->info, built->key_poses});
  if (options.map.write_simplemap) writeSimplemap(besides(args.map_path, ".simplemap"), built->scans);
  if (options.map.write_scene) writeScene(besides(args.map_path, ".3Dscene"), built->tiles, built->key_poses);
  if (!args.odometry_path.empty()) writeTum(args.odometry_path, built->odometry);
  if (!args.trajectory_path.empty()) {
    Trajectory trajectory{built->info.origin, {}};
    for (const auto& k : built->key_poses) trajectory.poses.push_back({k.stamp_s, k.T_map_body});
    writeTum(args.trajectory_path, trajectory);
  }

  print(built->report, built->info);
  const double wall_s = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  std::printf("run              %.1f s wall for %.1f s recorded, peak memory %.0f MiB\n", wall_s,
              built->report.recorded_s, peakMemory_MiB());
  std::printf("written          %s\n", args.map_path.c_str());
}

}  // namespace

void runMap(const MapArgs& args) {
  if (const auto* survey = std::get_if<BuildArgs>(&args)) build(*survey);
  if (const auto* map = std::get_if<MapInfoArgs>(&args)) mapInfo(*map);
  if (const auto* map = std::get_if<MapExportArgs>(&args)) mapExport(*map);
  if (const auto* map = std::get_if<MapCheckArgs>(&args)) mapCheck(*map);
}

}  // namespace raceloc
