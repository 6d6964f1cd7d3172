/** \file
 * A car and its driver on a circuit: single-track model with tyre slip on the banked road. */
#pragma once

#include <cstdint>

#include "sim/noise.h"
#include "sim/path_tracker.h"
#include "sim/speed_profile.h"

namespace raceloc {

/** Where the car is and how it moves. The motion is that of the rear axle, in the road's surface: x along the
 * car, y to its left. */
struct RaceCarState {
  double time_s = 0;       ///< since the start
  double s_m = 0;          ///< along the centre line, growing from lap to lap
  double n_m = 0;          ///< left of the centre line
  double heading_rad = 0;  ///< of the car against the surface's x axis
  double forward_mps = 0, leftward_mps = 0;
  double yaw_rate_rps = 0;                          ///< about the surface's normal
  double steering_rad = 0;                          ///< of the road wheels, left positive
  double pitch_rad = 0, roll_rad = 0, heave_m = 0;  ///< of the body on its springs
  double forward_mps2 = 0;                          ///< force along the car per mass, without gravity
  double leftward_mps2 = 0;                         ///< and across it: what the tyres bear
  double wheel_slip = 0;  ///< of the driven wheels: they turn (1 + slip) times as fast as they roll
  double front_friction_use = 0, rear_friction_use = 0;  ///< force over the largest possible one, 0..1

  /** Angle from heading to course, the side-slip at the rear axle; 0 at rest. */
  [[nodiscard]] double sideslip_rad() const {
    return forward_mps == 0 ? 0 : std::atan2(leftward_mps, forward_mps);
  }
};

/** T_map_body: the centre of the rear axle, x forward, y left, z up out of the leaning body. */
[[nodiscard]] Pose bodyPose(const Track& track, const CarOptions& car, const RaceCarState& state);

/** Single-track model on the banked road: Magic Formula per axle, a friction circle that is never left, and a driver
 * who keeps the profile's speed and steers along the racing line (path_tracker.h), unless someone else steers. Track,
 * line and profile must outlive it.
 * Source: Rajamani, Vehicle Dynamics and Control, ch. 2 (single track, bank); Pacejka (tyres). */
class RaceCar {
 public:
  /** Starts on the racing line.
   * \param start_mps  speed at the start
   * \param seed       of how laps differ from the line and of the vibrations
   * \param start_m    station where it starts */
  RaceCar(const Track& track, const RacingLine& line, const SpeedProfile& profile, const CarOptions& car,
          const DriverOptions& driver, double start_mps, std::uint64_t seed, double start_m = 0);

  /** One step of kStep_s. \param drive  false: held where it is, for a car that stands on the grid */
  void step(bool drive = true);
  /** One step in which the driver leaves the wheel to someone else, who wants the road wheels at this angle, left
   * positive; they follow as fast and as far as they can. */
  void stepSteered(double steering_rad);
  [[nodiscard]] const RaceCarState& state() const { return x_state; }
  static constexpr double kStep_s = 0.001;

 private:
  struct Rates {
    double s, n, heading, forward, leftward, yaw_rate;
    double forward_force, leftward_force, front_use, rear_use, slip;
  };
  /** Of a state under the tyres' forces and `pull_mps2` of engine or brakes. */
  [[nodiscard]] Rates ratesAt(const RaceCarState& state, double pull_mps2) const;
  [[nodiscard]] double driversSteering() const;
  [[nodiscard]] double wantedPull() const;
  [[nodiscard]] double wander_m(double s_m) const;
  void steer(double wanted_rad);
  void roll(double pull_mps2);
  void sway();

  const Track& x_track;
  const RacingLine& x_line;
  const SpeedProfile& x_profile;
  CarOptions x_car;
  DriverOptions x_driver;
  Noise x_noise;
  RaceCarState x_state;
  std::uint64_t x_steps = 0;
  double x_spring_pitch_rad = 0, x_spring_roll_rad = 0;
};

}  // namespace raceloc
