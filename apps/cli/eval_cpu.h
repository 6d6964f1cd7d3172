/** \file
 * raceloc-eval cpu: what a command costs. */
#pragma once

#include <optional>
#include <string>
#include <vector>

namespace raceloc {

struct CpuArgs {
  std::vector<std::string> command;
  double period_s;
  std::optional<double> recorded_s;     ///< length of the log that the command plays
  std::string json_path, picture_path;  ///< empty: not wanted
};

/** \param words  all of the command line: the program, "cpu", options, "--", the command
 * \return empty after `--help` \throws InputError for arguments that do not fit. */
[[nodiscard]] std::optional<CpuArgs> parseCpuArgs(const std::vector<std::string>& words);

/** Runs the command and reports on stderr: stdout is the command's.
 * \return its exit status \throws InputError if it cannot be started, or a file cannot be written */
[[nodiscard]] int runCpu(const CpuArgs& args);

}  // namespace raceloc
