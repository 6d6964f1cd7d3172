#pragma once

#include <optional>
#include <string>
#include <variant>
#include <vector>

#include "cli/map_tools.h"
#include "pipeline/mapper.h"

namespace raceloc {

/** Survey logs to a map. */
struct BuildArgs {
  std::string ini_path;
  std::vector<std::string> log_paths;
  std::string map_path, race_line_path, odometry_path, trajectory_path;
  bool resume, replace, keep, verbose, print_ini;
};

/** Command line of raceloc-map. */
using MapArgs = std::variant<BuildArgs, MapInfoArgs, MapExportArgs, MapCheckArgs>;

/** None after `--help` or `--version`. \throws InputError for arguments that do not fit. */
[[nodiscard]] std::optional<MapArgs> parseMapArgs(int argc, char** argv);

/** Everything that raceloc-map does. */
void runMap(const MapArgs& args);

}  // namespace raceloc
