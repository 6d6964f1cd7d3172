/** \file
 * Pictures of an evaluation. A curve keeps a few thousand points at most, its extremes among them. */
#pragma once

#include <vector>

#include "eval/picture.h"
#include "eval/trajectory_errors.h"

namespace raceloc {

/** Seen from above, equal axes: the whole truth, and the matched estimate coloured by its error in the plane.
 */
[[nodiscard]] Picture trajectoryPicture(const Evaluation& evaluation);

/** Lateral, longitudinal, height and heading error over time, a picture each; a line breaks where poses are unmatched. */
[[nodiscard]] std::vector<Picture> errorPictures(const Evaluation& evaluation);

/** Share of the poses whose error is below x, for each direction of the error. */
[[nodiscard]] Picture distributionPicture(const Evaluation& evaluation);

/** Error in the plane by the place on the lap, lap by lap, above the speed there. */
[[nodiscard]] Picture stationPicture(const Evaluation& evaluation);

/** Lateral and longitudinal rmse of each bin of speed. */
[[nodiscard]] Picture speedPicture(const Evaluation& evaluation);

/** How hard the car was driven: the truth's acceleration along and across, smoothed. */
[[nodiscard]] Picture ggPicture(const Evaluation& evaluation);

}  // namespace raceloc
