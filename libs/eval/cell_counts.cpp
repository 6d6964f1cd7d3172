#include "eval/cell_counts.h"

#include <cmath>

#include "eval/picture.h"

namespace raceloc {

void CellCounts::add(double x, double y) {
  ++x_counts[{std::lround(std::floor(x / x_cell)), std::lround(std::floor(y / x_cell))}];
}

std::string CellCounts::block(const std::string& name) const {
  std::string text = "$" + name + " << EOD\n";
  const std::string half = number(x_cell / 2);
  for (const auto& [cell, count] : x_counts)
    text += number((static_cast<double>(cell.first) + 0.5) * x_cell) + " " +
            number((static_cast<double>(cell.second) + 0.5) * x_cell) + " " + half + " " + half + " " +
            std::to_string(count) + "\n";
  return text + "EOD\n";
}

std::string CellCounts::plot(const std::string& name) {
  return "$" + name + " using 1:2:3:4:5 with boxxyerror fc palette fs solid noborder notitle";
}

std::string countScale(const std::string& label) {
  return std::string("set logscale cb\nset format cb '%.0f'\nset palette defined (0 '#BBD7EA', 0.5 '") +
         kBlue + "', 1 '#00263B')\nset cbrange [1:*]\nset cblabel '" + label + "'\n";
}

}  // namespace raceloc
