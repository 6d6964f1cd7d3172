#include "cli/simulate.h"

#include <tbb/global_control.h>

#include <algorithm>
#include <chrono>
#include <cstdio>
#include <filesystem>
#include <future>
#include <limits>

#include "cli/app.h"
#include "cli/track_preview.h"
#include "core/labels.h"
#include "core/output_file.h"
#include "eval/format.h"
#include "sensors/device_tally.h"
#include "sensors/rawlog.h"
#include "sim/faults.h"

namespace raceloc {

namespace {

std::string besideLog(const std::string& log_path, const std::string& ending) {
  const std::filesystem::path path(log_path);
  return (path.parent_path() / (path.stem().string() + ending)).string();
}

/** Where the devices are in the body, which a log does not tell of an IMU. */
std::string placesText(const CarFile& car, const std::string& labels) {
  std::string text = "\n[places]\n// ahead of the rear axle, to the left, above it [m]\n";
  const auto list = [&](const auto& devices) {
    for (const auto& [label, device] : devices)
      if (matchesLabel(labels, label))
        text +=
            label + " = " + number(device.x_m) + " " + number(device.y_m) + " " + number(device.z_m) + "\n";
  };
  list(car.lidars);
  list(car.gps);
  list(car.imus);
  list(car.vehicles);
  return text;
}

/** Without its folder: the same files make the same log wherever they lie. */
std::string fileName(const std::string& path) { return std::filesystem::path(path).filename().string(); }

/** What was simulated, as ini text: the manifest, and the header of the log. */
std::string manifestText(const SimulateArgs& args, const Circuit& circuit, const CarFile& car,
                         const Race& race, const std::vector<Fault>& faults) {
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
  text += placesText(car, o.labels);
  if (!faults.empty()) text += "\n" + iniText(faults);
  return text;
}

/** The files of a simulation; batches are compressed and written while the next one is simulated. */
class RaceFiles {
 public:
  RaceFiles(const std::string& log_path, const GeodeticPoint& origin, const std::string& manifest,
            int gzip_level)
      : x_manifest_path(besideLog(log_path, "_manifest.ini")),
        x_manifest(manifest),
        x_truth(besideLog(log_path, "_truth.tum"), origin),
        x_log(log_path, {origin, "\n" + manifest}, gzip_level) {}
  void write(RaceMessage message) {
    constexpr std::size_t kBatch = 400, kScans = 3;  // bounds the memory: two batches are alive at most
    const auto* sample = std::get_if<Sample>(&message);
    if (sample != nullptr && std::holds_alternative<Scan>(*sample)) {
      ++x_scans;
      x_returns += std::get<Scan>(*sample).cloud.size();
    }
    x_batch.push_back(std::move(message));
    if (x_batch.size() >= kBatch || x_scans >= kScans) flush();
  }
  void commit() {
    flush();
    if (x_writing.valid()) x_writing.get();
    x_log.finish();  // a full disk shows here, before anything has its name
    x_truth.commit();
    writeTextFile(x_manifest_path, x_manifest);
    x_log.commit();
  }
  [[nodiscard]] std::vector<DeviceSummary> devices() const { return x_tally.devices(); }
  [[nodiscard]] std::size_t returns() const { return x_returns; }

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
        }
      }
    });
    x_batch = {};
  }
  std::string x_manifest_path, x_manifest;
  // The next three are touched by the writing thread alone until commit().
  TumWriter x_truth;
  LogWriter x_log;
  DeviceTally x_tally;
  std::size_t x_scans = 0, x_returns = 0;
  std::vector<RaceMessage> x_batch;
  std::future<void> x_writing;  ///< the last member: it is waited for before the others go
};

/** The manifest has a name that the user did not choose: it must not fall on what was read. */
void requireNotInput(const std::string& output, const SimulateArgs& args) {
  for (const auto& input : {args.track_path, args.car_path, args.faults_path}) {
    std::error_code missing;
    if (std::filesystem::equivalent(input, output, missing))
      throw InputError("output " + output + ": is an input of this run; give the log another name");
  }
}

void print(const Circuit& circuit, const SpeedProfile& profile) {
  std::printf("track            %s, %.1f m\n", circuit.name.c_str(), circuit.track.length_m());
  if (circuit.miss.gap_m > 0)
    std::printf(
        "closed           the segments missed a loop by %.2f m, %.2f m in height, %.3f deg: distributed\n",
        circuit.miss.gap_m, circuit.miss.height_m, circuit.miss.heading_rad / kDegree);
  for (const auto& note : circuit.notes) std::printf("note             %s\n", note.c_str());
  std::printf("flying lap       %.1f s, mean %.1f km/h, top %.1f km/h\n", profile.lap_s(),
              3.6 * profile.mean_mps(), 3.6 * profile.top_mps());
}

}  // namespace

void simulate(const SimulateArgs& args) {
  std::optional<tbb::global_control> limit;
  if (args.threads > 0)
    limit.emplace(tbb::global_control::max_allowed_parallelism, static_cast<std::size_t>(args.threads));
  Circuit circuit = readCircuit(args.track_path);
  if (args.top_speed_mps) circuit.pace.top_speed_mps = *args.top_speed_mps;
  const CarFile car = readCarFile(args.car_path);
  const auto devices = car.devices(args.race.labels);
  if (args.race.start_mps && *args.race.start_mps > circuit.pace.top_speed_mps)
    throw InputError("--start-speed is above the top speed of " + number(circuit.pace.top_speed_mps) +
                     " m/s");
  std::vector<Fault> faults;
  if (!args.faults_path.empty()) {
    faults = readFaults(args.faults_path);
    requireDevices(faults, args.faults_path, devices);
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

  requireNotInput(besideLog(args.log_path, "_manifest.ini"), args);
  const OutputFile probe(args.log_path);  // an output that cannot be written is told before the work
  const auto start = std::chrono::steady_clock::now();
  Race race(circuit, car, args.race);
  RaceFiles files(args.log_path, circuit.origin, manifestText(args, circuit, car, race, faults),
                  args.gzip_level);
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
  for (const auto& fault : faults)
    if (fault.from_s > simulated_s)
      std::printf("NO EFFECT        [%s] begins at %.1f s, after the end\n", fault.section.c_str(),
                  fault.from_s);
  const double wall_s = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  std::printf(
      "run              %.1f s wall for %.1f s simulated, %.1f M LiDAR returns, peak memory %.0f MiB\n",
      wall_s, simulated_s, static_cast<double>(files.returns()) / 1e6, peakMemory_MiB());
  std::printf("written          %s, %s, %s\n", args.log_path.c_str(),
              besideLog(args.log_path, "_truth.tum").c_str(),
              besideLog(args.log_path, "_manifest.ini").c_str());
}

}  // namespace raceloc
