/** \file
 * The command line of raceloc-sim. */
#pragma once

#include <optional>
#include <string>
#include <variant>

#include "sim/race.h"

namespace raceloc {

/** A race to simulate. */
struct SimulateArgs {
  std::string track_path, car_path, faults_path, log_path, preview_path;  ///< empty: not given
  RaceOptions race;
  std::optional<double> top_speed_mps;
  int gzip_level;
  int threads;  ///< 0: all
};

/** Faults to put into a log. */
struct InjectArgs {
  std::string faults_path, input_path, output_path;
  std::uint64_t seed;
  int gzip_level;
};

struct PrintFaults {};  ///< every kind with its keys

using SimArgs = std::variant<SimulateArgs, InjectArgs, PrintFaults>;

/** Empty after `--help` or `--version`. \throws InputError for arguments that do not fit. */
[[nodiscard]] std::optional<SimArgs> parseSimArgs(int argc, char** argv);

/** Does what was asked, and prints what came of it. */
void runSim(const SimArgs& args);

}  // namespace raceloc
