#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
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

/** Quantiles of values that come one by one and are not kept: to 0.1 % between 1e-6 and 1e3, what is beyond counts as
 * the end that it is beyond; the largest as it is. Values are finite. */
class RunningQuantiles {
 public:
  void add(double value) {
    ++x_counts[static_cast<std::size_t>(std::log(std::clamp(value, kLeast, kMost) / kLeast) / kStep)];
    ++x_count;
    x_max = std::max(x_max, value);
  }
  /** The value that `share` (0..1) of those added do not exceed; 0 for no values. */
  [[nodiscard]] double at(double share) const {
    if (x_count == 0) return 0;
    auto below = static_cast<std::uint64_t>(share * static_cast<double>(x_count - 1));
    std::size_t bin = 0;
    while (below >= x_counts[bin]) below -= x_counts[bin++];
    return std::min(x_max, kLeast * std::exp((static_cast<double>(bin) + 0.5) * kStep));
  }
  [[nodiscard]] double max() const { return x_max; }  ///< 0 for no values

 private:
  static constexpr double kLeast = 1e-6, kMost = 1e3, kStep = 0.002;
  std::vector<std::uint64_t> x_counts =
      std::vector<std::uint64_t>(static_cast<std::size_t>(std::log(kMost / kLeast) / kStep) + 1);
  std::uint64_t x_count = 0;
  double x_max = 0;
};

}  // namespace raceloc
