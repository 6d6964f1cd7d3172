#pragma once

#include <algorithm>
#include <cstddef>
#include <vector>

namespace raceloc {

/** The value that `share` (0..1) of the values do not exceed; 0 for no values. Takes the values to sort them.
 */
[[nodiscard]] inline double quantile(std::vector<double> values, double share) {
  if (values.empty()) return 0;
  const auto k = static_cast<std::ptrdiff_t>(share * static_cast<double>(values.size() - 1));
  std::nth_element(values.begin(), values.begin() + k, values.end());
  return values[static_cast<std::size_t>(k)];
}

}  // namespace raceloc
