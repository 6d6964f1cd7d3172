/** \file
 * Faults into a log that was recorded. */
#pragma once

#include <cstdint>
#include <string>

namespace raceloc {

struct InjectArgs {
  std::string faults_path, input_path, output_path;
  std::uint64_t seed;
  int gzip_level;
};

/** Copies the log with the faults in it, and prints what came of it.
 * \throws InputError for an input or output that is missing or wrong; the output then does not have its name */
void inject(const InjectArgs& args);

}  // namespace raceloc
