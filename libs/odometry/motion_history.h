/** \file
 * Dead reckoning from wheel speed and yaw rate, over any interval of the recent past. */
#pragma once

#include <deque>
#include <optional>

#include "core/options.h"
#include "core/samples.h"
#include "core/types.h"

namespace raceloc {

/** Section [motion]. */
struct MotionOptions {
  double memory_s = 5.0;
  double max_gap_s = 0.5;
  double speed_sigma_mps = 0.2;
  double yaw_rate_sigma_rps = 0.005;
  void describe(OptionList& keys);
};

/** The last seconds of speed and yaw rate. The yaw rate is the gyro's while an IMU delivers, else the car's
 * own. Planar, no side-slip. Source: reading.md section 5 (translation from wheel speed, never from
 * acceleration). */
class MotionHistory {
 public:
  explicit MotionHistory(const MotionOptions& options) : x_options(options) {}

  /** Samples come in order of time; one that is older than the newest of its kind is ignored. */
  void add(const MotionSample& sample);
  void add(const ImuSample& sample);

  /** Stamp up to which motion is known; none before the first speed and yaw rate. */
  [[nodiscard]] std::optional<double> knownUntil_s() const;

  /** Rates averaged over [from, to], by trapezoids; held constant for at most max_gap_s beyond the samples.
   * None when the interval is not covered. `to_s` may equal `from_s`. */
  struct Rates {
    double speed_mps, yaw_rate_rps;
  };
  [[nodiscard]] std::optional<Rates> ratesBetween(double from_s, double to_s) const;

  /** The body's motion from one instant to a later one: arcs of 10 ms, with the covariance of white speed and
   * yaw rate errors. None when the interval is not covered. */
  [[nodiscard]] std::optional<BodyMotion> between(double from_s, double to_s) const;

 private:
  struct Timed {
    double stamp_s, value;
  };
  using Series = std::deque<Timed>;
  void append(Series& series, double stamp_s, double value) const;
  [[nodiscard]] std::optional<double> meanBetween(const Series& series, double from_s, double to_s) const;

  MotionOptions x_options;
  Series x_speed_mps, x_yaw_rate_rps;
  std::optional<double> x_last_imu_s;
};

}  // namespace raceloc
