/** \file
 * raceloc-eval compare: two runs beside each other. */
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "eval/compare.h"

namespace raceloc {

struct CompareArgs {
  std::string a_path, b_path;          ///< files of raceloc-eval --csv, or folders of them
  std::string report_path, json_path;  ///< empty: not wanted
  CompareOptions options;
  std::string command;  ///< for the report
};

/** \param words  all of the command line: the program, "compare", the rest
 * \return empty after `--help` \throws InputError for arguments that do not fit. */
[[nodiscard]] std::optional<CompareArgs> parseCompareArgs(const std::vector<std::string>& words);

/** \return 0 \throws InputError for files that cannot be compared */
[[nodiscard]] int runCompare(const CompareArgs& args);

}  // namespace raceloc
