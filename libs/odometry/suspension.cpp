#include "odometry/suspension.h"

#include <cmath>

namespace raceloc {

namespace {

constexpr double kNotBelieved_s = 30;

}  // namespace

Suspension::Suspension(const Options& o)
    : x_options(o),
      x_filter(o.lateral_sigma_mps, o.out_of_road_sigma_mps),
      x_load_mps2(o.memory_s, o.max_gap_s),
      x_heave_mps(o.memory_s, HeaveVelocity::kSwingTenth_s) {}

void Suspension::add(const ImuSample& sample, const std::optional<HeaveVelocity::OnRoad>& road) {
  const double t = sample.stamp_s, force_mps2 = sample.specific_force_body_mps2.z();
  const double since_s = x_last_s ? t - *x_last_s : x_options.max_gap_s;
  const auto before = x_load_mps2.samples();
  x_load_mps2.add(
      t, before.empty() || since_s >= x_options.max_gap_s
             ? force_mps2
             : force_mps2 + std::exp(-since_s / x_options.load_lag_s) * (before.back().value - force_mps2));
  x_last_s = t;
  if (!road) {
    x_filter.forget();
    return;
  }
  // With the gyro as it is: what its bias does at a speed goes into the filter's force at rest, and no estimate of the
  // bias, which learns from what is predicted by this, can swing with it.
  const double heave_mps =
      x_filter.add({t, sample.gyro_body_rps, sample.specific_force_body_mps2, sample.p_body_imu_m}, *road);
  if (!(std::abs(heave_mps) <= x_options.fastest_heave_mps)) {  // NaN too
    x_contradicted_s = t;
    x_filter.forget();
  }
  x_heave_mps.add(t, contradictsRoad() ? 0 : heave_mps);
}

void Suspension::dropSince(double stamp_s) {
  x_load_mps2.dropSince(stamp_s);
  x_heave_mps.dropSince(stamp_s);
  x_filter.forget();
}

bool Suspension::contradictsRoad() const {
  return x_last_s && x_contradicted_s && *x_last_s - *x_contradicted_s < kNotBelieved_s;
}

}  // namespace raceloc
