#include "sim/speed_profile.h"

#include <algorithm>
#include <cmath>

namespace raceloc {

namespace {

constexpr double kStep_m = 2;
constexpr double kSlowest_mps = 2;

/** The road under the line: what the tyres must do beside driving. */
struct Place {
  double curvature_per_m, dip_per_m, line_m;  // line_m: metres of the line to the next row
  Eigen::Vector3d up;                         // gravity's counterpart in the line's axes: along, left, normal
};

/** Forces per mass that the tyres bear at a speed [m/s^2]. */
struct Load {
  double left, normal;
};

Load loadAt(const Place& place, double speed_mps, const CarOptions& car) {
  const double v2 = speed_mps * speed_mps;
  const double downforce =
      0.5 * kAirDensity_kgpm3 * (car.downforce_area_front_m2 + car.downforce_area_rear_m2) * v2 / car.mass_kg;
  return {v2 * place.curvature_per_m + kGravity_mps2 * place.up.y(),
          std::max(0.0, v2 * place.dip_per_m + kGravity_mps2 * place.up.z() + downforce)};
}

double cornerSpeed(const Place& place, const CarOptions& car, const DriverOptions& driver, const Pace& pace) {
  const auto holds = [&](double v) {
    const Load load = loadAt(place, v, car);
    const double left = std::abs(load.left);
    return left <= pace.lateral_limit_mps2 && left <= driver.grip_share * car.friction * load.normal;
  };
  if (holds(pace.top_speed_mps)) return pace.top_speed_mps;
  // On a bank the sideways force vanishes at some speed: below it more speed helps.
  const double free = place.curvature_per_m == 0 ? 0 : -kGravity_mps2 * place.up.y() / place.curvature_per_m;
  double low = std::max(kSlowest_mps, std::sqrt(std::max(0.0, free)));
  double high = pace.top_speed_mps;
  if (!(low < high) || !holds(low)) return std::clamp(low, kSlowest_mps, high);
  constexpr int kHalvings = 40;
  for (int i = 0; i < kHalvings; ++i) {
    const double middle = 0.5 * (low + high);
    (holds(middle) ? low : high) = middle;
  }
  return low;
}

}  // namespace

SpeedProfile::SpeedProfile(const Track& track, const RacingLine& line, const CarOptions& car,
                           const DriverOptions& driver, const Pace& pace)
    : x_length_m(track.length_m()) {
  const auto rows = static_cast<std::size_t>(std::ceil(x_length_m / kStep_m));
  x_step_m = x_length_m / static_cast<double>(rows);
  std::vector<Place> places;
  places.reserve(rows);
  for (std::size_t i = 0; i < rows; ++i) {
    const double s_m = static_cast<double>(i) * x_step_m;
    const auto point = line.at(s_m);
    const Eigen::Matrix3d R_map_line =
        track.surface(s_m, point.n_m).T_map_surface.linear() *
        Eigen::AngleAxisd(point.direction_rad, Eigen::Vector3d::UnitZ()).toRotationMatrix();
    places.push_back(
        {point.curvature_per_m, point.dip_per_m, point.stretch * x_step_m, R_map_line.row(2).transpose()});
  }

  // What is left of the friction circle for driving and braking.
  const auto gripAlong = [&](const Place& place, double v) {
    const Load load = loadAt(place, v, car);
    const double circle = driver.grip_share * car.friction * load.normal;
    return std::sqrt(std::max(0.0, circle * circle - load.left * load.left));
  };
  const auto drag = [&](double v) {
    return 0.5 * kAirDensity_kgpm3 * car.drag_area_m2 * v * v / car.mass_kg;
  };
  const auto accelerating = [&](const Place& place, double v) {
    const double rear_share = car.front_m / car.wheelbase_m;  // only the rear wheels drive
    const double pull =
        std::min({driver.acceleration_limit_mps2, car.power_w / (car.mass_kg * std::max(v, 1.0)),
                  rear_share * gripAlong(place, v)});
    return pull - drag(v) - kGravity_mps2 * place.up.x();
  };
  const auto braking = [&](const Place& place, double v) {
    return std::max(0.5, std::min(driver.braking_limit_mps2, gripAlong(place, v)) + drag(v) +
                             kGravity_mps2 * place.up.x());
  };

  x_speed_mps.reserve(rows);
  for (const auto& place : places) x_speed_mps.push_back(cornerSpeed(place, car, driver, pace));
  const auto reached = [](double v, double acceleration, double length_m) {
    return std::max(kSlowest_mps, std::sqrt(std::max(0.0, v * v + 2 * acceleration * length_m)));
  };
  for (std::size_t k = 0; k < 2 * rows; ++k) {  // twice round: the second time begins at the right speed
    const std::size_t i = k % rows, next = (k + 1) % rows;
    const double v = x_speed_mps[i];
    x_speed_mps[next] = std::min(x_speed_mps[next], reached(v, accelerating(places[i], v), places[i].line_m));
  }
  for (std::size_t k = 2 * rows; k-- > 0;) {
    const std::size_t i = k % rows, next = (k + 1) % rows;
    const double v = x_speed_mps[next];
    x_speed_mps[i] = std::min(x_speed_mps[i], reached(v, braking(places[i], v), places[i].line_m));
  }

  x_time_s.push_back(0);
  for (std::size_t i = 0; i < rows; ++i) {
    const double v = x_speed_mps[i], next = x_speed_mps[(i + 1) % rows];
    x_acceleration_mps2.push_back((next * next - v * v) / (2 * places[i].line_m));
    x_time_s.push_back(x_time_s.back() + 2 * places[i].line_m / (v + next));
    x_line_m += places[i].line_m;
  }
}

SpeedProfile::Point SpeedProfile::at(double s_m) const {
  const double rows = static_cast<double>(x_speed_mps.size());
  const double turns = s_m / x_length_m;
  const double row = (turns - std::floor(turns)) * rows;
  const auto i = std::min(static_cast<std::size_t>(row), x_speed_mps.size() - 1);
  const std::size_t j = i + 1 == x_speed_mps.size() ? 0 : i + 1;
  const double b = row - static_cast<double>(i);
  return {(1 - b) * x_speed_mps[i] + b * x_speed_mps[j], x_acceleration_mps2[i]};
}

double SpeedProfile::stationAfter(double time_s) const {
  const double laps = std::floor(time_s / lap_s());
  const double t = time_s - laps * lap_s();
  const auto after = std::upper_bound(x_time_s.begin(), x_time_s.end() - 1, t);
  const auto i = static_cast<std::size_t>(std::max<std::ptrdiff_t>(1, after - x_time_s.begin())) - 1;
  const double within = (t - x_time_s[i]) / (x_time_s[i + 1] - x_time_s[i]);
  return laps * x_length_m + (static_cast<double>(i) + within) * x_step_m;
}

double SpeedProfile::top_mps() const { return *std::max_element(x_speed_mps.begin(), x_speed_mps.end()); }

}  // namespace raceloc
