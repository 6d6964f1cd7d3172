/** \file
 * The command line of raceloc-sim closed-loop. */
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

namespace raceloc {

/** What to drive into, and with what. */
struct ClosedLoopArgs {
  std::string track_path, car_path, faults_path, out_path;  ///< faults_path empty: every source drifts off
  double from_m, speed_mps, gap_m;
  double fail_for_s, drift_mps;
  std::optional<double> shift_m;  ///< of the line that is told: the second experiment
  std::string lidars;
  std::uint64_t seed;
};

/** \param words  the program's name, then what follows `closed-loop` \return empty after `--help`
 * \throws InputError for arguments that do not fit */
[[nodiscard]] std::optional<ClosedLoopArgs> parseClosedLoop(std::vector<std::string> words);

/** Drives with the guard and without it; writes a table of each and a picture of both, and prints what came of them. */
void runClosedLoop(const ClosedLoopArgs& args);

}  // namespace raceloc
