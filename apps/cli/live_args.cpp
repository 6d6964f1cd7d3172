#include "cli/live_args.h"

#include <chrono>
#include <cstdio>
#include <iostream>
#include <utility>

#include "cli/app.h"
#include "cli/live_outputs.h"
#include "cli/live_run.h"
#include "cli/live_text.h"
#include "core/errors.h"
#include "pipeline/line_stream.h"
#include "track/driven_line.h"

namespace raceloc {

namespace {

constexpr char kLiveManual[] = R"(NAME
  raceloc-live - localization of a car on its map

SYNOPSIS
  raceloc-live -c INI -m MAP.rlmap -i RACE.rawlog [-o ANNOTATED.rawlog] [--trajectory RACE.tum]
               [--integrity FILE.csv] [--decisions FILE.csv] [--latency FILE.csv] [--scene SWEEP.3Dscene]
               [--race-line LINE.csv]
  raceloc-live -c INI -m MAP.rlmap -i RACE.rawlog --speed 1 [--record BLACKBOX.rawlog] ...
  raceloc-live -c INI -m MAP.rlmap --sensors SENSORS.ini [--record BLACKBOX.rawlog] ...
  raceloc-live -c INI --odometry-only -i RACE.rawlog --trajectory ODOMETRY.tum

DESCRIPTION
  Plays a log through the localizer, as fast as it goes: each LiDAR sweep is de-skewed, those of several
  LiDARs are merged and matched against the map's tiles around the car, and a Bayesian gate decides which of
  scan match and GPS/INS the filter believes. Writes the estimate as a TUM file and as an annotated rawlog for
  RawLogViewer: the estimate as CObservationRobotPose with covariance and as the only odometry, the gate's
  numbers as CObservationRawDAQ labelled gate, and at each sweep a CObservation3DScene with car, scan, sources
  and verdicts.
  For raceloc-eval, which takes options of the same names: --integrity writes a line an estimate, its state, protection
  levels and covariance; --decisions a line a source a decision, its innovation and what the gate held against it;
  --latency a line a sweep, the time from its last point to its pose.
  At each sweep the walls beside the car are looked for in the sweep alone, and a guard says whether to drive the planned
  path or one along a wall: because nothing can be believed, or because the car comes too close. Walls, guard and path
  are in the annotated log and in the stream; --scene writes the first sweep in which the guard took over, or else the
  last one, for SceneViewer3D: scan, what stands on the ground by clusters, walls, path.
  With --race-line, a closed line in the order of driving (CSV as for raceloc-map: x_m, y_m east and north of the map's
  origin), the planned path is that one, from where the car is onto it. Without, while the car is not localized, or where it
  is farther than 10 m or 60 deg from that line, it is the arc that the car drives.
  A GPS fix with a heading says where to look for the car, and a scan match there starts the filter.
  A map of another place, or not of the content hash that --map-hash demands (raceloc-map check prints it), is
  refused; a damaged tile of the right one is left out and named.
  With --speed the log comes at that many times the pace of its stamps, as sensors would; with --sensors it comes
  from MRPT's drivers, one a section of the file in rawlog-grabber's manner. Either way --record keeps all that
  came in, in order of arrival: played with -i, it gives the same estimate and annotated log, bit for bit. Once a second
  a line on stderr tells rate, state, sensors, age of the estimate and CPU; a sensor that falls silent is named there.
  Ctrl-C or SIGTERM ends the run and keeps all files.
  With [live] stream in INI each output goes as a line of JSON to the rest of the car: see share/clients/README.md.
  With --odometry-only there is no map and no GPS: LiDAR, IMU, wheel speed and steering alone, in the frame of the
  first scan, turned level by the accelerometer; it also tells what it learnt of the sensors' errors.

EXAMPLES
  raceloc-live -c ini/live.ini -m monza.rlmap -i race.rawlog -o out.rawlog --trajectory race.tum
  raceloc-live -c ini/live.ini -m monza.rlmap -i race.rawlog --disable 'gps_*' --trajectory lidar_only.tum
  raceloc-live -c ini/live.ini -m monza.rlmap -i race.rawlog --disable 'gps_*' --scene walls.3Dscene
  raceloc-live -c ini/live.ini -m monza.rlmap -i race.rawlog --race-line raceline.csv -o out.rawlog
  raceloc-live -c ini/live.ini --odometry-only -i race.rawlog --trajectory odometry.tum
  raceloc-live -c car.ini -m monza.rlmap --sensors sensors.ini --record run1.rawlog
  raceloc-live --print-ini > my_live.ini     every key with its meaning, range and default

EXIT STATUS
  0 the log was played to its end; 130 or 143 Ctrl-C or SIGTERM ended it, and a line says what was kept; 2 an input is
  missing or wrong (one line says which); 1 a fault of raceloc.
)";

/** Runs `play(go_on)` with a line of progress, until it ends or somebody wants no more of it. */
template <class Play>
auto played(const char* what, const Play& play) {
  Progress progress(what);
  return play([&](double share) {
    progress(share);
    return stopSignal() == 0;
  });
}

/** Which of the ways to run is meant. \throws InputError for arguments that do not go together. */
void requireConsistent(const LiveArgs& args) {
  const bool is_live = !args.sensors_path.empty() || args.speed;
  if (args.ini_path.empty()) throw InputError("no options given: -c ini/live.ini (see --help)");
  if (args.rawlog_path.empty() == args.sensors_path.empty())
    throw InputError(args.rawlog_path.empty()
                         ? "no log given: -i RACE.rawlog, or --sensors SENSORS.ini (see --help)"
                         : "either -i RACE.rawlog or --sensors SENSORS.ini, not both");
  if (args.speed && (args.rawlog_path.empty() || !(*args.speed > 0 && *args.speed <= 1000)))
    throw InputError("--speed is for a log (-i), and must be > 0 .. 1000 times the pace of its stamps");
  if (!args.record_path.empty() && !is_live)
    throw InputError("--record is for --sensors or --speed: the log that is played is recorded already");
  requireApart({args.ini_path, args.map_path, args.rawlog_path, args.sensors_path, args.race_line_path},
               {args.output_path, args.trajectory_path, args.integrity_path, args.decisions_path,
                args.latency_path, args.record_path, args.scene_path});
  if (!args.odometry_only) {
    if (args.map_path.empty())
      throw InputError("no map given: -m MAP.rlmap, or --odometry-only (see --help)");
    return;
  }
  if (is_live) throw InputError("--odometry-only plays a log (-i) as fast as it goes");
  for (const std::string* path :
       {&args.map_path, &args.output_path, &args.integrity_path, &args.decisions_path, &args.latency_path,
        &args.scene_path, &args.race_line_path})
    if (!path->empty())
      throw InputError("--odometry-only takes no map (-m) or line and writes nothing but --trajectory: " +
                       *path);
  if (args.trajectory_path.empty())
    throw InputError("--odometry-only needs --trajectory ODOMETRY.tum (see --help)");
}

}  // namespace

std::optional<LiveArgs> parseLiveArgs(int argc, char** argv) {
  CommandLine cmd(kLiveManual);
  TCLAP::ValueArg<std::string> ini("c", "config", "options; see --print-ini", false, "", "INI", cmd);
  TCLAP::ValueArg<std::string> map("m", "map", "the map, made by raceloc-map", false, "", "MAP.rlmap", cmd);
  TCLAP::ValueArg<std::string> log("i", "input", "the log to play", false, "", "RACE.rawlog", cmd);
  TCLAP::ValueArg<double> speed(
      "", "speed", "play it at so many times the pace of its stamps; without: as fast as it goes", false, 1.0,
      "FACTOR", cmd);
  TCLAP::ValueArg<std::string> sensors("", "sensors", "sensors to run on, instead of a log", false, "",
                                       "SENSORS.ini", cmd);
  TCLAP::ValueArg<std::string> record("", "record", "rawlog to keep all that comes in", false, "",
                                      "BLACKBOX.rawlog", cmd);
  TCLAP::ValueArg<std::string> out("o", "output", "annotated rawlog to write", false, "", "OUT.rawlog", cmd);
  TCLAP::ValueArg<std::string> trajectory("", "trajectory", "estimate to write (TUM)", false, "", "RACE.tum",
                                          cmd);
  TCLAP::ValueArg<std::string> integrity("", "integrity",
                                         "state, protection levels and covariance of each estimate to write",
                                         false, "", "FILE.csv", cmd);
  TCLAP::ValueArg<std::string> decisions("", "decisions", "what the gate held against each source to write",
                                         false, "", "FILE.csv", cmd);
  TCLAP::ValueArg<std::string> latency("", "latency", "time from sweep to pose of each sweep to write", false,
                                       "", "FILE.csv", cmd);
  TCLAP::ValueArg<std::string> scene("", "scene", "sweep with its walls to write, for SceneViewer3D", false,
                                     "", "SWEEP.3Dscene", cmd);
  TCLAP::ValueArg<std::string> race_line("", "race-line", "the line that the car drives", false, "",
                                         "LINE.csv", cmd);
  TCLAP::ValueArg<std::string> disable("", "disable", "switch off the sources of these labels, e.g. 'gps_*'",
                                       false, "", "LABELS", cmd);
  TCLAP::ValueArg<double> after("", "disable-after", "but hear them for this long first [s]", false, 1.0,
                                "SECONDS", cmd);
  TCLAP::ValueArg<std::string> map_hash("", "map-hash",
                                        "the map must have this content hash, or the run is refused", false,
                                        "", "md5:...", cmd);
  TCLAP::SwitchArg odometry_only("", "odometry-only", "without a map: LIV odometry, to --trajectory", cmd);
  TCLAP::SwitchArg print_ini("", "print-ini", "print every key with its default and end", cmd);
  TCLAP::SwitchArg verbose("v", "verbose", "also print the options in force", cmd);
  if (!cmd.parse(argc, argv)) return std::nullopt;

  LiveArgs args{};
  args.ini_path = ini.getValue();
  args.map_path = map.getValue();
  args.rawlog_path = log.getValue();
  args.sensors_path = sensors.getValue();
  args.output_path = out.getValue();
  args.trajectory_path = trajectory.getValue();
  args.integrity_path = integrity.getValue();
  args.decisions_path = decisions.getValue();
  args.latency_path = latency.getValue();
  args.record_path = record.getValue();
  args.scene_path = scene.getValue();
  args.race_line_path = race_line.getValue();
  args.odometry_only = odometry_only.getValue();
  args.verbose = verbose.getValue();
  args.print_ini = print_ini.getValue();
  if (speed.isSet()) args.speed = speed.getValue();
  if (!args.print_ini) requireConsistent(args);
  if (disable.isSet()) args.disable_labels = disable.getValue();
  if (map_hash.isSet()) args.map_hash = map_hash.getValue();
  if (after.isSet()) {
    if (!(after.getValue() >= 0)) throw InputError("--disable-after must be >= 0 s");
    args.disable_after_s = after.getValue();
  }
  return args;
}

void runLive(const LiveArgs& args) {
  if (args.print_ini) {
    std::cout << ReplayOptions{}.iniText();
    return;
  }
  ReplayOptions options = ReplayOptions::fromIni(args.ini_path);
  if (args.disable_labels) options.live.disable_labels = *args.disable_labels;
  if (args.disable_after_s) options.live.disable_after_s = *args.disable_after_s;
  if (args.map_hash) options.live.map_hash = *args.map_hash;
  if (!args.race_line_path.empty()) options.localizer.race_line_map_m = readDrivenLine(args.race_line_path);
  if (args.verbose) std::cout << options.iniText() << "\n";
  std::optional<GeodeticPoint> origin;  // a map that is no good is told before the log is looked through
  if (!args.odometry_only) origin = originOf(args.map_path);
  stopWhenAsked();
  LiveOutputs outputs(args, origin);
  std::optional<LineStream> stream;
  if (!options.live.stream.empty()) {
    stream.emplace(options.live.stream);
    std::fprintf(stderr, "raceloc-live: stream %s\n", stream->url().c_str());
  }

  if (!args.odometry_only) printFalseRejects(options.localizer.estimator);
  const auto start = std::chrono::steady_clock::now();
  double recorded_s = 0;
  std::vector<std::string> kept;
  const Listener write = [&](const LocalizerOutput& output) { outputs.see(output); };
  const auto finish = [&](const auto& report, const Pose& T_map_odom) {
    for (auto& path : outputs.commit(T_map_odom)) kept.push_back(std::move(path));
    print(report);
    recorded_s = report.recorded_s;
  };
  try {
    if (args.odometry_only) {
      const LogSummary log = lookedThrough(
          [&](const auto& progress) { return requireScans(args.rawlog_path, options, progress); });
      const OdometryReport report = played("odometry", [&](const GoOn& go_on) {
        return replayOdometry(log, options, go_on, [&](const StampedPose& pose) { outputs.see(pose); });
      });
      finish(report, report.T_map_odom);
    } else if (args.speed || !args.sensors_path.empty())
      finish(runInCar(args, options, stream ? &*stream : nullptr, write, kept), Pose::Identity());
    else {
      const LogSummary log = lookedThrough(
          [&](const auto& progress) { return requirePlayable(args.rawlog_path, options, progress); });
      const ReplayReport report = played("localizing", [&](const GoOn& go_on) {
        const Listener send = streaming(stream ? &*stream : nullptr, {});
        const Listener listen = [&](const LocalizerOutput& output) {
          if (send) send(output);
          write(output);
        };
        return replay(log, args.map_path, args.output_path, options, go_on, listen);
      });
      if (!args.output_path.empty()) kept.push_back(args.output_path);
      finish(report, Pose::Identity());
    }
  } catch (const InputError& e) {
    if (stopSignal() != 0)
      throw Stopped(
          stopSignal(),
          "stopped early, " + (kept.empty() ? "nothing is kept" : "kept " + listed(kept)) + ": " + e.what());
    throw;
  }
  const double wall_s = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  std::printf("run              %.1f s wall for %.1f s recorded, peak memory %.0f MiB\n", wall_s, recorded_s,
              peakMemory_MiB());
  if (stopSignal() == 0 && !kept.empty()) std::printf("written          %s\n", listed(kept).c_str());
  if (stopSignal() != 0) {
    char after[32];
    std::snprintf(after, sizeof after, "%.1f", recorded_s);
    throw Stopped(stopSignal(), std::string("stopped after ") + after + " s; kept " + listed(kept));
  }
}

}  // namespace raceloc
