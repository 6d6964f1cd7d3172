/** \file
 * Values over time that many share: panels, levels, spans. */
#pragma once

#include <string>
#include <utility>
#include <vector>

namespace raceloc {

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

/** Panels one above the other over one time axis, as SVG. \throws InputError if gnuplot is not installed. \param panels  at least one, with four names of curves at most
 * \param spans   with four names at most; later ones lie on earlier ones */
[[nodiscard]] std::string timePicture(const std::vector<TimePanel>& panels,
                                      const std::vector<TimeSpan>& spans);

}  // namespace raceloc
