/** \file
 * Clouds of any number of points as a picture of bounded size. */
#pragma once

#include <map>
#include <string>
#include <utility>

namespace raceloc {

/** How many points fall into each cell of a grid about the origin. */
class CellCounts {
 public:
  /** \param cell  edge, > 0 */
  explicit CellCounts(double cell) : x_cell(cell) {}
  void add(double x, double y);
  /** Lines `x y half_width half_height count` for gnuplot's `with boxxyerror`. */
  [[nodiscard]] std::string block(const std::string& name) const;
  /** What draws them: `$name using ...`, colour by count on the log scale that kCountScale sets. */
  [[nodiscard]] static std::string plot(const std::string& name);

 private:
  double x_cell;
  std::map<std::pair<long, long>, std::size_t> x_counts;  // ordered: the same bytes each time
};

/** gnuplot's colour scale of counts. */
[[nodiscard]] std::string countScale(const std::string& label);

}  // namespace raceloc
