/** \file
 * What the accelerometer tells of the body on its springs: the load of the tyres, and how the body swings. */
#pragma once

#include <optional>

#include "core/samples.h"
#include "core/time_series.h"
#include "odometry/heave_velocity.h"

namespace raceloc {

/** The load follows the force out of the road with a lag: a car does not slide to and fro as its springs swing. */
class Suspension {
 public:
  struct Options {
    double memory_s, max_gap_s;
    double load_lag_s;
    double lateral_sigma_mps, out_of_road_sigma_mps;  ///< of HeaveVelocity
    double
        fastest_heave_mps;  ///< an accelerometer that says more is wrong, and not believed of it for a while
  };
  explicit Suspension(const Options& options);

  /** Samples come in order of time. \param road  none if it is not known */
  void add(const ImuSample& sample, const std::optional<HeaveVelocity::OnRoad>& road);
  /** What came since then was no measurement. */
  void dropSince(double stamp_s);

  /** Force out of the road over mass, at an instant; none without an accelerometer. */
  [[nodiscard]] std::optional<double> load_mps2(double stamp_s) const { return x_load_mps2.at(stamp_s); }
  /** Velocity of the body's origin along its z axis, but for what is slow; 0 where nothing is told. */
  [[nodiscard]] double heave_mps(double stamp_s) const { return x_heave_mps.at(stamp_s).value_or(0); }
  /** Whether gyro and accelerometer are not believed now: which of them is wrong cannot be told. */
  [[nodiscard]] bool contradictsRoad() const;

 private:
  Options x_options;
  HeaveVelocity x_filter;
  TimeSeries<double> x_load_mps2, x_heave_mps;
  std::optional<double> x_last_s, x_contradicted_s;
};

}  // namespace raceloc
