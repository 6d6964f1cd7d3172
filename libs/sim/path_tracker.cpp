#include "sim/path_tracker.h"

#include <algorithm>
#include <cmath>

#include "core/types.h"
#include "sim/speed_profile.h"

namespace raceloc {

double wantedSteering(const PathAhead& path, double forward_mps, double yaw_rate_rps, const CarOptions& car,
                      const DriverOptions& driver) {
  const double v = std::max(forward_mps, 1.0);
  const double ahead_m = std::max(driver.lookahead_min_m, driver.lookahead_s * v);
  const double feedback = kDegree * driver.steering_gain_deg_per_m * 10 / std::max(v, 10.0);
  // What the tyres need in the steady turn: the Magic Formula, inverted, per axle.
  const double across_mps2 = v * v * path.curvature_per_m + kGravity_mps2 * path.up_left;
  const double pressure = 0.5 * kAirDensity_kgpm3 * v * v / car.mass_kg;
  const double weight_mps2 = v * v * path.dip_per_m + kGravity_mps2 * path.up_normal;
  const auto slip = [&](double share, double downforce_area_m2) {
    constexpr double kMostUse = 0.98;
    const double load_mps2 = std::max(0.1, share * weight_mps2 + pressure * downforce_area_m2);
    const double use = std::clamp(share * across_mps2 / (car.friction * load_mps2), -kMostUse, kMostUse);
    return -std::tan(std::asin(use) / car.tyre_c) / car.tyre_b;
  };
  const double front_share = 1 - car.front_m / car.wheelbase_m;
  const double front_rad = slip(front_share, car.downforce_area_front_m2);
  const double rear_rad = slip(1 - front_share, car.downforce_area_rear_m2);  // the settled sideslip
  return std::atan(car.wheelbase_m * path.curvature_per_m) + rear_rad - front_rad -
         feedback * (path.offset_m + ahead_m * std::sin(path.heading_rad + rear_rad - path.direction_rad)) -
         driver.yaw_damping_s * (yaw_rate_rps - v * path.curvature_per_m);
}

}  // namespace raceloc
