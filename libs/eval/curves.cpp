#include "eval/curves.h"

#include <algorithm>

namespace raceloc {

std::vector<std::size_t> extremes(const std::vector<double>& y, std::size_t most_bins) {
  std::vector<std::size_t> kept;
  const std::size_t bins = std::min(most_bins, y.size());
  for (std::size_t b = 0; b < bins; ++b) {
    const auto first = y.begin() + static_cast<std::ptrdiff_t>(b * y.size() / bins);
    const auto last = y.begin() + static_cast<std::ptrdiff_t>((b + 1) * y.size() / bins);
    const auto [low, high] = std::minmax_element(first, last);
    kept.push_back(static_cast<std::size_t>(low - y.begin()));
    kept.push_back(static_cast<std::size_t>(high - y.begin()));
  }
  kept.push_back(0);
  kept.push_back(y.size() - 1);
  std::sort(kept.begin(), kept.end());
  kept.erase(std::unique(kept.begin(), kept.end()), kept.end());
  return kept;
}

std::vector<std::size_t> thinned(std::size_t size) {
  std::vector<std::size_t> kept;
  const std::size_t step = size / (2 * kBins) + 1;
  for (std::size_t i = 0; i < size; i += step) kept.push_back(i);
  if (kept.back() != size - 1) kept.push_back(size - 1);
  return kept;
}

std::vector<int> stretchesOf(const std::vector<PoseError>& poses) {
  const auto interval_s = [&](std::size_t i) { return poses[i].stamp_s - poses[i - 1].stamp_s; };
  std::vector<double> intervals_s;
  for (std::size_t i = 1; i < poses.size(); ++i) intervals_s.push_back(interval_s(i));
  const double usual_s = intervals_s.empty() ? 0 : statisticsOf(intervals_s).median;
  return stretches(poses.size(), [&](std::size_t i) {
    return poses[i].estimate_index != poses[i - 1].estimate_index + 1 || interval_s(i) > 3 * usual_s;
  });
}

}  // namespace raceloc
