/** \file
 * The command line of raceloc-eval. */
#pragma once

#include <optional>
#include <string>
#include <variant>

#include "cli/eval_compare.h"
#include "cli/eval_cpu.h"
#include "eval/trajectory_errors.h"

namespace raceloc {

struct TrajectoryArgs {
  std::string truth_path, estimate_path;
  std::string integrity_path, decisions_path, latency_path;                     ///< empty: not given
  std::string report_path, picture_path, pictures_folder, csv_path, json_path;  ///< empty: not wanted
  EvalOptions options;
  std::string command;  ///< as typed but without the program's folder, for the report
};

using EvalArgs = std::variant<TrajectoryArgs, CompareArgs, CpuArgs>;

/** Empty after `--help` or `--version`. \throws InputError for arguments that do not fit. */
[[nodiscard]] std::optional<EvalArgs> parseEvalArgs(int argc, char** argv);

/** \return the exit status: that of the command for `cpu`, else 0 \throws InputError for bad input */
[[nodiscard]] int runEval(const EvalArgs& args);

}  // namespace raceloc
