/** \file
 * The way back after the estimate was lost: two keys. */
#pragma once

#include <optional>
#include <vector>

#include "core/options.h"
#include "fusion/reliability.h"

namespace raceloc {

/** Section [recovery]. */
struct RecoveryOptions {
  double agree_s = 0.5;
  double leap_s = 10;
  double alone_s = 0.2;
  double drift_share = 0.01;
  void describe(OptionList& keys);
};

/** Two sources that agree with each other. */
struct TwoKeys {
  std::size_t first, second;  ///< numbers of records
};

/** The pair of fresh sources whose newest residuals, brought to one time, agree with each other best; none if no two
 * do. */
[[nodiscard]] std::optional<TwoKeys> twoKeys(const std::vector<SourceRecord>& records, double stamp_s,
                                             const ReliabilityOptions& options);

/** The state that two sources tell: position by their newest fixes, weighted by their claims, heading likewise, as far
 * as they have one; b = 0 with `bias_sigma_rad`. Covariances are those of the fixes, not divided by two: what made the
 * estimate wrong is not known. */
[[nodiscard]] CarState stateOf(const CarState& predicted, double stamp_s, const SourceRecord& first,
                               const SourceRecord& second, double bias_sigma_rad);

}  // namespace raceloc
