/** \file
 * The command line of raceloc-eval. */
#pragma once

#include <optional>
#include <string>

#include "eval/trajectory_errors.h"

namespace raceloc {

struct EvalArgs {
  std::string truth_path, estimate_path;
  std::string report_path, picture_path, csv_path, json_path;  ///< empty: not wanted
  EvalOptions options;
  std::string command;  ///< as typed but without the program's folder, for the report
};

/** Empty after `--help` or `--version`. \throws InputError for arguments that do not fit. */
[[nodiscard]] std::optional<EvalArgs> parseEvalArgs(int argc, char** argv);

}  // namespace raceloc
