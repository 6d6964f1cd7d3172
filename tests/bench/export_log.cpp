/** \file
 * What programs that read no rawlog need of one: `export_log LOG.rawlog FOLDER`. Writes FOLDER/000000.bin, ... with the sweeps
 * (float32 x y z [m] in the LiDAR's frame, and time since the sweep's stamp [s], 0 where the log has none),
 * FOLDER/sweeps.tum with each one's stamp and T_body_lidar, and FOLDER/RECEIVER.tum with what each INS said. */
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <iostream>
#include <map>

#include "cli/app.h"
#include "core/errors.h"
#include "core/trajectory.h"
#include "sensors/rawlog.h"

namespace raceloc::bench {
namespace {

void writeSweep(const std::string& path, const Scan& scan) {
  std::vector<float> numbers;
  numbers.reserve(4 * scan.cloud.size());
  for (std::size_t i = 0; i < scan.cloud.size(); ++i)
    numbers.insert(numbers.end(), {scan.cloud.x[i], scan.cloud.y[i], scan.cloud.z[i],
                                   scan.time_s.empty() ? 0 : scan.time_s[i]});
  std::ofstream file(path, std::ios::binary);
  file.write(reinterpret_cast<const char*>(numbers.data()),
             static_cast<std::streamsize>(numbers.size() * sizeof(float)));
  if (!file.flush()) throw InputError("cannot write " + path);
}

void run(const std::string& log, const std::string& folder) {
  std::filesystem::create_directories(folder);
  LogReader reader(log, {});
  Trajectory sweeps;
  std::map<std::string, Trajectory> receivers;
  while (auto sample = reader.next()) {
    if (const auto* scan = std::get_if<Scan>(&*sample)) {
      char name[16];
      std::snprintf(name, sizeof name, "/%06zu.bin", sweeps.poses.size());
      writeSweep(folder + name, *scan);
      sweeps.poses.push_back({scan->stamp_s, scan->T_body_lidar});
    } else if (const auto* ins = std::get_if<InsPose>(&*sample)) {
      receivers[ins->label].poses.push_back({ins->stamp_s, ins->T_map_body});
    }
  }
  if (!sweeps.poses.empty()) writeTum(folder + "/sweeps.tum", sweeps);
  for (const auto& [label, trajectory] : receivers) writeTum(folder + "/" + label + ".tum", trajectory);
  std::cout << sweeps.poses.size() << " sweeps, " << receivers.size() << " receivers\n";
}

}  // namespace
}  // namespace raceloc::bench

int main(int argc, char** argv) {
  return raceloc::runApp("export_log", [&] {
    if (argc != 3) throw raceloc::InputError("usage: export_log LOG.rawlog FOLDER");
    raceloc::bench::run(argv[1], argv[2]);
  });
}
