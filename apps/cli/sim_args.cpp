#include "cli/sim_args.h"

#include <cstdio>
#include <filesystem>
#include <iostream>

#include "cli/app.h"
#include "cli/text_options.h"
#include "sim/fault_options.h"

namespace raceloc {

namespace {

constexpr char kSimManual[] = R"(NAME
  raceloc-sim - races that no one can record here, as rawlogs with truth and faults

SYNOPSIS
  raceloc-sim --track TRACK --car CAR.ini [--laps N] [--seed S] [--faults FAULTS.ini] -o LOG.rawlog
  raceloc-sim --track TRACK --car CAR.ini --preview PICTURE.png
  raceloc-sim inject --faults FAULTS.ini -i LOG.rawlog -o FAULTY.rawlog
  raceloc-sim closed-loop --track TRACK --car CAR.ini --from M -o NAME
  raceloc-sim --print-faults

DESCRIPTION
  Drives a car round a circuit and writes what its devices would have recorded: LiDAR sweeps whose points are each cast
  from the pose at their own time, GPS/INS, IMU, wheel speed and steering. TRACK is an ini (share/tracks/*.ini: copy one and
  change it) or a centre-line CSV x_m,y_m,w_tr_right_m,w_tr_left_m. CAR.ini is the car and its devices (ini/sim/*.ini).
  FAULTS.ini lists what goes wrong, from when to when (ini/sim/faults/*.ini; --print-faults shows every kind).

  Beside LOG.rawlog it writes LOG_truth.tum (T_map_body, 100 Hz) and LOG_manifest.ini (what was simulated); the truth
  is in the log too, as `truth`. The log opens in RawLogViewer. Same options, same seed: the same bytes.

  `inject` puts the same faults into a log that you have recorded; messages that no fault touches stay as they are.

  `closed-loop` lets a car steer by what it measures while localization fails, or along a line that leads into the wall.

EXAMPLES
  raceloc-sim --track share/tracks/lvms.ini --car ini/sim/indy.ini --preview lvms.png
  raceloc-sim --track share/tracks/lvms.ini --car ini/sim/indy.ini --laps 2 --seed 1 -o lvms.rawlog
  raceloc-sim --track share/tracks/lvms.ini --car ini/sim/indy.ini --faults ini/sim/faults/gps_step_20m.ini -o step.rawlog
  raceloc-sim --track share/tracks/lor.ini --car ini/sim/road_car.ini --top-speed 15 --devices 'lidar_top gps_* imu vehicle' -o survey.rawlog
  raceloc-sim inject --faults ini/sim/faults/gps_outage.ini -i my_lap.rawlog -o my_lap_without_gps.rawlog

EXIT STATUS
  0 done; 2 an input is missing or wrong (one line says which); 1 a fault of raceloc.
)";

constexpr char kInjectManual[] = R"(NAME
  raceloc-sim inject - faults into a log that was recorded

SYNOPSIS
  raceloc-sim inject --faults FAULTS.ini [--seed S] -i LOG.rawlog -o FAULTY.rawlog

DESCRIPTION
  Times of the faults count from the first stamp of the log; those of ini/sim/faults begin after 20 s. Messages that no
  fault touches are copied as they are. The others are written anew, as raceloc writes its own logs: a GPS with position,
  sigmas, speed and course; an odometry with its velocity alone; an IMU in the body's axes; Velodyne packets as a point
  cloud. Actions, the bounds of sensory frames and comments behind the header are left out. What was injected is in the
  header. Same log, faults and seed: the same bytes.

EXAMPLES
  raceloc-sim inject --faults ini/sim/faults/gps_noise_5m.ini --seed 3 -i race.rawlog -o race_noisy.rawlog

EXIT STATUS
  0 done; 2 an input is missing or wrong (one line says which); 1 a fault of raceloc.
)";

void requireLogName(const std::string& path) {
  if (std::filesystem::path(path).extension() != ".rawlog")
    throw InputError("output " + path + ": a log's name ends in .rawlog");
}

std::optional<SimArgs> parseInject(std::vector<std::string> words) {
  CommandLine cmd(kInjectManual);
  Text out("o", "output", "the rawlog to write", true, "", "FAULTY.rawlog", cmd);
  Text in("i", "input", "the rawlog to read", true, "", "LOG.rawlog", cmd);
  Text gzip("", "gzip-level", "0 (no compression) to 9 (default 1)", false, "1", "N", cmd);
  Text seed("", "seed", "of what is random in the faults (default 1)", false, "1", "N", cmd);
  Text faults("", "faults", "what goes wrong", true, "", "FAULTS.ini", cmd);
  if (!cmd.parse(std::move(words))) return std::nullopt;
  requireLogName(out.getValue());
  std::error_code ignored;
  if (std::filesystem::equivalent(in.getValue(), out.getValue(), ignored))
    throw InputError("output " + out.getValue() + ": is the input itself; give it another name");
  return SimArgs(InjectArgs{faults.getValue(), in.getValue(), out.getValue(),
                            static_cast<std::uint64_t>(wholeNumberOf(seed, between(0, 1e9))),
                            wholeNumberOf(gzip, between(0, 9))});
}

}  // namespace

std::optional<SimArgs> parseSimArgs(int argc, char** argv) {
  const std::string task = argc > 1 ? argv[1] : "";
  if (task == "inject" || task == "closed-loop") {
    std::vector<std::string> words(argv + 1, argv + argc);
    words[0] = argv[0];
    if (task == "inject") return parseInject(std::move(words));
    if (auto args = parseClosedLoop(std::move(words))) return SimArgs(std::move(*args));
    return std::nullopt;
  }
  CommandLine cmd(kSimManual);
  TCLAP::SwitchArg print_faults("", "print-faults", "print an ini with every kind of fault and end", cmd);
  Text threads("", "threads", "to cast rays with (default 0: one a core)", false, "0", "N", cmd);
  Text gzip("", "gzip-level", "of the log: 0 (no compression) to 9 (default 1)", false, "1", "N", cmd);
  Text preview("", "preview", "draw the circuit with walls, racing line and way-points; alone: no log", false,
               "", "FILE.png", cmd);
  Text devices("", "devices", "labels or patterns of the devices to simulate (default all)", false, "*",
               "LABELS", cmd);
  Text traffic("", "traffic", "other cars on the track (default 0)", false, "0", "N", cmd);
  Text stand("", "stand", "seconds on the grid before the start, with --start-speed 0 (default 0)", false,
             "0", "S", cmd);
  Text top("", "top-speed", "never faster than this [m/s] (default: the track's)", false, "", "MPS", cmd);
  Text start("", "start-speed", "at the start line [m/s] (default: as fast as a flying lap)", false, "",
             "MPS", cmd);
  Text faults("", "faults", "what goes wrong", false, "", "FAULTS.ini", cmd);
  Text seed("", "seed", "of all noise, biases, traffic and trees (default 1)", false, "1", "N", cmd);
  Text laps("", "laps", "how far, e.g. 2 or 0.25 (default 1)", false, "1", "N", cmd);
  Text out("o", "output", "the rawlog to write", false, "", "LOG.rawlog", cmd);
  Text car("c", "car", "the car and its devices", false, "", "CAR.ini", cmd);
  Text track("", "track", "the circuit", false, "", "TRACK.ini|CSV", cmd);
  if (!cmd.parse(argc, argv)) return std::nullopt;
  if (print_faults.getValue()) return SimArgs(PrintFaults{});

  if (!track.isSet()) throw InputError("no circuit given: --track share/tracks/lvms.ini (see --help)");
  if (!car.isSet()) throw InputError("no car given: --car ini/sim/indy.ini (see --help)");
  if (!out.isSet() && !preview.isSet())
    throw InputError("no output given: -o LOG.rawlog or --preview FILE.png (see --help)");
  SimulateArgs args;
  args.track_path = track.getValue();
  args.car_path = car.getValue();
  args.faults_path = faults.getValue();
  args.log_path = out.getValue();
  args.preview_path = preview.getValue();
  args.race.laps = numberOf(laps, between(0.001, 1000));
  args.race.seed = static_cast<std::uint64_t>(wholeNumberOf(seed, between(0, 1e9)));
  if (start.isSet()) args.race.start_mps = numberOf(start, between(0, 120));
  if (top.isSet()) args.top_speed_mps = numberOf(top, between(3, 120));
  args.race.stand_s = numberOf(stand, between(0, 3600));
  args.race.traffic = wholeNumberOf(traffic, between(0, 50));
  args.race.labels = devices.getValue();
  args.gzip_level = wholeNumberOf(gzip, between(0, 9));
  args.threads = wholeNumberOf(threads, between(0, 1024));
  if (args.race.stand_s > 0 && args.race.start_mps != 0.0)
    throw InputError("--stand " + stand.getValue() +
                     ": a car that stands on the grid starts with --start-speed 0");
  if (out.isSet()) requireLogName(args.log_path);
  if (preview.isSet() && std::filesystem::path(args.preview_path).extension() != ".png")
    throw InputError("output " + args.preview_path + ": a picture's name ends in .png");
  return SimArgs(args);
}

namespace {

void printFaults() {
  std::vector<Fault> faults;
  for (const FaultKind kind : faultKinds()) {
    Fault fault;
    char section[32];
    std::snprintf(section, sizeof section, "fault_%02zu", faults.size() + 1);
    fault.section = section;
    fault.kind = kind;
    fault.from_s = 20;
    fault.to_s = 40;
    faults.push_back(fault);
  }
  std::cout << iniText(faults);
}

}  // namespace

void runSim(const SimArgs& args) {
  if (const auto* race = std::get_if<SimulateArgs>(&args)) simulate(*race);
  if (const auto* log = std::get_if<InjectArgs>(&args)) inject(*log);
  if (const auto* loop = std::get_if<ClosedLoopArgs>(&args)) runClosedLoop(*loop);
  if (std::holds_alternative<PrintFaults>(args)) printFaults();
}

}  // namespace raceloc
