/** \file
 * Track, car and seed in; a rawlog with truth and faults out. */
#include "cli/app.h"
#include "cli/sim_args.h"

int main(int argc, char** argv) {
  return raceloc::runApp("raceloc-sim", [&] {
    if (const auto args = raceloc::parseSimArgs(argc, argv)) raceloc::runSim(*args);
  });
}
