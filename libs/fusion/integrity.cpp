#include "fusion/integrity.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

#include "fusion/chi_square.h"

namespace raceloc {

const char* nameOf(LocalizationState state) {
  switch (state) {
    case LocalizationState::ok:
      return "ok";
    case LocalizationState::degraded:
      return "degraded";
    case LocalizationState::dead_reckoning:
      return "dead_reckoning";
    case LocalizationState::lost:
      return "lost";
  }
  return "lost";
}

void IntegrityOptions::describe(OptionList& keys) {
  keys.add("protection_sigmas", protection_sigmas, between(1, 10), "protection levels are this many sigmas");
  keys.add("half_width_m", half_width_m, above(0), "from the car's middle to its side [m]");
  keys.add("alert_limit_m", alert_limit_m, above(0), "lateral alert limit where the map knows no wall [m]");
}

Integrity assess(const EstimatorState& state, std::optional<double> gap_m, const EstimatorOptions& options,
                 const IntegrityOptions& integrity) {
  const Eigen::Matrix2d R_body_map = Eigen::Rotation2Dd(-state.car.mean(2)).toRotationMatrix();
  const Eigen::Matrix2d P = R_body_map * state.car.covariance.topLeftCorner<2, 2>() * R_body_map.transpose();
  Eigen::Vector2d bias_m = Eigen::Vector2d::Zero();
  int confirming = 0;
  for (const SourceRecord& record : state.records) {
    if (!record.confirms || record.left || state.stamp_s - record.stamp_s > options.reliability.fresh_s)
      continue;
    ++confirming;
    bias_m = bias_m.cwiseMax((R_body_map * record.mean_m).cwiseAbs());
  }

  const double drift_m = options.recovery.drift_share * state.alone_m;
  Integrity out;
  out.protection = {integrity.protection_sigmas * std::sqrt(P(1, 1)) + bias_m.y() + drift_m,
                    integrity.protection_sigmas * std::sqrt(P(0, 0)) + bias_m.x() + drift_m,
                    integrity.protection_sigmas * std::sqrt(state.car.covariance(2, 2))};
  out.alert_limit_m = gap_m ? std::max(0.0, *gap_m - integrity.half_width_m) : integrity.alert_limit_m;
  const auto say = [&](LocalizationState what, std::string cause, double measured, double limit) {
    out.state = what;
    out.cause = std::move(cause);
    out.measured = measured;
    out.limit = limit;
    return out;
  };

  if (out.protection.lateral_m > out.alert_limit_m)
    return say(LocalizationState::lost, "lateral error may exceed the alert limit [m]",
               out.protection.lateral_m, out.alert_limit_m);
  const double alone_s = state.stamp_s - state.confirmed_s;
  if (alone_s > options.recovery.alone_s)
    return say(LocalizationState::dead_reckoning, "no source confirms it [s]", alone_s,
               options.recovery.alone_s);
  for (const SourceRecord& record : state.records) {
    const double silent_s = state.stamp_s - record.stamp_s;
    if (silent_s > options.reliability.fresh_s)
      return say(LocalizationState::degraded, record.source + " is silent [s]", silent_s,
                 options.reliability.fresh_s);
    if (record.left)
      return say(LocalizationState::degraded, record.source + " left the others [m]", record.left_by_m,
                 record.left_limit_m);
    if (!scattersAsClaimed(record))
      return say(LocalizationState::degraded, record.source + " scatters beyond its claim [times]",
                 record.scatter, kMostScatter);
    if (!record.supported)
      return say(LocalizationState::degraded,
                 record.source + " agrees neither with another source nor with the car's motion", 0, 0);
    if (!record.confirms)
      return say(LocalizationState::degraded, record.source + " contradicts the estimate [NIS]", record.nis,
                 chiSquareLimit(options.reliability.confirm_false_alarm, 2));
  }
  if (confirming < 2)
    return say(LocalizationState::degraded, "fewer than two sources confirm it", confirming, 2);
  return say(LocalizationState::ok, "", 0, 0);
}

}  // namespace raceloc
