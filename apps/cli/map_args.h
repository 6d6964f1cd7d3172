#pragma once

#include <optional>
#include <string>
#include <variant>

#include "cli/map_tools.h"
#include "pipeline/mapper.h"

namespace raceloc {

/** A survey log to a map. */
struct BuildArgs {
  std::string ini_path, rawlog_path, map_path, odometry_path, trajectory_path;
  bool verbose, print_ini;
};

/** Command line of raceloc-map. */
using MapArgs = std::variant<BuildArgs, MapInfoArgs, MapExportArgs, MapCheckArgs>;

/** None after `--help` or `--version`. \throws InputError for arguments that do not fit. */
[[nodiscard]] std::optional<MapArgs> parseMapArgs(int argc, char** argv);

/** Everything that raceloc-map does. */
void runMap(const MapArgs& args);

}  // namespace raceloc
