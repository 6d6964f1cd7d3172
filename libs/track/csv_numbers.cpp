#include "track/csv_numbers.h"

#include <charconv>
#include <cmath>

namespace raceloc {

std::vector<double> numbersIn(const std::string& line) {
  std::vector<double> numbers;
  const char* at = line.data();
  const char* const end = at + line.size();
  while (at < end) {
    while (at < end && (*at == ' ' || *at == '\t' || *at == ',' || *at == ';' || *at == '\r')) ++at;
    if (at == end) break;
    double number = 0;
    const auto [next, error] = std::from_chars(at, end, number);
    if (error != std::errc() || !std::isfinite(number)) return {};
    numbers.push_back(number);
    at = next;
  }
  return numbers;
}

}  // namespace raceloc
