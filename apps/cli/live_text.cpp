#include "cli/live_text.h"

#include <cmath>
#include <cstdio>

#include "cli/odometry_text.h"

namespace raceloc {

void print(const ReplayReport& r) {
  std::printf("device           %s\n", r.device_reason.c_str());
  std::printf("recording        %.1f s; %zu outputs, %zu tile loads\n", r.recorded_s, r.outputs,
              r.tile_loads);
  if (!r.start)
    std::printf("start            NONE: no fix with a heading, or no scan match near one\n");
  else if (r.start->by_match)
    std::printf("start            after %.2f s: scan match %.2f m from the fix of %s\n",
                r.start->stamp_s - r.first_s, r.start->match_to_fix_m, r.start->receiver.c_str());
  else
    std::printf("start            after %.2f s: by the fix of %s ALONE, no scan match near it\n",
                r.start->stamp_s - r.first_s, r.start->receiver.c_str());
  if (r.dropped_late > 0)
    std::printf("dropped          %zu samples, late beyond the window or not finite\n", r.dropped_late);
  if (r.passed_over > 0)
    std::printf("passed over      %zu sweeps, which ended before the estimate's time\n", r.passed_over);
  printFaults(r.faults);
  if (r.without_wheels > 0)
    std::printf("DEGRADED         %zu outputs without speed and yaw rate: the last ones went on\n",
                r.without_wheels);
  if (r.disabled_samples > 0) std::printf("disabled         %zu samples, as asked\n", r.disabled_samples);
  std::printf(
      "scan match       %zu of %zu sweeps trusted; residual %.3f m across the surface, inlier share %.2f, "
      "%.0f "
      "iterations (medians)\n",
      r.trusted_matches, r.scans, r.match_residual_m, r.match_inlier_share, r.match_iterations);
  std::printf(
      "gate             rule 1 (primary) %zu, 2 (weighted) %zu, 3 (some rejected) %zu, 4 (all rejected) %zu; "
      "%zu "
      "alarms\n",
      r.rule_counts[1], r.rule_counts[2], r.rule_counts[3], r.rule_counts[4], r.alarms);
  std::printf(
      "state            ok %zu, degraded %zu, dead reckoning %zu, lost %zu outputs; %zu resets by two "
      "sources, %zu searches\n",
      r.state_counts[0], r.state_counts[1], r.state_counts[2], r.state_counts[3], r.resets, r.searches);
  std::printf(
      "walls            left seen in %zu, right in %zu sweeps; guard: localized %zu, wall following %zu, "
      "emergency %zu, "
      "no wall %zu sweeps\n",
      r.walls_left, r.walls_right, r.guard_counts[0], r.guard_counts[1], r.guard_counts[2],
      r.guard_counts[3]);
  for (const auto& [cause, times] : r.causes)
    std::printf("NOT OK           %zu outputs: %s\n", times, cause.c_str());
  std::printf("scan to pose     %.1f ms median, %.1f ms p99, %.1f ms max\n", 1e3 * r.match_median_s,
              1e3 * r.match_p99_s, 1e3 * r.match_max_s);
}

void print(const OdometryReport& r) {
  std::printf("device           %s\n", r.device_reason.c_str());
  printOdometry(r.odometry, r.recorded_s, r.dropped_late);
  const auto learnt = [&](const char* what, int k, double per_unit, const char* unit) {
    std::printf("%-16s %.4f +- %.4f %s\n", what, r.calibration(k) / per_unit,
                r.calibration_sigma(k) / per_unit, unit);
  };
  learnt("gyro bias x", kGyroBiasX, kDegree, "deg/s");
  learnt("gyro bias y", kGyroBiasY, kDegree, "deg/s");
  learnt("gyro bias z", kGyroBiasZ, kDegree, "deg/s");
  learnt("wheel scale", kWheelScale, 0.01, "%");
  learnt("traction slip", kTraction, 0.01, "% per m/s^2");
  learnt("steering offset", kSteeringOffset, kDegree, "deg");
  learnt("side-slip", kSideslip, kDegree, "deg per m/s^2");
  learnt("rise", kRise, kDegree, "deg");
  if (r.level)
    std::printf("level            roll %.2f, pitch %.2f +- %.2f deg at the end, by the accelerometer\n",
                r.level->roll_rad() / kDegree, r.level->pitch_rad() / kDegree, r.level->sigma_rad / kDegree);
}

void printFalseRejects(const EstimatorOptions& options) {
  const GateOptions& gate = options.gate;
  if (gate.metric == GateMetric::chi2) {
    std::printf("gate             chi2: a sound fix is rejected with probability %.1e\n",
                gate.delta_false_alarm);
  } else {
    // On two axes of sigma each, a fix is farther off than delta with probability exp(-delta^2 / (2 sigma^2)).
    const auto exponent = [&](double sigma_m) {
      return -std::pow(gate.delta_m / sigma_m, 2) / 2 / std::log(10.0);
    };
    std::printf(
        "gate             metric, to %.2f m: a sound fix is rejected with probability 1e%.0f at 0.1 m, "
        "1e%.1f "
        "at 1 m\n",
        gate.delta_m, exponent(0.1), exponent(1));
  }
  std::printf(
      "reliability      while others confirm the estimate, a sound fix is left out with probability %.0e\n",
      options.reliability.confirm_false_alarm);
}

}  // namespace raceloc
