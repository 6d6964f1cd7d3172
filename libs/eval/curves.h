/** \file
 * Curves of no more points than a picture can show. */
#pragma once

#include <cstddef>
#include <vector>

#include "eval/pose_errors.h"

namespace raceloc {

constexpr std::size_t kBins = 1000;  ///< of a curve: more than a picture has columns

/** Which samples a curve needs: the lowest and the highest of each bin, and both ends. \param y  at least one */
[[nodiscard]] std::vector<std::size_t> extremes(const std::vector<double>& y, std::size_t most_bins = kBins);

/** Every n-th index, so that some 2000 remain, and the last. \param size  at least one */
[[nodiscard]] std::vector<std::size_t> thinned(std::size_t size);

/** Numbers the stretches that a line may connect: a new one starts at each index that `breaks`. */
template <class Breaks>
std::vector<int> stretches(std::size_t size, Breaks breaks) {
  std::vector<int> stretch(size, 0);
  for (std::size_t i = 1; i < size; ++i) stretch[i] = stretch[i - 1] + (breaks(i) ? 1 : 0);
  return stretch;
}

/** The estimate breaks where poses are unmatched, or missing for three times their usual interval. */
[[nodiscard]] std::vector<int> stretchesOf(const std::vector<PoseError>& poses);

}  // namespace raceloc
