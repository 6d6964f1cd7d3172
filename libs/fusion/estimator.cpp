#include "fusion/estimator.h"

#include <algorithm>
#include <cmath>

#include "core/types.h"
#include "fusion/chi_square.h"

namespace raceloc {

namespace {

/** Where the record of a source is, or would be. */
template <class Records>
auto placeOf(Records& records, const std::string& source) {
  return std::lower_bound(records.begin(), records.end(), source,
                          [](const SourceRecord& r, const std::string& name) { return r.source < name; });
}

void enter(EstimatorState& state, const PoseFix& fix, const ReliabilityOptions& options) {
  const auto place = placeOf(state.records, fix.source);
  if (place == state.records.end() || place->source != fix.source)
    state.records.insert(place, firstRecord(state.stamp_s, state.car, fix));
  else
    record(*place, state.stamp_s, state.car, fix, options);
}

/** Dead reckoning and estimate move alike, but for the angle between their directions; the memory fades. */
void advance(MotionWitness& motion, const CarState& car, const Control& rates, double duration_s,
             const EstimatorOptions& options) {
  const double length_m = rates.speed_mps * duration_s;
  const double course_rad = car.mean(2) + car.mean(3) + rates.slip_rad;
  Eigen::Matrix3d F = Eigen::Matrix3d::Identity();
  F(0, 2) = -length_m * std::sin(course_rad);
  F(1, 2) = length_m * std::cos(course_rad);
  const double kept = std::exp(-duration_s / options.reliability.motion_memory_s);
  motion.offset = kept * (F * motion.offset);
  motion.covariance = kept * kept * F * motion.covariance * F.transpose();
  const double along_m2 =
      std::pow(std::max(options.fusion.speed_sigma_mps, rates.speed_sigma_mps), 2) * duration_s;
  const Eigen::Vector2d along(std::cos(course_rad), std::sin(course_rad));
  motion.covariance.topLeftCorner<2, 2>() += along_m2 * along * along.transpose();
  motion.covariance(2, 2) += std::pow(options.fusion.yaw_rate_sigma_rps, 2) * duration_s;
}

void confirm(EstimatorState& state) {
  state.confirmed_s = state.stamp_s;
  state.alone_m = 0;
  state.keys_since_s.reset();
}

}  // namespace

EstimatorState beginAt(double stamp_s, const CarState& car) {
  return {stamp_s, car, {}, {}, stamp_s, 0, 0, std::nullopt, std::nullopt};
}

Estimator::Estimator(const EstimatorOptions& options)
    : x_options(options),
      x_confirm_limit(chiSquareLimit(options.reliability.confirm_false_alarm, 2)),
      x_filter({Eigen::Vector4d::Zero(), Eigen::Matrix4d::Identity()}, options.fusion, options.gate) {
  requireConsistent("recovery", options.recovery);
}

void Estimator::advance(EstimatorState& state, const Control& rates, double to_s) {
  const double duration_s = to_s - state.stamp_s;
  if (!(duration_s > 0)) return;
  raceloc::advance(state.motion, state.car, rates, duration_s, x_options);
  x_filter.setState(state.car);
  x_filter.predict(duration_s, rates);
  state.car = x_filter.state();
  state.alone_m += std::abs(rates.speed_mps) * duration_s;
  state.stamp_s = to_s;
}

/** The estimate moves; what is held against it is as far from the new one. */
void Estimator::corrected(EstimatorState& state, const CarState& to) const {
  const Eigen::Vector4d moved(to.mean(0) - state.car.mean(0), to.mean(1) - state.car.mean(1),
                              wrapAngle(to.mean(2) - state.car.mean(2)), to.mean(3) - state.car.mean(3));
  state.motion.offset -= Eigen::Vector3d(moved(0), moved(1), moved(2) + moved(3));
  for (auto& record : state.records) {
    record.mean_m -= moved.head<2>();
    record.residual_m -= moved.head<2>();
    record.own_residual_m -= moved.head<2>();
    if (record.heading_rad) record.heading_rad = *record.heading_rad - moved(2);
  }
  state.car = to;
}

bool Estimator::contradictsHeading(const CarState& predicted, const SourceRecord& record) const {
  if (!record.heading_rad) return false;
  const Eigen::Matrix4d& P =
      predicted.covariance;  // the larger of theta's and theta + b's: either may be measured
  const double variance_rad2 = std::max(P(2, 2), P(2, 2) + P(3, 3) + 2 * P(2, 3)) +
                               *record.heading_sigma_rad * *record.heading_sigma_rad;
  return std::pow(wrapAngle(*record.heading_rad), 2) > x_confirm_limit * variance_rad2;
}

void Estimator::widen(EstimatorState& state, const std::vector<PoseFix>& fixes) const {
  if (state.stamp_s - state.confirmed_s > x_options.recovery.alone_s) return;
  const double times = contradictionByAll(state.records, state.stamp_s, x_options.reliability);
  if (times <= x_options.reliability.inflate_from) return;
  state.car.covariance *= times;
  for (SourceRecord& record : state.records) {
    record.contradiction = std::max(1.0, record.contradiction / times);
    record.nis /= times;
  }
  for (const PoseFix& fix : fixes) placeOf(state.records, fix.source)->nis = positionNis(state.car, fix);
}

bool Estimator::isConfirmed(const EstimatorState& state) const {
  return std::any_of(state.records.begin(), state.records.end(), [&](const SourceRecord& r) {
    return r.confirms && !r.left && state.stamp_s - r.stamp_s <= x_options.recovery.alone_s;
  });
}

std::vector<SourceVerdict> Estimator::holdAgainst(EstimatorState& state,
                                                  const std::vector<PoseFix>& fixes) const {
  std::vector<SourceVerdict> verdicts;
  for (const PoseFix& fix : fixes) {
    SourceRecord& known = *placeOf(state.records, fix.source);
    known.confirms = known.nis <= x_confirm_limit && scattersAsClaimed(known) && known.supported;
    SourceVerdict verdict{fix.source, 0, 0, 0, 0, false};
    verdict.nis = known.nis;
    verdict.innovation_body_m = Eigen::Rotation2Dd(-state.car.mean(2)) * known.residual_m;
    verdict.left = known.left;
    verdict.confirms = known.confirms && !known.left;
    const double excess =
        scattersAsClaimed(known) ? known.contradiction : std::max(known.contradiction, known.noise);
    if (excess > x_options.reliability.inflate_from) verdict.inflation = excess;
    if (verdict.nis > x_confirm_limit) verdict.inflation = std::max(verdict.inflation, 0.5 * verdict.nis);
    verdicts.push_back(std::move(verdict));
  }
  return verdicts;
}

Estimator::Hearing Estimator::hear(const EstimatorState& state, std::vector<PoseFix> fixes,
                                   std::vector<SourceVerdict>& verdicts) const {
  const bool is_confirmed = isConfirmed(state);
  const bool is_alone = !is_confirmed && state.stamp_s - state.confirmed_s > x_options.recovery.alone_s;
  CarState reckoned = state.car;  // with what dead reckoning may be off
  reckoned.covariance.topLeftCorner<2, 2>() +=
      std::pow(x_options.recovery.drift_share * state.alone_m, 2) * Eigen::Matrix2d::Identity();

  Hearing heard;
  for (std::size_t i = 0; i < fixes.size(); ++i) {
    SourceVerdict& verdict = verdicts[i];
    const SourceRecord& known = *placeOf(state.records, fixes[i].source);
    const bool contradicts = is_confirmed && !known.confirms;
    const double far_nis = is_alone ? positionNis(reckoned, fixes[i]) : 0;
    if (known.left) {
      verdict.delta = known.left_by_m;
      verdict.limit = known.left_limit_m;
    } else if (contradicts || far_nis > x_confirm_limit) {
      verdict.delta = contradicts ? verdict.nis : far_nis;
      verdict.limit = x_confirm_limit;
    } else {
      fixes[i].cov_p_m2 *= verdict.inflation;
      fixes[i].heading_sigma_rad *= std::sqrt(verdict.inflation);
      if (is_confirmed && contradictsHeading(state.car, known)) fixes[i].heading = HeadingKind::none;
      heard.fixes.push_back(std::move(fixes[i]));
      heard.numbers.push_back(i);
    }
  }
  return heard;
}

GateDecision Estimator::decide(EstimatorState& state, std::vector<PoseFix> fixes) {
  for (const PoseFix& fix : fixes) enter(state, fix, x_options.reliability);
  holdAgainstEachOther(state.records, state.motion, state.stamp_s, x_options.reliability);
  widen(state, fixes);
  std::vector<SourceVerdict> verdicts = holdAgainst(state, fixes);
  const Hearing heard = hear(state, std::move(fixes), verdicts);

  GateDecision decision{GateRule::rejected_all, {}, true};
  if (!heard.fixes.empty()) {
    x_filter.setState(state.car);
    decision = x_filter.correct(heard.fixes);
    corrected(state, x_filter.state());
  }
  for (std::size_t k = 0; k < heard.numbers.size(); ++k) {
    SourceVerdict& verdict = verdicts[heard.numbers[k]];
    const SourceVerdict& gated = decision.sources[k];
    verdict.delta = gated.delta;
    verdict.limit = gated.limit;
    verdict.weight = gated.weight;
    verdict.accepted = gated.accepted;
    verdict.confirms = verdict.confirms && gated.accepted;
    SourceRecord& known = *placeOf(state.records, verdict.source);
    known.confirms = verdict.confirms;
    if (known.confirms) known.leapt = false;
  }
  for (auto& verdict : verdicts) verdict.p_theta = conditionalProbability(verdict.delta);
  if (heard.fixes.size() < verdicts.size() && decision.rule != GateRule::rejected_all)
    decision.rule = GateRule::rejected_some;
  decision.sources = std::move(verdicts);
  decision.alarm = !isConfirmed(state);
  if (decision.alarm)
    tryTwoKeys(state, decision);
  else
    confirm(state);
  return decision;
}

void Estimator::tryTwoKeys(EstimatorState& state, GateDecision& decision) const {
  if (state.stamp_s - state.confirmed_s < x_options.recovery.alone_s) return;
  const auto keys = twoKeys(state.records, state.stamp_s, x_options.reliability);
  if (!keys) {
    state.keys_since_s.reset();
    return;
  }
  const bool is_new =
      !state.keys_since_s || state.stamp_s - *state.keys_seen_s > x_options.reliability.fresh_s;
  if (is_new) state.keys_since_s = state.stamp_s;
  state.keys_seen_s = state.stamp_s;
  SourceRecord &first = state.records[keys->first], &second = state.records[keys->second];
  const RecoveryOptions& recovery = x_options.recovery;
  const bool have_leapt = first.leapt && second.leapt;
  if (state.stamp_s - *state.keys_since_s < (have_leapt ? recovery.leap_s : recovery.agree_s)) return;

  corrected(state, stateOf(state.car, state.stamp_s, first, second, x_options.fusion.bias_sigma_rad));
  for (auto* record : {&first, &second}) {
    record->contradiction = 1;
    record->left = record->leapt = false;
    record->with_others_since_s.reset();
    record->confirms = true;
  }
  for (auto& record : state.records) {  // that was the old heading's
    record.rate_mps.setZero();
    record.steps = 0;
  }
  state.motion = {};
  confirm(state);
  ++state.resets;
  decision.reset = true;
}

}  // namespace raceloc
