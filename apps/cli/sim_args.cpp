#include "cli/sim_args.h"

#include <mrpt/obs/CObservation.h>
#include <tbb/global_control.h>

#include <algorithm>
#include <chrono>
#include <cstdio>
#include <filesystem>
#include <future>
#include <iostream>
#include <thread>

#include "cli/app.h"
#include "cli/text_options.h"
#include "cli/track_preview.h"
#include "core/labels.h"
#include "core/output_file.h"
#include "sensors/device_tally.h"
#include "sensors/message_reader.h"
#include "sensors/rawlog.h"
#include "sim/faults.h"

namespace raceloc {

namespace {

constexpr char kManual[] = R"(NAME
  raceloc-sim - races that no one can record here, as rawlogs with truth and faults

SYNOPSIS
  raceloc-sim --track TRACK --car CAR.ini [--laps N] [--seed S] [--faults FAULTS.ini] -o LOG.rawlog
  raceloc-sim --track TRACK --car CAR.ini --preview PICTURE.png
  raceloc-sim inject --faults FAULTS.ini -i LOG.rawlog -o FAULTY.rawlog
  raceloc-sim --print-faults

DESCRIPTION
  Drives a car round a circuit and writes what its devices would have recorded: LiDAR sweeps whose points are each cast
  from the pose at their own time, GPS/INS, IMU, wheel speed and steering. TRACK is an ini (share/tracks/*.ini: copy one and
  change it) or a centre-line CSV x_m,y_m,w_tr_right_m,w_tr_left_m. CAR.ini is the car and its devices (ini/sim/*.ini).
  FAULTS.ini lists what goes wrong, from when to when (ini/sim/faults/*.ini; --print-faults shows every kind).

  Beside LOG.rawlog it writes LOG_truth.tum (T_map_body, 100 Hz) and LOG_manifest.ini (what was simulated); the truth
  is in the log too, as `truth`. The log opens in RawLogViewer. Same options, same seed: the same bytes.

  `inject` puts the same faults into a log that you have recorded; messages that no fault touches stay as they are.

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
  Times of the faults count from the first stamp of the log. Messages that no fault touches are copied as they are; the
  others are written anew, of a GPS with position, sigmas, and speed and course. Faults are listed in the header
  of the log. Same log, faults and seed: the same bytes.

EXAMPLES
  raceloc-sim inject --faults ini/sim/faults/gps_noise_5m.ini --seed 3 -i race.rawlog -o race_noisy.rawlog

EXIT STATUS
  0 done; 2 an input is missing or wrong (one line says which); 1 a fault of raceloc.
)";

std::optional<SimArgs> parseInject(std::vector<std::string> words) {
  CommandLine cmd(kInjectManual);
  Text out("o", "output", "the rawlog to write", true, "", "FAULTY.rawlog", cmd);
  Text in("i", "input", "the rawlog to read", true, "", "LOG.rawlog", cmd);
  Text gzip("", "gzip-level", "0 (no compression) to 9 (default 1)", false, "1", "N", cmd);
  Text seed("", "seed", "of what is random in the faults (default 1)", false, "1", "N", cmd);
  Text faults("", "faults", "what goes wrong", true, "", "FAULTS.ini", cmd);
  std::vector<char*> argv;
  for (auto& word : words) argv.push_back(word.data());
  if (!cmd.parse(static_cast<int>(argv.size()), argv.data())) return std::nullopt;
  std::error_code ignored;
  if (std::filesystem::equivalent(in.getValue(), out.getValue(), ignored))
    throw InputError("output " + out.getValue() + ": is the input itself; give it another name");
  return SimArgs(InjectArgs{faults.getValue(), in.getValue(), out.getValue(),
                            static_cast<std::uint64_t>(wholeNumberOf(seed, between(0, 1e9))),
                            wholeNumberOf(gzip, between(0, 9))});
}

}  // namespace

std::optional<SimArgs> parseSimArgs(int argc, char** argv) {
  if (argc > 1 && argv[1] == std::string("inject")) {
    std::vector<std::string> words(argv + 1, argv + argc);
    words[0] = argv[0];
    return parseInject(std::move(words));
  }
  CommandLine cmd(kManual);
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
  if (out.isSet() && std::filesystem::path(args.log_path).extension() != ".rawlog")
    throw InputError("output " + args.log_path + ": a log's name ends in .rawlog");
  return SimArgs(args);
}

namespace {

std::string besides(const std::string& log_path, const std::string& ending) {
  const std::filesystem::path path(log_path);
  return (path.parent_path() / (path.stem().string() + ending)).string();
}

std::string number(double value) {
  char text[32];
  std::snprintf(text, sizeof text, "%.10g", value);
  return text;
}

/** Without its folder: the same files make the same log wherever they lie. */
std::string fileName(const std::string& path) { return std::filesystem::path(path).filename().string(); }

/** What was simulated, as ini text: the manifest, and the header of the log. */
std::string manifestText(const SimulateArgs& args, const Circuit& circuit, const Race& race,
                         const std::vector<Fault>& faults) {
  const auto& o = args.race;
  std::string text =
      "[simulation]\nversion = " + toolVersion() + "\ntrack = " + fileName(args.track_path) +
      "\ntrack_name = " + circuit.name + "\ntrack_length_m = " + number(circuit.track.length_m()) +
      "\ncar = " + fileName(args.car_path) + "\ndevices = " + o.labels + "\nlaps = " + number(o.laps) +
      "\nseed = " + std::to_string(o.seed) +
      "\nstart_speed_mps = " + number(o.start_mps.value_or(race.profile().at(0).speed_mps)) +
      "\nstand_s = " + number(o.stand_s) + "\ntop_speed_mps = " + number(circuit.pace.top_speed_mps) +
      "\ntraffic = " + std::to_string(o.traffic) + "\nstart_stamp_s = " + number(kStartStamp_s) +
      "\nfaults = " + (args.faults_path.empty() ? "none" : fileName(args.faults_path)) + "\n";
  if (!faults.empty()) text += "\n" + iniText(faults);
  return text;
}

std::vector<DeviceName> devicesOf(const CarFile& car, const std::string& labels) {
  std::vector<DeviceName> names;
  const auto list = [&](const auto& devices, const char* kind) {
    for (const auto& device : devices)
      if (matchesLabel(labels, device.first)) names.push_back({device.first, kind});
  };
  list(car.lidars, "lidar");
  list(car.gps, "gps");
  list(car.imus, "imu");
  list(car.vehicles, "vehicle");
  return names;
}

/** The files of a simulation; batches are compressed and written while the next one is simulated. */
class RaceFiles {
 public:
  RaceFiles(const std::string& log_path, const GeodeticPoint& origin, const std::string& manifest,
            int gzip_level)
      : x_manifest_path(besides(log_path, "_manifest.ini")),
        x_manifest(manifest),
        x_truth(besides(log_path, "_truth.tum"), origin),
        x_log(log_path, {origin, "\n" + manifest}, gzip_level) {}
  ~RaceFiles() {
    if (x_writing.valid()) x_writing.wait();
  }
  RaceFiles(const RaceFiles&) = delete;
  RaceFiles& operator=(const RaceFiles&) = delete;

  void write(RaceMessage message) {
    constexpr std::size_t kBatch = 400, kScans = 3;  // bounds the memory: two batches are alive at most
    const auto* sample = std::get_if<Sample>(&message);
    if (sample != nullptr && std::holds_alternative<Scan>(*sample)) {
      ++x_scans;
      x_rays_hit += std::get<Scan>(*sample).cloud.size();
    }
    x_batch.push_back(std::move(message));
    if (x_batch.size() >= kBatch || x_scans >= kScans) flush();
  }
  void commit() {
    flush();
    if (x_writing.valid()) x_writing.get();
    x_truth.commit();
    writeTextFile(x_manifest_path, x_manifest);
    x_log.commit();
  }
  [[nodiscard]] std::vector<DeviceSummary> devices() const { return x_tally.devices(); }
  [[nodiscard]] std::size_t truths() const { return x_truths; }
  [[nodiscard]] std::size_t returns() const { return x_rays_hit; }

 private:
  void flush() {
    if (x_writing.valid()) x_writing.get();  // throws what the writer threw
    x_scans = 0;
    x_writing = std::async(std::launch::async, [this, batch = std::move(x_batch)] {
      for (const auto& message : batch) {
        if (const auto* sample = std::get_if<Sample>(&message)) {
          x_log.write(*sample);
          x_tally.add(*sample);
        } else {
          const auto& truth = std::get<StampedPose>(message);
          x_log.writePose(truth.stamp_s, "truth", truth.T_map_body);
          x_truth.write(truth);
          ++x_truths;
        }
      }
    });
    x_batch = {};
  }
  std::string x_manifest_path, x_manifest;
  TumWriter x_truth;
  LogWriter x_log;
  DeviceTally
      x_tally;  // like the two writers and x_truths, touched by the writing thread alone until commit()
  std::size_t x_truths = 0, x_scans = 0, x_rays_hit = 0;
  std::vector<RaceMessage> x_batch;
  std::future<void> x_writing;
};

void print(const Circuit& circuit, const SpeedProfile& profile) {
  std::printf(
      "track            %s, %.1f m; segments missed a loop by %.2f m, %.2f m in height, %.3f deg, "
      "distributed\n",
      circuit.name.c_str(), circuit.track.length_m(), circuit.miss.gap_m, circuit.miss.height_m,
      circuit.miss.heading_rad * 180 / M_PI);
  for (const auto& note : circuit.notes) std::printf("note             %s\n", note.c_str());
  std::printf("flying lap       %.1f s, mean %.1f km/h, top %.1f km/h\n", profile.lap_s(),
              3.6 * profile.mean_mps(), 3.6 * profile.top_mps());
}

void simulate(const SimulateArgs& args) {
  std::optional<tbb::global_control> limit;
  if (args.threads > 0)
    limit.emplace(tbb::global_control::max_allowed_parallelism, static_cast<std::size_t>(args.threads));
  Circuit circuit = readCircuit(args.track_path);
  if (args.top_speed_mps) circuit.pace.top_speed_mps = *args.top_speed_mps;
  const CarFile car = readCarFile(args.car_path);
  std::vector<Fault> faults;
  if (!args.faults_path.empty()) {
    faults = readFaults(args.faults_path);
    requireDevices(faults, args.faults_path, devicesOf(car, args.race.labels));
  }
  if (args.log_path.empty() || !args.preview_path.empty()) {
    const RacingLine line(circuit.track, car.driver.margin_m);
    const SpeedProfile profile(circuit.track, line, car.car, car.driver, circuit.pace);
    writeTextFile(args.preview_path, trackPreview(circuit, line, profile));
    if (args.log_path.empty()) {
      print(circuit, profile);
      std::printf("written          %s\n", args.preview_path.c_str());
      return;
    }
  }

  const OutputFile probe(args.log_path);  // an output that cannot be written is told before the work
  const auto start = std::chrono::steady_clock::now();
  Race race(circuit, car, args.race);
  RaceFiles files(args.log_path, circuit.origin, manifestText(args, circuit, race, faults), args.gzip_level);
  FaultInjector injector(faults, kStartStamp_s, args.race.seed);
  ArrivalQueue<RaceMessage> late;
  double simulated_s = 0;
  {
    Progress progress("simulating");
    const auto writeUntil = [&](double time_s) {
      while (auto arrived = late.pop(time_s)) files.write(std::move(arrived->second));
    };
    while (auto arrival = race.next()) {
      simulated_s = arrival->time_s;
      if (auto* sample = std::get_if<Sample>(&arrival->message)) {
        for (auto& delivery : injector.apply({arrival->time_s, std::move(*sample)}))
          late.push(delivery.arrival_s, std::move(delivery.sample));
      } else {
        late.push(arrival->time_s, std::move(arrival->message));
      }
      writeUntil(simulated_s);
      progress(race.progress());
    }
    writeUntil(std::numeric_limits<double>::infinity());
  }
  files.commit();

  print(circuit, race.profile());
  std::printf("%s", toText(files.devices()).c_str());
  if (!faults.empty())
    std::printf("faults           %zu, from %s\n", faults.size(), args.faults_path.c_str());
  const double wall_s = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  std::printf(
      "run              %.1f s wall for %.1f s simulated, %.1f M LiDAR returns, peak memory %.0f MiB\n",
      wall_s, simulated_s, static_cast<double>(files.returns()) / 1e6, peakMemory_MiB());
  std::printf("written          %s, %s, %s\n", args.log_path.c_str(),
              besides(args.log_path, "_truth.tum").c_str(), besides(args.log_path, "_manifest.ini").c_str());
}

void inject(const InjectArgs& args) {
  const auto faults = readFaults(args.faults_path);
  const LogSummary summary = summarizeRawlog(args.input_path);
  std::vector<DeviceName> devices;
  for (const auto& device : summary.devices)
    if (device.kind != "other" && device.kind != "ins_pose") devices.push_back({device.label, device.kind});
  requireDevices(faults, args.faults_path, devices);
  const auto isVehicle = [&](const std::string& label) {
    return std::any_of(devices.begin(), devices.end(),
                       [&](const auto& device) { return device.kind == "vehicle" && device.label == label; });
  };

  FaultInjector injector(faults, summary.first_s, args.seed);
  MessageReader reader(args.input_path);
  LogHeader header = reader.header();
  if (!header.origin) header.origin = summary.origin;
  header.text += "\n" + iniText(faults);
  LogWriter writer(args.output_path, header, args.gzip_level);

  using Originals = std::vector<std::shared_ptr<mrpt::obs::CObservation>>;
  ArrivalQueue<std::variant<Originals, Sample>> late;
  std::size_t messages = 0, touched = 0, lost = 0;
  const auto writeUntil = [&](double time_s) {
    while (auto arrived = late.pop(time_s)) {
      if (const auto* sample = std::get_if<Sample>(&arrived->second))
        writer.write(*sample);
      else
        for (const auto& original : std::get<Originals>(arrived->second)) writer.write(*original);
    }
  };
  {
    Progress progress("injecting");
    double now_s = summary.first_s;  // of the recorder: the file is in its order
    const auto wanted = [&](const std::string& label, double stamp_s) {
      return injector.touches(label, stamp_s) || isVehicle(label);
    };
    while (auto message = reader.next(wanted)) {
      ++messages;
      now_s = std::max(now_s, message->stamp_s);
      if (message->sample && injector.touches(message->label, message->stamp_s)) {
        const auto deliveries = injector.apply({now_s, std::move(*message->sample)});
        ++touched;
        if (deliveries.empty()) ++lost;
        for (const auto& delivery : deliveries) late.push(delivery.arrival_s, delivery.sample);
      } else {
        // A motion that stays as it is still tells the faults how the car moves.
        if (message->sample) (void)injector.apply({now_s, std::move(*message->sample)});
        late.push(now_s, std::move(message->originals));
      }
      writeUntil(now_s);
      progress(reader.progress());
    }
    writeUntil(std::numeric_limits<double>::infinity());
  }
  writer.commit();
  std::printf("messages         %zu, of which %zu within a fault, %zu of these lost\nwritten          %s\n",
              messages, touched, lost, args.output_path.c_str());
}

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
  if (std::holds_alternative<PrintFaults>(args)) printFaults();
}

}  // namespace raceloc
