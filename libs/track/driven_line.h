/** \file
 * The closed line that racetrack IDs are counted along: given as a file, or the first full lap of a drive. */
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "core/options.h"
#include "core/types.h"

namespace raceloc {

/** Points of a racing line, map frame [m], in the order of driving; the first one is not repeated at the end.
 *
 * The CSV has a line that names its columns (it may begin with `#`), x_m and y_m among them and perhaps z_m; without
 * it the first two columns are x_m and y_m. Commas, semicolons or blanks separate. Other lines with `#` are comments.
 * \throws InputError naming file and line for: an unreadable file, a line without its numbers, steps longer than
 * 50 m, fewer than 8 points, a line that does not close within 50 m. */
[[nodiscard]] std::vector<Eigen::Vector3d> readDrivenLine(const std::string& path);

/** How a lap is recognised. Section [first_lap]. */
struct FirstLapOptions {
  double step_m = 5;
  double close_m = 6;
  double max_turn_deg = 30;
  double confirm_m = 40;
  double min_lap_m = 250;
  void describe(OptionList& keys);
};

/** The first stretch of a drive that is a whole lap, as a closed line with points about step_m apart; none if no lap
 * closes.
 *
 * A lap ends where the car, after min_lap_m or more, is back within close_m (in space) of a place of the drive on the
 * same course, and stays with the earlier drive for another confirm_m (or until the poses end). So a crossing, an
 * overpass or a hairpin that only touches another straight closes nothing, what was driven before the car was on
 * the loop (pit, out-lap) is left out, and turning circles shorter than min_lap_m are no laps. Standing still adds no
 * points. The courses are those of the positions: the poses' own headings have no say. What is left of the gap across
 * the line is spread evenly over the lap.
 * \param T_map_body  in the order of driving, closer together than step_m, good to a metre or so from one to the next
 *                    and to close_m over a lap: from GNSS with odometry, not from degraded GNSS alone; those that are
 *                    not finite are passed over */
[[nodiscard]] std::optional<std::vector<Eigen::Vector3d>> firstFullLap(const std::vector<Pose>& T_map_body,
                                                                       const FirstLapOptions& options = {});

}  // namespace raceloc
