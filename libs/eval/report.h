/** \file
 * An evaluation in words: for the terminal, for a page, for a table, for a program. */
#pragma once

#include <string>
#include <vector>

#include "eval/picture.h"
#include "eval/run_tables.h"
#include "eval/trajectory_errors.h"

namespace raceloc {

/** What the terminal shows: inputs, matching, errors, drift, what the run says of itself, warnings. */
[[nodiscard]] std::string textReport(const Evaluation& evaluation, const RunTables& run);

/** All pictures that the inputs allow. */
[[nodiscard]] std::vector<Picture> picturesOf(const Evaluation& evaluation, const RunTables& run);

/** One page without links to anywhere: figures, pictures inlined, command.
 * \param command  how the page was made, as the user typed it
 * \throws InputError if gnuplot is not installed. */
[[nodiscard]] std::string htmlReport(const Evaluation& evaluation, const RunTables& run,
                                     const std::string& command);

/** One line a matched pose, under a header that names column and unit. */
[[nodiscard]] std::string errorsCsv(const Evaluation& evaluation);

/** The figures of the text report, keys with their units. */
[[nodiscard]] std::string figuresJson(const Evaluation& evaluation, const RunTables& run);

}  // namespace raceloc
