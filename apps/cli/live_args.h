#pragma once

#include <optional>
#include <string>

#include "pipeline/replay.h"

namespace raceloc {

/** Command line of raceloc-live. */
struct LiveArgs {
  std::string ini_path, map_path, rawlog_path, sensors_path, output_path, trajectory_path, integrity_path,
      decisions_path, latency_path, record_path, scene_path, race_line_path;
  std::optional<double> speed;  ///< of a log's time against ours; none: as fast as it goes
  std::optional<std::string> disable_labels;
  std::optional<double> disable_after_s;
  std::optional<std::string> map_hash;
  bool odometry_only, verbose, print_ini;
};

/** None after `--help` or `--version`. \throws InputError for arguments that do not fit. */
[[nodiscard]] std::optional<LiveArgs> parseLiveArgs(int argc, char** argv);

/** Everything that raceloc-live does. */
void runLive(const LiveArgs& args);

}  // namespace raceloc
