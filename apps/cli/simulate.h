/** \file
 * A race to a rawlog, its truth and its manifest. */
#pragma once

#include <optional>
#include <string>

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

/** Writes the log, NAME_truth.tum and NAME_manifest.ini, and a picture when one is wanted; prints what came of it.
 * \throws InputError for an input or output that is missing or wrong; no file then has its final name */
void simulate(const SimulateArgs& args);

}  // namespace raceloc
