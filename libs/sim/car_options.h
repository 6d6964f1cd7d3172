/** \file
 * The car and its driver, as a car file (ini/sim/indy.ini) describes them. */
#pragma once

#include "core/options.h"

namespace raceloc {

/** Section [car]. A single-track model: both wheels of an axle are one. */
struct CarOptions {
  double mass_kg = 750;
  double yaw_inertia_kgm2 = 1000;
  double wheelbase_m = 2.971;
  double front_m = 1.724;
  double centre_height_m = 0.275;
  double axle_height_m = 0.3;
  double drag_area_m2 = 0.725;
  double downforce_area_front_m2 = 0.522;
  double downforce_area_rear_m2 = 1.034;
  double power_w = 357'000;
  double friction = 1.39;
  double tyre_b = 10.8;
  double tyre_c = 1.6;
  double max_steering_deg = 24;
  double max_steering_rate_dps = 90;
  double length_m = 4.9;
  double width_m = 1.93;
  double height_m = 1.1;
  double pitch_deg_per_mps2 = 0.04;
  double roll_deg_per_mps2 = 0.03;
  double vibration_pitch_deg = 0.15;
  double vibration_roll_deg = 0.1;
  double vibration_heave_m = 0.01;
  void describe(OptionList& keys);
};

/** Section [driver]. */
struct DriverOptions {
  double margin_m = 2;
  double grip_share = 0.75;
  double acceleration_limit_mps2 = 8;
  double braking_limit_mps2 = 14;
  double lookahead_s = 0.4;
  double lookahead_min_m = 6;
  double steering_gain_deg_per_m = 12;
  double yaw_damping_s = 0.2;
  double wander_m = 0.3;
  double wander_length_m = 300;
  void describe(OptionList& keys);
};

}  // namespace raceloc
