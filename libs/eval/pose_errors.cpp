#include "eval/pose_errors.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <stdexcept>

namespace raceloc {

Statistics statisticsOf(std::vector<double> values) {
  if (values.empty()) throw std::invalid_argument("statisticsOf: no values");
  const auto n = static_cast<double>(values.size());
  Statistics s{};
  s.mean = std::accumulate(values.begin(), values.end(), 0.0) / n;
  double squares = 0;
  double deviations = 0;
  for (const double v : values) {
    squares += v * v;
    deviations += (v - s.mean) * (v - s.mean);
    s.max = std::max(s.max, std::abs(v));
  }
  s.rmse = std::sqrt(squares / n);
  s.std = std::sqrt(deviations / n);
  std::sort(values.begin(), values.end());
  const std::size_t half = values.size() / 2;
  s.median = values.size() % 2 == 1 ? values[half] : 0.5 * (values[half - 1] + values[half]);
  return s;
}

}  // namespace raceloc
