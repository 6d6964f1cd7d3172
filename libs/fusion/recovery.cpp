#include "fusion/recovery.h"

#include <Eigen/LU>
#include <cmath>
#include <limits>

#include "core/types.h"

namespace raceloc {

void RecoveryOptions::describe(OptionList& keys) {
  keys.add("agree_s", agree_s, atLeast(0),
           "two sources must agree with each other for this long before a reset [s]");
  keys.add(
      "leap_s", leap_s, atLeast(0),
      "the same where both had gone away from the estimate in one leap: receivers of one faulty correction "
      "service do, cars do not [s]");
  keys.add("alone_s", alone_s, atLeast(0),
           "when no source has confirmed the estimate for this long, it is dead reckoning; before, there is "
           "no reset [s]");
  keys.add("drift_share", drift_share, between(0, 1),
           "share of the way since a source last confirmed the estimate, by which dead reckoning may be off: "
           "widens "
           "the protection levels; until a source confirms again, fixes farther off are not heard");
  keys.atMost("agree_s", agree_s, "leap_s", leap_s);
}

std::optional<TwoKeys> twoKeys(const std::vector<SourceRecord>& records, double stamp_s,
                               const ReliabilityOptions& options) {
  const auto fresh = [&](const SourceRecord& record) { return stamp_s - record.stamp_s <= options.fresh_s; };
  std::optional<TwoKeys> best;
  double least = std::numeric_limits<double>::infinity();
  for (std::size_t i = 0; i < records.size(); ++i) {
    if (!fresh(records[i])) continue;
    for (std::size_t j = i + 1; j < records.size(); ++j) {
      if (!fresh(records[j])) continue;
      const double apart = separation(residualAt(records[i], stamp_s) - residualAt(records[j], stamp_s),
                                      records[i].cov_m2 + records[j].cov_m2, options);
      if (apart > options.separation_sigmas || apart >= least) continue;
      least = apart;
      best = TwoKeys{i, j};
    }
  }
  return best;
}

CarState stateOf(const CarState& predicted, double stamp_s, const SourceRecord& first,
                 const SourceRecord& second, double bias_sigma_rad) {
  const Eigen::Matrix2d W1 = first.cov_m2.inverse(), W2 = second.cov_m2.inverse();
  CarState state = predicted;
  state.mean.head<2>() +=
      (W1 + W2).inverse() * (W1 * residualAt(first, stamp_s) + W2 * residualAt(second, stamp_s));
  double turn_rad = 0, weight = 0, sigma_rad = std::sqrt(predicted.covariance(2, 2));
  for (const SourceRecord* record : {&first, &second}) {
    if (!record->heading_rad) continue;
    const double w = 1 / (*record->heading_sigma_rad * *record->heading_sigma_rad);
    turn_rad += w * *record->heading_rad;
    weight += w;
  }
  if (weight > 0) {
    state.mean(2) = wrapAngle(state.mean(2) + turn_rad / weight);
    sigma_rad = std::sqrt(2 / weight);
  }
  state.mean(3) = 0;
  state.covariance.setZero();
  state.covariance.topLeftCorner<2, 2>() = 2 * (W1 + W2).inverse();
  state.covariance(2, 2) = sigma_rad * sigma_rad;
  state.covariance(3, 3) = bias_sigma_rad * bias_sigma_rad;
  return state;
}

}  // namespace raceloc
