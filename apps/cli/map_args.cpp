#include "cli/map_args.h"

#include <cstdio>
#include <filesystem>
#include <functional>
#include <iostream>
#include <memory>
#include <utility>
#include <vector>

#include "cli/app.h"
#include "cli/map_page.h"
#include "cli/odometry_text.h"
#include "core/errors.h"
#include "map/map_file.h"
#include "pipeline/map_exports.h"

namespace raceloc {

namespace {

constexpr char kMapManual[] = R"(NAME
  raceloc-map - survey rawlogs in, one georeferenced map out

SYNOPSIS
  raceloc-map -c INI -o MAP.rlmap [--race-line LINE.csv] [--resume | --replace] [--keep] SURVEY.rawlog ...
  raceloc-map info MAP.rlmap
  raceloc-map export MAP.rlmap -o PREFIX FORMAT...
  raceloc-map check MAP.rlmap

DESCRIPTION
  Reads survey logs, de-skews each LiDAR sweep by the car's motion, merges those of several LiDARs and
  registers them (VGICP) against the map so far. A GPS/INS graph and a LiDAR graph share their key poses;
  racetrack IDs along the first full lap (or --race-line) propose loops, scans verify them, and one graph of
  all takes out the rest. Receivers are refused where they contradict odometry and each other, by name and
  time; what other scans see through has moved, and is left out. Several logs become one map in the
  frame of the first one's origin.
  Writes one SQLite file, and beside it MAP.html and MAP.json (how good it is, and a verdict by the limits in
  section [qa]), MAP.simplemap (robot-map-gui) and MAP.3Dscene (SceneViewer3D). Files appear under their names
  when they are whole. What a run has done so far is in MAP.rlmap.build: after a kill, --resume goes on from there.
  With --keep it stays when the map is done, and a later --resume with more logs reads those only that are new.
  Files of a map or a build that are there already are not touched without --resume or --replace. Ctrl-C stops as a kill
  does, and says how to go on.

EXAMPLES
  raceloc-map -c ini/map.ini -o monza.rlmap survey.rawlog
  raceloc-map -c ini/map.ini -o monza.rlmap --keep saturday.rawlog
  raceloc-map -c ini/map.ini -o monza.rlmap --resume saturday.rawlog sunday.rawlog
  raceloc-map --print-ini > my_map.ini       every key with its meaning, range and default
  raceloc-map -c ini/map.ini -o lap.rlmap --odometry lap_odometry.tum survey.rawlog
  raceloc-map check monza.rlmap
  raceloc-map export --help                  PLY, PCD, TUM, GeoJSON, KML, g2o and MRPT's own

EXIT STATUS
  0 the map was written, whatever the verdict; 2 an input is missing or wrong (one line says which);
  1 a fault of raceloc; 130 or 143 it was stopped.
)";

std::string besideMap(const std::string& map_path, const std::string& extension) {
  return std::filesystem::path(map_path).replace_extension(extension).string();
}

void print(const SessionReport& r, bool named) {
  if (named) std::printf("session          %s%s\n", r.session.c_str(), r.kept ? ", read before" : "");
  std::printf("device           %s\n", r.device_reason.c_str());
  printOdometry(r.odometry, r.recorded_s, r.dropped_late);
  std::printf("scan match       residual %.3f m across the surface, inlier share %.2f (medians)\n",
              r.match_residual_m, r.match_inlier_share);
}

void print(const MapReport& r, const MapInfo& info) {
  for (const SessionReport& session : r.sessions) print(session, r.sessions.size() > 1);
  std::printf("pose graph       %zu key poses, %zu fixes, %zu INS attitudes; cost %.4g%s\n", r.key_poses,
              r.gps_fixes, r.attitudes, r.cost, r.converged ? "" : ", NOT converged");
  if (info.origin) {
    std::printf("georeference     origin %.7f %.7f deg, %.2f m; GPS against the map %.3f m rmse\n",
                info.origin->latitude_deg, info.origin->longitude_deg, info.origin->height_m, r.gps_rmse_m);
    std::printf(
        "alignment        LiDAR graph on GPS graph %.3f m rmse (%.0f %% of the key poses); refined %.3f m\n",
        r.aligned_rmse_m, 100 * r.aligned_share, r.refined_rmse_m);
  } else {
    std::printf("georeference     NONE: the log has no GPS; raceloc-live will refuse this map\n");
  }
  for (const GpsSpan& span : r.gps_spans)
    std::printf("%-16s %s\n", span.refused ? "GPS REFUSED" : "GPS poor", text(span, r.first_s).c_str());
  if (r.lap_m > 0)
    std::printf(
        "racetrack        %.0f m a lap, %d laps begun; %zu loops closed, %.3f m off (median), %zu refused\n",
        r.lap_m, r.laps, r.loops.size(), r.loop_residual_m, r.refused_loops.size());
  else
    std::printf("racetrack        no full lap: no racetrack IDs, no loops\n");
  std::printf(
      "map              %zu points in %zu tiles; %.2f %% of the scans' points moved and are left out\n",
      r.points, r.tiles, 100 * r.moving_share);
  if (r.walls.cells > 0)
    std::printf("wall thickness   %.3f m median, %.3f m p90, over %zu pieces of wall\n", r.walls.median_m,
                r.walls.p90_m, r.walls.cells);
  else
    std::printf("wall thickness   not measured: no piece of wall with enough points\n");
}

/** One line of progress a stage. */
class Stages {
 public:
  void operator()(const std::string& stage, double share) {
    if (!x_line || stage != x_stage) {
      x_line.reset();
      x_line = std::make_unique<Progress>(stage);
      x_stage = stage;
    }
    (*x_line)(share);
  }

 private:
  std::string x_stage;
  std::unique_ptr<Progress> x_line;
};

}  // namespace

std::optional<MapArgs> parseMapArgs(int argc, char** argv) {
  if (argc > 1) {
    std::vector<std::string> words(argv + 1, argv + argc);
    const std::string command = std::exchange(words[0], argv[0]);
    if (command == "info") return parseMapInfo(std::move(words));
    if (command == "export") return parseMapExport(std::move(words));
    if (command == "check") return parseMapCheck(std::move(words));
  }
  CommandLine cmd(kMapManual);
  TCLAP::ValueArg<std::string> ini("c", "config", "options; see --print-ini", false, "", "INI", cmd);
  TCLAP::ValueArg<std::string> out("o", "output", "the map to write", false, "", "MAP.rlmap", cmd);
  TCLAP::ValueArg<std::string> odometry(
      "", "odometry",
      "also write the LiDAR odometry of the first log before the graphs, in its own frame (TUM)", false, "",
      "FILE.tum", cmd);
  TCLAP::ValueArg<std::string> trajectory("", "trajectory", "also write the key poses in the map frame (TUM)",
                                          false, "", "FILE.tum", cmd);
  TCLAP::SwitchArg print_ini("", "print-ini", "print every key with its default and end", cmd);
  TCLAP::SwitchArg verbose("v", "verbose", "also print the options in force and the time taken", cmd);
  TCLAP::ValueArg<std::string> race_line(
      "", "race-line", "way-points along this line (columns x_m, y_m) instead of the first full lap", false,
      "", "LINE.csv", cmd);
  TCLAP::SwitchArg resume("", "resume", "go on with the build of this map that was killed or kept", cmd);
  TCLAP::SwitchArg replace("", "replace", "build a map anew that is there already", cmd);
  TCLAP::SwitchArg keep("", "keep", "leave MAP.rlmap.build when the map is done, to add logs later", cmd);
  TCLAP::UnlabeledMultiArg<std::string> logs("rawlog", "the survey logs", false, "SURVEY.rawlog ...", cmd);
  if (!cmd.parse(argc, argv)) return std::nullopt;

  for (const std::string& log : logs.getValue())
    if (log.substr(0, 1) == "-")  // TCLAP takes an option that it does not know for a log
      throw InputError("unknown option " + log + " (see --help)");
  if (!print_ini.getValue()) {
    if (logs.getValue().empty()) throw InputError("no survey log given (see --help)");
    if (!ini.isSet()) throw InputError("no options given: -c ini/map.ini (see --help)");
    if (!out.isSet()) throw InputError("no output given: -o MAP.rlmap (see --help)");
  }
  return BuildArgs{ini.getValue(),      logs.getValue(),       out.getValue(),      race_line.getValue(),
                   odometry.getValue(), trajectory.getValue(), resume.getValue(),   replace.getValue(),
                   keep.getValue(),     verbose.getValue(),    print_ini.getValue()};
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
  if (args.resume && args.replace)
    throw InputError("--resume goes on with a map, --replace does not: which?");
  const std::string store_path = args.map_path + ".build";
  std::error_code unknown;  // OutputFile knows better what is wrong
  const bool had_store = std::filesystem::exists(store_path, unknown);
  if (had_store && !args.replace && !args.resume)
    throw InputError("output " + args.map_path + ": " + store_path +
                     " is there; --resume goes on with it, --replace drops it");
  const std::string simplemap_path =
      options.map.write_simplemap ? besideMap(args.map_path, ".simplemap") : "";
  const std::string scene_path = options.map.write_scene ? besideMap(args.map_path, ".3Dscene") : "";
  std::vector<std::string> outputs{args.map_path, besideMap(args.map_path, ".html"),
                                   besideMap(args.map_path, ".json")};
  for (const auto& path : {simplemap_path, scene_path})
    if (!path.empty()) outputs.push_back(path);
  for (const auto& path : outputs)
    if (std::filesystem::exists(path, unknown) && !args.replace && !(args.resume && had_store))
      throw InputError("output " + path + ": is there already" +
                       (args.resume ? ", and " + store_path + ", with which to go on, is not" : "") +
                       "; --replace builds the map anew");
  outputs.push_back(store_path);
  for (const auto& path : {args.odometry_path, args.trajectory_path})
    if (!path.empty()) outputs.push_back(path);
  std::vector<std::string> inputs = args.log_paths;
  inputs.insert(inputs.end(), {args.ini_path, args.race_line_path});
  requireApart(inputs, outputs);

  const auto start = std::chrono::steady_clock::now();
  Stages stages;
  const MapInput input = mapInput(args.log_paths, args.race_line_path, options, std::ref(stages));
  stopWhenAsked();
  // The store is locked first: another run on the same map would take the files away that this one writes.
  StageStore store(store_path, args.resume ? StageStore::Open::resume : StageStore::Open::anew);
  std::optional<BuiltMap> built;
  try {
    for (const std::string& path : outputs)  // one that cannot be written is told before the work, not after
      if (path != store_path) OutputFile{path};
    built.emplace(buildMap(input, store, options, toolVersion(), [&](const std::string& stage, double share) {
      requireNotStopped();
      stages(stage, share);
    }));
  } catch (const Stopped& stopped) {
    throw Stopped(stopped.signal(), "stopped; what is done is kept in " + store_path +
                                        ", the same command with --resume goes on");
  } catch (const InputError&) {
    if (!holdsSurveys(store)) store.remove();  // there is nothing to go on with
    throw;
  }
  const auto& key_poses = built->content.key_poses;
  saveMap(args.map_path, built->tiles, built->content);
  if (!simplemap_path.empty()) writeSimplemap(simplemap_path, scansOf(built->tiles, key_poses));
  if (!scene_path.empty()) writeScene(scene_path, built->tiles, key_poses);
  if (!args.odometry_path.empty()) writeTum(args.odometry_path, built->odometry.front());
  if (!args.trajectory_path.empty())
    writePoses(args.trajectory_path, built->content, [](const KeyPose& k) { return k.T_map_body; });

  const QaResult qa = qaOf(built->content, built->report, options.qa);
  writeTextFile(besideMap(args.map_path, ".json"), qaJson(*built, qa));
  writeTextFile(besideMap(args.map_path, ".html"),
                qaPage(std::filesystem::path(args.map_path).stem().string(), *built, qa, options.qa));
  if (!args.keep) store.remove();

  print(built->report, built->content.info);
  std::printf("verdict          %s\n", verdict(qa).c_str());
  const double wall_s = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  double recorded_s = 0;
  for (const SessionReport& session : built->report.sessions) recorded_s += session.recorded_s;
  std::printf("run              %.1f s wall for %.1f s recorded, peak memory %.0f MiB\n", wall_s, recorded_s,
              peakMemory_MiB());
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
