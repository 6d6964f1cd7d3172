#include "odometry/motion_history.h"

#include <algorithm>
#include <cmath>

#include "cloud/deskew.h"

namespace raceloc {

void MotionOptions::describe(OptionList& keys) {
  keys.add("memory_s", memory_s, between(1, 60), "how long speed and yaw rate are remembered [s]");
  keys.add("max_gap_s", max_gap_s, between(0, 5),
           "speed and yaw rate are held this long when samples are missing [s]");
  keys.add("speed_sigma_mps", speed_sigma_mps, above(0), "error of the speed, white at 100 Hz [m/s]");
  keys.add("yaw_rate_sigma_rps", yaw_rate_sigma_rps, above(0),
           "error of the yaw rate, white at 100 Hz [rad/s]");
}

void MotionHistory::append(Series& series, double stamp_s, double value) const {
  if (!series.empty() && stamp_s <= series.back().stamp_s) return;
  series.push_back({stamp_s, value});
  while (series.back().stamp_s - series.front().stamp_s > x_options.memory_s) series.pop_front();
}

void MotionHistory::add(const MotionSample& sample) {
  append(x_speed_mps, sample.stamp_s, sample.speed_mps);
  const bool imu_delivers = x_last_imu_s && sample.stamp_s - *x_last_imu_s < x_options.max_gap_s;
  if (!imu_delivers) append(x_yaw_rate_rps, sample.stamp_s, sample.yaw_rate_rps);
}

void MotionHistory::add(const ImuSample& sample) {
  x_last_imu_s = sample.stamp_s;
  append(x_yaw_rate_rps, sample.stamp_s, sample.gyro_body_rps.z());
}

std::optional<double> MotionHistory::knownUntil_s() const {
  if (x_speed_mps.empty() || x_yaw_rate_rps.empty()) return std::nullopt;
  return std::min(x_speed_mps.back().stamp_s, x_yaw_rate_rps.back().stamp_s);
}

std::optional<double> MotionHistory::meanBetween(const Series& series, double from_s, double to_s) const {
  if (series.empty() || from_s < series.front().stamp_s - x_options.max_gap_s ||
      to_s > series.back().stamp_s + x_options.max_gap_s)
    return std::nullopt;
  // Value at an instant: linear between samples, held outside of them.
  const auto at = [&](double stamp_s) {
    const auto next = std::lower_bound(series.begin(), series.end(), stamp_s,
                                       [](const Timed& s, double t) { return s.stamp_s < t; });
    if (next == series.begin()) return series.front().value;
    if (next == series.end()) return series.back().value;
    const auto last = std::prev(next);
    const double share = (stamp_s - last->stamp_s) / (next->stamp_s - last->stamp_s);
    return last->value + share * (next->value - last->value);
  };
  if (to_s <= from_s) return at(from_s);
  double integral = 0, stamp_s = from_s, value = at(from_s);
  for (const Timed& sample : series) {
    if (sample.stamp_s <= from_s) continue;
    if (sample.stamp_s >= to_s) break;
    integral += 0.5 * (value + sample.value) * (sample.stamp_s - stamp_s);
    stamp_s = sample.stamp_s;
    value = sample.value;
  }
  integral += 0.5 * (value + at(to_s)) * (to_s - stamp_s);
  return integral / (to_s - from_s);
}

std::optional<MotionHistory::Rates> MotionHistory::ratesBetween(double from_s, double to_s) const {
  const auto speed_mps = meanBetween(x_speed_mps, from_s, to_s);
  const auto yaw_rate_rps = meanBetween(x_yaw_rate_rps, from_s, to_s);
  if (!speed_mps || !yaw_rate_rps) return std::nullopt;
  return Rates{*speed_mps, *yaw_rate_rps};
}

std::optional<BodyMotion> MotionHistory::between(double from_s, double to_s) const {
  if (!ratesBetween(from_s, to_s)) return std::nullopt;
  BodyMotion motion;
  const double duration_s = std::max(0.0, to_s - from_s);
  constexpr double kStep_s = 0.01;
  const int steps = static_cast<int>(std::ceil(duration_s / kStep_s));
  const double step_s = steps > 0 ? duration_s / steps : 0;
  for (int i = 0; i < steps; ++i) {
    const double end_s = i + 1 == steps ? to_s : from_s + (i + 1) * step_s;
    const auto rates = ratesBetween(from_s + i * step_s, end_s);
    BodyMotion step{step_s, arc(rates->speed_mps * step_s, rates->yaw_rate_rps * step_s), Matrix6d::Zero()};
    step.covariance(2, 2) = std::pow(x_options.yaw_rate_sigma_rps * step_s, 2);
    step.covariance(3, 3) = std::pow(x_options.speed_sigma_mps * step_s, 2);
    motion = then(motion, step);
  }
  return motion;
}

}  // namespace raceloc
