#include "eval/cell_counts.h"

#include <cmath>

#include "eval/format.h"
#include "eval/picture.h"

namespace raceloc {

long CellCounts::cellOf(double value) const {
  return std::lround(std::floor((x_axes == Axes::linear ? value : std::log10(value)) / x_cell));
}

double CellCounts::edge(double cell) const {
  return x_axes == Axes::linear ? cell * x_cell : std::pow(10.0, cell * x_cell);
}

void CellCounts::add(double x, double y) { ++x_counts[{cellOf(x), cellOf(y)}]; }

std::string CellCounts::block(const std::string& name) const {
  std::string text = "$" + name + " << EOD\n";
  for (const auto& [cell, count] : x_counts) {
    const auto column = static_cast<double>(cell.first), row = static_cast<double>(cell.second);
    for (const double value :
         {edge(column + 0.5), edge(row + 0.5), edge(column), edge(column + 1), edge(row), edge(row + 1)})
      text += number(value) + " ";
    text += std::to_string(count) + "\n";
  }
  return text + "EOD\n";
}

std::string CellCounts::plot(const std::string& name) {
  return "$" + name + " using 1:2:3:4:5:6:7 with boxxyerror fc palette fs solid noborder notitle";
}

std::string countScale(const std::string& label) {
  return std::string("set logscale cb\nset format cb '%.0f'\nset palette defined (0 '#BBD7EA', 0.5 '") +
         kBlue + "', 1 '#00263B')\nset cbrange [1:*]\nset cblabel '" + label + "'\n";
}

}  // namespace raceloc
