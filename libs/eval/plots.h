/** \file
 * Pictures of an evaluation as SVG, drawn by the program gnuplot: no display, the same bytes for the same
 * input. A curve keeps a few thousand points at most, its extremes among them. All throw InputError if
 * gnuplot is not installed. */
#pragma once

#include <string>
#include <utility>
#include <vector>

#include "eval/trajectory_errors.h"

namespace raceloc {

/** Seen from above, equal axes: the whole truth, and the matched estimate coloured by its error in the plane.
 */
[[nodiscard]] std::string trajectoryPicture(const Evaluation& evaluation);

/** Lateral, longitudinal, height and heading error over time; a line breaks where poses are unmatched. */
[[nodiscard]] std::string errorPicture(const Evaluation& evaluation);

/** Share of the poses whose error is below x, for each direction of the error. */
[[nodiscard]] std::string distributionPicture(const Evaluation& evaluation);

/** Values over time. */
struct TimeCurve {
  std::string name;                    ///< in the key; curves of one name have one colour in all panels
  std::vector<double> time_s, values;  ///< as many; a line breaks where a value is not finite
};
/** Curves over one axis of values. */
struct TimePanel {
  std::string label;  ///< with the unit
  std::vector<TimeCurve> curves;
  std::vector<std::pair<double, std::string>> levels;  ///< lines across, with what they mean
};
/** A time that is shaded in all panels. */
struct TimeSpan {
  double from_s, to_s;
  std::string name;  ///< spans of one name have one shade
};

/** Panels one above the other over one time axis. \param panels  at least one, with four names of curves at most
 * \param spans   with four names at most; later ones lie on earlier ones */
[[nodiscard]] std::string timePicture(const std::vector<TimePanel>& panels,
                                      const std::vector<TimeSpan>& spans);

}  // namespace raceloc
