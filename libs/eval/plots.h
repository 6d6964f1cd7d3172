/** \file
 * Pictures of an evaluation as SVG, drawn by the program gnuplot: no display, the same bytes for the same
 * input. A curve keeps a few thousand points at most, its extremes among them. All throw InputError if
 * gnuplot is not installed. */
#pragma once

#include <string>

#include "eval/trajectory_errors.h"

namespace raceloc {

/** Seen from above, equal axes: the whole truth, and the matched estimate coloured by its error in the plane.
 */
[[nodiscard]] std::string trajectoryPicture(const Evaluation& evaluation);

/** Lateral, longitudinal, height and heading error over time; a line breaks where poses are unmatched. */
[[nodiscard]] std::string errorPicture(const Evaluation& evaluation);

/** Share of the poses whose error is below x, for each direction of the error. */
[[nodiscard]] std::string distributionPicture(const Evaluation& evaluation);

}  // namespace raceloc
