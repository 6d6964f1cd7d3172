/** \file
 * How fast a racing line can be driven. */
#pragma once

#include <vector>

#include "sim/car_options.h"
#include "track/circuit.h"
#include "track/racing_line.h"

namespace raceloc {

constexpr double kAirDensity_kgpm3 = 1.225;

/** Speed along the racing line, each lap the same: the largest that keeps within the pace, the engine, and
 * `grip_share` of the tyres' friction circle on the banked road, with downforce. */
class SpeedProfile {
 public:
  SpeedProfile(const Track& track, const RacingLine& line, const CarOptions& car, const DriverOptions& driver,
               const Pace& pace);

  struct Point {
    double speed_mps, acceleration_mps2;
  };
  [[nodiscard]] Point at(double s_m) const;  ///< any s of the centre line, wraps
  [[nodiscard]] double lap_s() const { return x_time_s.back(); }
  /** Station that is reached `time_s` after the start line, for cars that drive exactly this profile. */
  [[nodiscard]] double stationAfter(double time_s) const;
  [[nodiscard]] double top_mps() const;
  [[nodiscard]] double mean_mps() const { return x_line_m / lap_s(); }

 private:
  double x_length_m, x_step_m, x_line_m = 0;
  std::vector<double> x_speed_mps, x_acceleration_mps2;
  std::vector<double> x_time_s;  ///< at each row and, last, at the end of the lap
};

}  // namespace raceloc
