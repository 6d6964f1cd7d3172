#pragma once

#include <optional>
#include <string>

#include "pipeline/mapper.h"

namespace raceloc {

/** Command line of raceloc-map. */
struct MapArgs {
  std::string ini_path, rawlog_path, map_path, odometry_path, trajectory_path;
  bool verbose, print_ini;
};

/** None after `--help` or `--version`. \throws InputError for arguments that do not fit. */
[[nodiscard]] std::optional<MapArgs> parseMapArgs(int argc, char** argv);

/** Everything that raceloc-map does. */
void runMap(const MapArgs& args);

}  // namespace raceloc
