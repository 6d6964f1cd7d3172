#include "sim/race_car.h"

#include <algorithm>
#include <cmath>

namespace raceloc {

namespace {

constexpr double kSpring_s = 0.12;      // the body follows the forces with this lag
constexpr double kSlipSpeed_mps = 1.5;  // slip angles are taken at no less: they have no meaning at rest
constexpr double kRough_mps = 30;       // vibrations are full from this speed on

/** Lateral force of an axle [N] under `load_n`. */
double lateralForce(const CarOptions& car, double slip_rad, double load_n) {
  return -car.friction * load_n * std::sin(car.tyre_c * std::atan(car.tyre_b * slip_rad));
}

/** What the friction circle leaves along the car beside the lateral force [N]. */
double leftForDriving(const CarOptions& car, double load_n, double across_n) {
  const double largest_n = car.friction * load_n;
  return std::sqrt(std::max(0.0, largest_n * largest_n - across_n * across_n));
}

}  // namespace

Pose bodyPose(const Track& track, const CarOptions& car, const RaceCarState& state) {
  return track.surface(state.s_m, state.n_m).T_map_surface *
         Eigen::Translation3d(0, 0, car.axle_height_m + state.heave_m) *
         Eigen::AngleAxisd(state.heading_rad, Eigen::Vector3d::UnitZ()) *
         Eigen::AngleAxisd(state.pitch_rad, Eigen::Vector3d::UnitY()) *
         Eigen::AngleAxisd(state.roll_rad, Eigen::Vector3d::UnitX());
}

RaceCar::RaceCar(const Track& track, const RacingLine& line, const SpeedProfile& profile,
                 const CarOptions& car, const DriverOptions& driver, double start_mps, std::uint64_t seed,
                 double start_m)
    : x_track(track),
      x_line(line),
      x_profile(profile),
      x_car(car),
      x_driver(driver),
      x_noise(seed, "driver") {
  const auto start = line.at(start_m);
  x_state.s_m = start_m;
  x_state.n_m = start.n_m + wander_m(start_m);
  x_state.heading_rad = start.direction_rad;
  x_state.forward_mps = start_mps;
  x_state.yaw_rate_rps = start_mps * start.curvature_per_m;
  x_state.steering_rad = std::atan(x_car.wheelbase_m * start.curvature_per_m);
}

double RaceCar::wander_m(double s_m) const {
  // Four waves that no lap repeats. A sine has variance 1/2: four of them, times sqrt(2 / 4), have wander_m^2.
  double sum_m = 0;
  constexpr std::uint64_t kWaves = 4;
  for (std::uint64_t k = 0; k < kWaves; ++k) {
    const double length_m = x_driver.wander_length_m * (0.7 + 0.8 * x_noise.uniform(2 * k));
    sum_m += std::sin(2 * M_PI * (s_m / length_m + x_noise.uniform(2 * k + 1)));
  }
  return x_driver.wander_m * std::sqrt(2.0 / kWaves) * sum_m;
}

RaceCar::Rates RaceCar::ratesAt(const RaceCarState& x, double pull_mps2) const {
  const SurfacePoint here = x_track.surface(x.s_m, x.n_m);
  const Eigen::Matrix3d R_map_car =
      here.T_map_surface.linear() *
      Eigen::AngleAxisd(x.heading_rad, Eigen::Vector3d::UnitZ()).toRotationMatrix();
  const Eigen::Vector3d gravity = -kGravity_mps2 * R_map_car.row(2).transpose();

  Rates d{};
  const double c = std::cos(x.heading_rad), s = std::sin(x.heading_rad);
  d.s = (x.forward_mps * c - x.leftward_mps * s) / here.stretch;
  d.n = x.forward_mps * s + x.leftward_mps * c;
  const Eigen::Vector3d road_turn = here.centre.turn_per_m * d.s;  // of the surface under the car, road axes
  d.heading = x.yaw_rate_rps - road_turn.z();

  // Normal load: gravity, the road's curvature, downforce; braking moves it to the front.
  const double turn_forward = c * road_turn.x() + s * road_turn.y();
  const double turn_left = -s * road_turn.x() + c * road_turn.y();
  const double lift_mps2 = turn_forward * x.leftward_mps - turn_left * x.forward_mps;
  const double weight_n = x_car.mass_kg * std::max(0.0, lift_mps2 - gravity.z());
  const double pressure = 0.5 * kAirDensity_kgpm3 * x.forward_mps * x.forward_mps;
  const double rear_m = x_car.wheelbase_m - x_car.front_m;
  const double shifted_n = x_car.mass_kg * x.forward_mps2 * x_car.centre_height_m / x_car.wheelbase_m;
  const double front_n = std::max(
      0.0, weight_n * rear_m / x_car.wheelbase_m - shifted_n + pressure * x_car.downforce_area_front_m2);
  const double rear_n = std::max(0.0, weight_n * x_car.front_m / x_car.wheelbase_m + shifted_n +
                                          pressure * x_car.downforce_area_rear_m2);

  const double rolling_mps = std::max(x.forward_mps, kSlipSpeed_mps);
  const double front_slip_rad =
      std::atan2(x.leftward_mps + x_car.wheelbase_m * x.yaw_rate_rps, rolling_mps) - x.steering_rad;
  const double rear_slip_rad = std::atan2(x.leftward_mps, rolling_mps);
  const double front_across_n = lateralForce(x_car, front_slip_rad, front_n);
  const double rear_across_n = lateralForce(x_car, rear_slip_rad, rear_n);
  // The engine pulls at the rear; brakes act on both axles by their load. The driver's foot takes no more than
  // steering leaves of the friction circle, so that no axle is ever beyond it.
  const double wanted_n = x_car.mass_kg * pull_mps2;
  const double most_front_n = leftForDriving(x_car, front_n, front_across_n);
  const double most_rear_n = leftForDriving(x_car, rear_n, rear_across_n);
  const double total_n = std::max(1.0, front_n + rear_n);
  const double front_along_n = wanted_n < 0 ? std::max(wanted_n * front_n / total_n, -most_front_n) : 0;
  const double rear_along_n =
      wanted_n < 0 ? std::max(wanted_n * rear_n / total_n, -most_rear_n) : std::min(wanted_n, most_rear_n);
  const auto use = [&](double along_n, double across_n, double load_n) {
    return load_n > 0 ? std::hypot(along_n, across_n) / (x_car.friction * load_n) : 0;
  };
  d.front_use = use(front_along_n, front_across_n, front_n);
  d.rear_use = use(rear_along_n, rear_across_n, rear_n);
  const double stiffness =
      x_car.friction * x_car.tyre_b * x_car.tyre_c;  // as sideways: force over load and slip
  d.slip = rear_n > 0 ? rear_along_n / (stiffness * rear_n) : 0;

  const double cd = std::cos(x.steering_rad), sd = std::sin(x.steering_rad);
  const double drag_n = pressure * x_car.drag_area_m2;
  d.forward_force = (rear_along_n + front_along_n * cd - front_across_n * sd - drag_n) / x_car.mass_kg;
  d.leftward_force = (rear_across_n + front_across_n * cd + front_along_n * sd) / x_car.mass_kg;
  // Newton at the centre of mass, which is `rear_m` ahead of the rear axle.
  const double turn = (x_car.front_m * (front_across_n * cd + front_along_n * sd) - rear_m * rear_across_n) /
                      x_car.yaw_inertia_kgm2;
  const double centre_leftward_mps = x.leftward_mps + rear_m * x.yaw_rate_rps;
  d.yaw_rate = turn;
  d.forward = d.forward_force + gravity.x() + x.yaw_rate_rps * centre_leftward_mps;
  d.leftward = d.leftward_force + gravity.y() - x.yaw_rate_rps * x.forward_mps - rear_m * turn;
  return d;
}

double RaceCar::driversSteering() const {
  const RaceCarState& x = x_state;
  const SurfacePoint here = x_track.surface(x.s_m, x.n_m);
  const auto line = x_line.at(x.s_m);
  const auto soon =
      x_line.at(x.s_m + kReaction_s * std::max(x.forward_mps, 1.0) / std::max(0.2, here.stretch));
  const auto up = here.T_map_surface.linear().row(2);
  return wantedSteering({x.n_m - line.n_m - wander_m(x.s_m), x.heading_rad, line.direction_rad,
                         soon.curvature_per_m, soon.dip_per_m, up(1), up(2)},
                        x.forward_mps, x.yaw_rate_rps, x_car, x_driver);
}

double RaceCar::wantedPull() const {
  const RaceCarState& x = x_state;
  const auto target = x_profile.at(x.s_m);
  constexpr double kGain_per_s = 1.5;
  const double drag_mps2 =
      0.5 * kAirDensity_kgpm3 * x_car.drag_area_m2 * x.forward_mps * x.forward_mps / x_car.mass_kg;
  const double climb = kGravity_mps2 * bodyPose(x_track, x_car, x).linear()(2, 0);
  const double wanted =
      target.acceleration_mps2 + kGain_per_s * (target.speed_mps - x.forward_mps) + drag_mps2 + climb;
  const double engine = x_car.power_w / (x_car.mass_kg * std::max(x.forward_mps, 1.0));
  return std::clamp(wanted, -1.3 * x_driver.braking_limit_mps2,
                    std::min(engine, x_driver.acceleration_limit_mps2));
}

void RaceCar::step(bool drive) {
  steer(driversSteering());
  if (drive) roll(wantedPull());
  sway();
}

void RaceCar::stepSteered(double steering_rad) {
  steer(steering_rad);
  roll(wantedPull());
  sway();
}

void RaceCar::steer(double wanted_rad) {
  const double most_rad = kDegree * x_car.max_steering_deg;
  const double most_step_rad = kDegree * x_car.max_steering_rate_dps * kStep_s;
  const double step_rad = std::clamp(wanted_rad, -most_rad, most_rad) - x_state.steering_rad;
  x_state.steering_rad += std::clamp(step_rad, -most_step_rad, most_step_rad);
}

void RaceCar::roll(double pull_mps2) {
  const auto moved = [](RaceCarState x, const Rates& d, double dt_s) {
    x.s_m += dt_s * d.s;
    x.n_m += dt_s * d.n;
    x.heading_rad += dt_s * d.heading;
    x.forward_mps = std::max(0.0, x.forward_mps + dt_s * d.forward);
    x.leftward_mps += dt_s * d.leftward;
    x.yaw_rate_rps += dt_s * d.yaw_rate;
    return x;
  };
  const Rates begin = ratesAt(x_state, pull_mps2);
  const Rates middle = ratesAt(moved(x_state, begin, 0.5 * kStep_s), pull_mps2);
  x_state = moved(x_state, middle, kStep_s);
  x_state.forward_mps2 = middle.forward_force;
  x_state.leftward_mps2 = middle.leftward_force;
  x_state.front_friction_use = middle.front_use;
  x_state.rear_friction_use = middle.rear_use;
  x_state.wheel_slip = middle.slip;
}

void RaceCar::sway() {
  RaceCarState& x = x_state;
  x.time_s = static_cast<double>(++x_steps) * kStep_s;
  const double follow = kStep_s / kSpring_s;
  x_spring_pitch_rad += follow * (-kDegree * x_car.pitch_deg_per_mps2 * x.forward_mps2 - x_spring_pitch_rad);
  x_spring_roll_rad += follow * (kDegree * x_car.roll_deg_per_mps2 * x.leftward_mps2 - x_spring_roll_rad);
  const double rough = std::min(1.0, x.forward_mps / kRough_mps);
  const auto wave = [&](double rate_hz, std::uint64_t phase) {
    return rough * std::sin(2 * M_PI * (rate_hz * x.time_s + x_noise.uniform(1000 + phase)));
  };
  x.pitch_rad = x_spring_pitch_rad + kDegree * x_car.vibration_pitch_deg * wave(4.3, 0);
  x.roll_rad = x_spring_roll_rad + kDegree * x_car.vibration_roll_deg * wave(2.7, 1);
  x.heave_m = x_car.vibration_heave_m * wave(3.1, 2);
}

}  // namespace raceloc
