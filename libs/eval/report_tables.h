/** \file
 * The figures of an evaluation as tables: one body for the terminal and the page. */
#pragma once

#include <string>
#include <utility>
#include <vector>

#include "eval/run_tables.h"
#include "eval/table.h"
#include "eval/trajectory_errors.h"

namespace raceloc {

/** A direction of the error. */
struct ErrorRow {
  const char* name;  ///< with its unit
  const char* key;
  Statistics Evaluation::*figures;
};
constexpr ErrorRow kErrorRows[] = {{"position 3-D [m]", "position_3d_m", &Evaluation::position_3d_m},
                                   {"position plane [m]", "position_plane_m", &Evaluation::position_plane_m},
                                   {"lateral [m]", "lateral_m", &Evaluation::lateral_m},
                                   {"longitudinal [m]", "longitudinal_m", &Evaluation::longitudinal_m},
                                   {"height [m]", "height_m", &Evaluation::height_m},
                                   {"heading [deg]", "heading_deg", &Evaluation::heading_deg}};
constexpr char kErrorSigns[] =
    "positive: left, ahead, up, counter-clockwise; mean and median keep the sign, max does not";

/** Inputs, matching, path and alignment: a name and a sentence each. */
[[nodiscard]] std::vector<std::pair<std::string, std::string>> summaryOf(const Evaluation& evaluation);

/** Errors, relative errors, errors by lap, sector and speed. */
[[nodiscard]] std::vector<Table> tablesOf(const Evaluation& evaluation);

/** Integrity, gate and latency, as far as they are given. */
[[nodiscard]] std::vector<Table> tablesOf(const RunTables& run);

}  // namespace raceloc
