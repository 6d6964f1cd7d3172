/** \file
 * Clouds of any number of points as a picture of bounded size. */
#pragma once

#include <map>
#include <string>
#include <utility>

namespace raceloc {

/** How many points fall into each cell of a grid. */
class CellCounts {
 public:
  enum class Axes { linear, logarithmic };
  /** \param cell  edge, > 0: in the unit of the points, or in decades */
  CellCounts(Axes axes, double cell) : x_axes(axes), x_cell(cell) {}
  void add(double x, double y);  ///< > 0 on logarithmic axes
  /** Lines `x y x_low x_high y_low y_high count` for gnuplot's `with boxxyerror`. */
  [[nodiscard]] std::string block(const std::string& name) const;
  /** What draws them, in colours of countScale(). */
  [[nodiscard]] static std::string plot(const std::string& name);

 private:
  [[nodiscard]] long cellOf(double value) const;
  [[nodiscard]] double edge(double cell) const;

  Axes x_axes;
  double x_cell;
  std::map<std::pair<long, long>, std::size_t> x_counts;  // ordered: the same bytes each time
};

/** gnuplot's colour scale of counts. */
[[nodiscard]] std::string countScale(const std::string& label);

}  // namespace raceloc
