#include "sensors/foreign_logs.h"

#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <fstream>

#include "core/errors.h"
#include "sensors/text_input.h"

namespace raceloc {

std::string toText(const ImportSummary& summary) {
  std::string text = toText(summary.devices);
  char line[200];
  if (summary.origin) {
    std::snprintf(line, sizeof line, "  map origin  %.9f deg, %.9f deg, %.3f m\n",
                  summary.origin->latitude_deg, summary.origin->longitude_deg, summary.origin->height_m);
    text += line;
  }
  if (summary.truth && !summary.truth->poses.empty()) {
    double length_m = 0;
    const auto& poses = summary.truth->poses;
    for (std::size_t i = 1; i < poses.size(); ++i)
      length_m += (poses[i].T_map_body.translation() - poses[i - 1].T_map_body.translation()).norm();
    std::snprintf(line, sizeof line, "  truth       %zu poses, %.1f m\n", poses.size(), length_m);
    text += line;
  }
  for (const auto& note : summary.notes) text += "  note        " + note + "\n";
  return text;
}

Decimation parseDecimation(const std::string& text) {
  if (text == "even") return {2, 0};
  if (text == "odd") return {2, 1};
  const auto n = parseNumber(text);
  if (!n || *n < 1 || *n > 1e6 || *n != static_cast<double>(static_cast<std::size_t>(*n)))
    throw InputError("--decimate " + text + ": must be even, odd, or a whole number >= 1");
  return {static_cast<std::size_t>(*n), 0};
}

void ImportLog::write(const Sample& sample) {
  x_writer.write(sample);
  x_tally.add(sample);
}

std::vector<DeviceSummary> ImportLog::commit() {
  x_writer.commit();
  return x_tally.devices();
}

void requireFolder(const std::string& what, const std::string& folder) {
  std::error_code ignored;
  if (!std::filesystem::is_directory(folder, ignored))
    throw InputError(what + " " + folder + ": no such folder; check the path");
}

std::vector<std::string> filesIn(const std::string& what, const std::string& folder,
                                 const std::string& extension) {
  std::error_code error;
  std::vector<std::string> files;
  for (const auto& entry : std::filesystem::directory_iterator(folder, error))
    if (entry.path().extension() == extension) files.push_back(entry.path().string());
  if (error) throw InputError(what + " " + folder + ": the folder cannot be read; check the path");
  if (files.empty()) throw InputError(what + " " + folder + ": no *" + extension + " file in this folder");
  std::sort(files.begin(), files.end());
  return files;
}

Cloud readVelodyneBin(const std::string& path) {
  std::ifstream in(path, std::ios::binary | std::ios::ate);
  const auto bytes = in ? static_cast<std::size_t>(in.tellg()) : 0;
  if (in && (bytes == 0 || bytes % 16 != 0))
    throw InputError("scan " + path + ": " + std::to_string(bytes) +
                     " bytes, but float32 x y z intensity need a multiple of 16; is it truncated?");
  std::vector<float> values(bytes / sizeof(float));
  in.seekg(0);
  in.read(reinterpret_cast<char*>(values.data()), static_cast<std::streamsize>(bytes));
  if (!in) throw InputError("scan " + path + ": cannot be read to its end; check the disk");
  Cloud cloud;
  cloud.reserve(values.size() / 4);
  for (std::size_t i = 0; i < values.size(); i += 4) {
    const Eigen::Vector3f p(values[i], values[i + 1], values[i + 2]);
    if (p.allFinite()) cloud.push(p, values[i + 3]);
  }
  return cloud;
}

}  // namespace raceloc
