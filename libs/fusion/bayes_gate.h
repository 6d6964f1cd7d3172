/** \file
 * Which sources to believe: Bayesian decision between them, eq_sigmoid_mahala to eq_conditional_measure. */
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "core/options.h"
#include "fusion/fusion_types.h"

namespace raceloc {

/** How far a source is from the prediction. */
enum class GateMetric {
  metric,  ///< Delta_k = sqrt(d' (Sigma_k / s_k^2)^-1 d), s_k^2 = sqrt(det Sigma_k), on the position d:
           ///< metres
  chi2,    ///< Delta_k = nu' (H P H' + R)^-1 nu on what the source measures: position, and heading if it has
           ///< one
};

/** Section [gate]. */
struct GateOptions {
  GateMetric metric = GateMetric::metric;
  double epsilon_m = 0.2;
  double delta_m = 5.0;
  double epsilon_false_alarm = 0.1;
  double delta_false_alarm = 0.001;
  std::string primary_order = "scan_match gps_*";
  void describe(OptionList& keys);
};

struct GateResult {
  GateDecision decision;
  std::optional<PoseFix> fused;  ///< what the filter is to be corrected with; none if all were rejected
};

/** Decides between K >= 1 sources; order of the fixes does not change one bit of the result.
 *
 * Rules, on Delta_k and the limits epsilon <= delta (of the metric, or quantiles by the number of values
 * measured):
 *  1. all Delta <= epsilon: the fix that `primary_order` names first, unchanged; of several under one pattern, or under none,
 *     the one with the smallest determinant of its claim, then the first by name;
 *  2. all Delta <= delta: sum of w_k y_k with blendWeights(), covariance sum of w_k^2 R_k. Headings are
 * averaged on the circle with the weights of those that have one, scaled to 1. If some measure the body and
 * some the course, courses become body headings by the predicted b, whose variance is added (its correlation
 * with theta is not known to the sum, so b learns nothing from it). Headings that contradict each other (mean
 *     resultant below one half, 120 degrees for two) are left out;
 *  3. some Delta > delta: these are rejected, rule 1 or 2 among the others;
 *  4. all Delta > delta: no correction, alarm.
 *
 * \param predicted  the filter's state at the time of the fixes
 * \throws std::invalid_argument for no fix, a label that comes twice, a field that is not finite, a
 * covariance that is not symmetric positive definite, or a heading without a positive sigma Source: Lee et
 * al., eq_sigmoid_mahala, eq_mahala, eq_conditional_measure. The paper's quadratic form is compared with
 * lengths and called a distance: hence the root and the scale. */
[[nodiscard]] GateResult gate(const CarState& predicted, const std::vector<PoseFix>& fixes,
                              const GateOptions& options);

/** Weights of rule 2: (1 - Delta_k / sum Delta) / (K - 1), which add up to 1 (the paper's lambda_k add up to
 * K - 1). One source weighs 1; sources at distance zero, all of them, weigh the same. \param deltas  K >= 1
 * values >= 0 */
[[nodiscard]] std::vector<double> blendWeights(const std::vector<double>& deltas);

/** p(Theta_k | x) = 1 - 1 / (1 + exp(-Delta_k)), for Delta_k >= 0: (0, 0.5]; 0 where that underflows. */
[[nodiscard]] double conditionalProbability(double delta);

}  // namespace raceloc
