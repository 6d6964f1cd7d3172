#pragma once

#include <algorithm>
#include <cstddef>
#include <vector>

namespace raceloc {

/** The value that `share` (0..1) of [first, last) do not exceed; 0 for no values. Puts them in another order. */
[[nodiscard]] inline double quantile(double* first, double* last, double share) {
  if (first == last) return 0;
  double* const kth = first + static_cast<std::ptrdiff_t>(share * static_cast<double>(last - first - 1));
  std::nth_element(first, kth, last);
  return *kth;
}

/** The same of values that are taken to be put in another order. */
[[nodiscard]] inline double quantile(std::vector<double> values, double share) {
  return quantile(values.data(), values.data() + values.size(), share);
}

}  // namespace raceloc
