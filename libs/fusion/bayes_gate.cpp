#include "fusion/bayes_gate.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <iterator>
#include <numeric>
#include <stdexcept>

#include "core/labels.h"
#include "core/types.h"
#include "fusion/chi_square.h"
#include "fusion/measurement.h"

namespace raceloc {

namespace {

using Order = std::vector<std::size_t>;  // indices of fixes

/** How far a fix is, and how far it may be. */
struct Distance {
  double delta, epsilon, limit;
};

/** A heading of one kind, or none. */
struct Heading {
  HeadingKind kind;
  double angle_rad, sigma_rad;
};

constexpr double kShortestResultant = 0.5;  // below it, a mean of headings is nobody's heading

/** All fixes by name: sums then run in one order, whatever the order of arrival. */
Order byName(const std::vector<PoseFix>& fixes) {
  Order order(fixes.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::sort(order.begin(), order.end(), [&](auto a, auto b) { return fixes[a].source < fixes[b].source; });
  for (std::size_t i = 1; i < order.size(); ++i)
    if (fixes[order[i]].source == fixes[order[i - 1]].source)
      throw std::invalid_argument("gate: two fixes of " + fixes[order[i]].source);
  return order;
}

Distance distance(const CarState& predicted, const PoseFix& fix, const GateOptions& options) {
  if (options.metric == GateMetric::metric) {
    const Eigen::Vector2d d = (readingOf(fix) - predictedReading(fix, predicted.mean)).head<2>();
    const double s = std::pow(fix.cov_p_m2.determinant(), 0.25);
    return {s * fix.cov_p_m2.llt().matrixL().solve(d).norm(), options.epsilon_m, options.delta_m};
  }
  const auto H = observationMatrix(fix, predicted.mean(2));
  const Eigen::Matrix3d S = H * predicted.covariance * H.transpose() + noiseOf(fix);
  const Eigen::Vector3d nu = innovation(readingOf(fix), predictedReading(fix, predicted.mean));
  const int measured = fix.heading == HeadingKind::none ? 2 : 3;
  return {S.llt().matrixL().solve(nu).squaredNorm(), chiSquareLimit(options.epsilon_false_alarm, measured),
          chiSquareLimit(options.delta_false_alarm, measured)};
}

/** The surest of `candidates` (by name, at least one) that the first matching pattern names. */
std::size_t primaryOf(const std::vector<PoseFix>& fixes, const Order& candidates,
                      const std::string& patterns) {
  const auto surest = [&](const Order& among) {
    return *std::min_element(among.begin(), among.end(), [&](auto a, auto b) {
      return fixes[a].cov_p_m2.determinant() < fixes[b].cov_p_m2.determinant();
    });
  };
  const char* const separators = " \t,";
  for (std::size_t begin = patterns.find_first_not_of(separators); begin != std::string::npos;) {
    const std::size_t end = patterns.find_first_of(separators, begin);
    const std::string pattern = patterns.substr(begin, end - begin);
    Order named;
    std::copy_if(candidates.begin(), candidates.end(), std::back_inserter(named),
                 [&](auto k) { return matchesLabel(pattern, fixes[k].source); });
    if (!named.empty()) return surest(named);
    begin = patterns.find_first_not_of(separators, end);
  }
  return surest(candidates);
}

/** The heading of `fix` as one of the body. */
Heading bodyHeading(const PoseFix& fix, const CarState& predicted) {
  if (fix.heading != HeadingKind::course) return {fix.heading, fix.heading_rad, fix.heading_sigma_rad};
  return {HeadingKind::body, fix.heading_rad - predicted.mean(3),
          std::hypot(fix.heading_sigma_rad, std::sqrt(std::max(0.0, predicted.covariance(3, 3))))};
}

Heading blendHeadings(const CarState& predicted, const std::vector<PoseFix>& fixes, const Order& used,
                      const std::vector<double>& weights) {
  const auto any = [&](HeadingKind kind) {
    return std::any_of(used.begin(), used.end(), [&](auto k) { return fixes[k].heading == kind; });
  };
  const bool mixed = any(HeadingKind::body) && any(HeadingKind::course);

  double weight_sum = 0, variance_rad2 = 0;
  Eigen::Vector2d resultant = Eigen::Vector2d::Zero();
  for (std::size_t i = 0; i < used.size(); ++i) {
    const PoseFix& fix = fixes[used[i]];
    if (fix.heading == HeadingKind::none) continue;
    const Heading heading =
        mixed ? bodyHeading(fix, predicted) : Heading{fix.heading, fix.heading_rad, fix.heading_sigma_rad};
    weight_sum += weights[i];
    resultant += weights[i] * Eigen::Vector2d(std::cos(heading.angle_rad), std::sin(heading.angle_rad));
    variance_rad2 += std::pow(weights[i] * heading.sigma_rad, 2);
  }
  if (weight_sum == 0 || resultant.norm() < kShortestResultant * weight_sum) return {HeadingKind::none, 0, 0};
  return {any(HeadingKind::body) ? HeadingKind::body : HeadingKind::course,
          std::atan2(resultant.y(), resultant.x()), std::sqrt(variance_rad2) / weight_sum};
}

/** Rule 2 on the fixes `used`. */
PoseFix blend(const CarState& predicted, const std::vector<PoseFix>& fixes, const Order& used,
              const std::vector<double>& weights) {
  if (used.size() == 1) return fixes[used.front()];
  PoseFix sum{"", Eigen::Vector2d::Zero(), Eigen::Matrix2d::Zero()};
  for (std::size_t i = 0; i < used.size(); ++i) {
    const PoseFix& fix = fixes[used[i]];
    sum.source += (i == 0 ? "" : "+") + fix.source;
    sum.p_map_m += weights[i] * fix.p_map_m;
    sum.p_body_m += weights[i] * fix.p_body_m;
    sum.cov_p_m2 += weights[i] * weights[i] * fix.cov_p_m2;
  }
  const Heading heading = blendHeadings(predicted, fixes, used, weights);
  sum.heading = heading.kind;
  sum.heading_rad = heading.angle_rad;
  sum.heading_sigma_rad = heading.sigma_rad;
  return sum;
}

}  // namespace

void GateOptions::describe(OptionList& keys) {
  keys.add("metric", metric, {{"metric", GateMetric::metric}, {"chi2", GateMetric::chi2}},
           "distance of a source: metres weighted by its covariance, or normalised innovation squared");
  keys.add("epsilon_m", epsilon_m, atLeast(0),
           "metric: up to here a source is as good as the prediction [m]");
  keys.add("delta_m", delta_m, above(0), "metric: beyond this a source is rejected [m]");
  keys.add("epsilon_false_alarm", epsilon_false_alarm, between(1e-9, 1),
           "chi2: share of sound measurements beyond epsilon");
  keys.add("delta_false_alarm", delta_false_alarm, between(1e-9, 1),
           "chi2: share of sound measurements rejected");
  keys.add("primary_order", primary_order,
           "labels or patterns of sources, the ones to prefer first; of several the surest");
  keys.atMost("epsilon_m", epsilon_m, "delta_m", delta_m);
  keys.atMost("delta_false_alarm", delta_false_alarm, "epsilon_false_alarm", epsilon_false_alarm);
}

std::vector<double> blendWeights(const std::vector<double>& deltas) {
  const auto K = static_cast<double>(deltas.size());
  const double sum = std::accumulate(deltas.begin(), deltas.end(), 0.0);
  std::vector<double> weights(deltas.size(), 1 / K);
  if (deltas.size() == 1 || sum == 0) return weights;
  std::transform(deltas.begin(), deltas.end(), weights.begin(),
                 [&](double delta) { return (1 - delta / sum) / (K - 1); });
  return weights;
}

double conditionalProbability(double delta) {
  const double e = std::exp(-delta);
  return e / (1 + e);  // the same as in the contract, without its cancellation at large delta
}

GateResult gate(const CarState& predicted, const std::vector<PoseFix>& fixes, const GateOptions& options) {
  if (fixes.empty()) throw std::invalid_argument("gate: no fix to decide on");
  for (const auto& fix : fixes)
    if (const char* defect = defectOf(fix))
      throw std::invalid_argument("gate: fix of " + fix.source + ": " + defect);

  GateResult result;
  Order used;
  bool all_within_epsilon = true;
  result.decision.sources.resize(fixes.size());
  for (const auto k : byName(fixes)) {
    const auto [delta, epsilon, limit] = distance(predicted, fixes[k], options);
    const bool accepted = delta <= limit;
    result.decision.sources[k] = {fixes[k].source, delta, limit, conditionalProbability(delta), 0, accepted};
    if (!accepted) continue;
    used.push_back(k);
    all_within_epsilon = all_within_epsilon && delta <= epsilon;
  }

  auto& sources = result.decision.sources;
  result.decision.alarm = used.empty();
  if (used.empty()) {
    result.decision.rule = GateRule::rejected_all;
    return result;
  }
  if (all_within_epsilon) {
    const std::size_t primary = primaryOf(fixes, used, options.primary_order);
    sources[primary].weight = 1;
    result.fused = fixes[primary];
  } else {
    std::vector<double> deltas;
    deltas.reserve(used.size());
    for (const auto k : used) deltas.push_back(sources[k].delta);
    const std::vector<double> weights = blendWeights(deltas);
    for (std::size_t i = 0; i < used.size(); ++i) sources[used[i]].weight = weights[i];
    result.fused = blend(predicted, fixes, used, weights);
  }
  const bool some_rejected = used.size() < fixes.size();
  result.decision.rule = some_rejected        ? GateRule::rejected_some
                         : all_within_epsilon ? GateRule::primary
                                              : GateRule::weighted;
  return result;
}

}  // namespace raceloc
