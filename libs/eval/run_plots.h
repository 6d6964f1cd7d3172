/** \file
 * Pictures of what a localizer says of its own run. */
#pragma once

#include <vector>

#include "eval/picture.h"
#include "eval/run_tables.h"

namespace raceloc {

/** Protection level over error, lateral and longitudinal, a picture each: below the diagonal the estimate misleads. */
[[nodiscard]] std::vector<Picture> stanfordPictures(const Stanford& stanford);

/** Length of the innovation over time, accepted and rejected, a picture a source.
 * \param first_s  where time begins \param lines  at least one */
[[nodiscard]] std::vector<Picture> decisionPictures(const std::vector<DecisionLine>& lines, double first_s);

/** How often a sweep took how long. \param lines  at least one */
[[nodiscard]] Picture latencyPicture(const std::vector<LatencyLine>& lines);

}  // namespace raceloc
