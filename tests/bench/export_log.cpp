/** \file
 * What programs that read no rawlog need of one. `export_log sweeps LOG.rawlog FOLDER` writes FOLDER/000000.bin, ...
 * (float32 x y z [m] in the LiDAR's frame, and time since the sweep's stamp [s], 0 where the log has none) and
 * FOLDER/sweeps.tum with each one's stamp and T_body_lidar; `export_log receivers LOG.rawlog FOLDER` writes
 * FOLDER/RECEIVER.tum with what each INS said. */
#include <cstdio>
#include <filesystem>
#include <fstream>
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

void writeSweeps(const std::string& log, const std::string& folder) {
  LogReader reader(log, {});
  Trajectory mounted;
  while (auto sample = reader.next()) {
    const auto* scan = std::get_if<Scan>(&*sample);
    if (scan == nullptr) continue;
    char name[16];
    std::snprintf(name, sizeof name, "/%06zu.bin", mounted.poses.size());
    writeSweep(folder + name, *scan);
    mounted.poses.push_back({scan->stamp_s, scan->T_body_lidar});
  }
  writeTum(folder + "/sweeps.tum", mounted);
}

void writeReceivers(const std::string& log, const std::string& folder) {
  LogOptions options;
  options.lidar_labels.clear();
  LogReader reader(log, options);
  std::map<std::string, Trajectory> receivers;
  while (auto sample = reader.next())
    if (const auto* ins = std::get_if<InsPose>(&*sample))
      receivers[ins->label].poses.push_back({ins->stamp_s, ins->T_map_body});
  for (const auto& [label, trajectory] : receivers) writeTum(folder + "/" + label + ".tum", trajectory);
}

}  // namespace
}  // namespace raceloc::bench

int main(int argc, char** argv) {
  return raceloc::runApp("export_log", [&] {
    const std::string what = argc == 4 ? argv[1] : "";
    if (what != "sweeps" && what != "receivers")
      throw raceloc::InputError("usage: export_log sweeps|receivers LOG.rawlog FOLDER");
    std::filesystem::create_directories(argv[3]);
    (what == "sweeps" ? raceloc::bench::writeSweeps : raceloc::bench::writeReceivers)(argv[2], argv[3]);
  });
}
