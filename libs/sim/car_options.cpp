#include "sim/car_options.h"

namespace raceloc {

void CarOptions::describe(OptionList& keys) {
  keys.add("mass_kg", mass_kg, between(50, 20'000), "with driver and fuel [kg]");
  keys.add("yaw_inertia_kgm2", yaw_inertia_kgm2, between(10, 100'000), "about the vertical axis [kg m^2]");
  keys.add("wheelbase_m", wheelbase_m, between(0.5, 10), "between the axles [m]");
  keys.add("front_m", front_m, between(0.1, 10),
           "centre of mass to the front axle [m]; less than the wheelbase");
  keys.add("centre_height_m", centre_height_m, between(0, 3), "centre of mass above the road [m]");
  keys.add("axle_height_m", axle_height_m, between(0.05, 1),
           "rear axle, the body's origin, above the road [m]");
  keys.add("drag_area_m2", drag_area_m2, between(0, 10), "drag coefficient times area [m^2]");
  keys.add("downforce_area_front_m2", downforce_area_front_m2, between(0, 10),
           "downforce coefficient times area, on the front axle [m^2]");
  keys.add("downforce_area_rear_m2", downforce_area_rear_m2, between(0, 10), "and on the rear axle [m^2]");
  keys.add("power_w", power_w, between(1000, 2e6), "of the engine, on the rear wheels [W]");
  keys.add("friction", friction, between(0.1, 3), "of the tyres, largest force over load");
  keys.add("tyre_b", tyre_b, between(1, 50), "stiffness factor of the Magic Formula [1/rad]");
  keys.add("tyre_c", tyre_c, between(1, 2), "shape factor of the Magic Formula");
  keys.add("max_steering_deg", max_steering_deg, between(1, 60), "of the road wheels [deg]");
  keys.add("max_steering_rate_dps", max_steering_rate_dps, between(5, 1000), "of the road wheels [deg/s]");
  keys.add("length_m", length_m, between(1, 20), "of the body, for other cars [m]");
  keys.add("width_m", width_m, between(0.5, 4), "of the body, for other cars [m]");
  keys.add("height_m", height_m, between(0.5, 5), "of the body, for other cars [m]");
  keys.add("pitch_deg_per_mps2", pitch_deg_per_mps2, between(0, 2),
           "nose down under braking [deg per m/s^2]");
  keys.add("roll_deg_per_mps2", roll_deg_per_mps2, between(0, 2), "leaning out of turns [deg per m/s^2]");
  keys.add("vibration_pitch_deg", vibration_pitch_deg, between(0, 5),
           "rough road at speed, amplitude at 4.3 Hz [deg]");
  keys.add("vibration_roll_deg", vibration_roll_deg, between(0, 5),
           "rough road at speed, amplitude at 2.7 Hz [deg]");
  keys.add("vibration_heave_m", vibration_heave_m, between(0, 0.2),
           "rough road at speed, amplitude at 3.1 Hz [m]");
}

void DriverOptions::describe(OptionList& keys) {
  keys.add("margin_m", margin_m, between(0.5, 20),
           "racing line: from the car's middle to the edges of the road [m]");
  keys.add("grip_share", grip_share, between(0.1, 0.98), "of the tyres' friction that the driver plans with");
  keys.add("acceleration_limit_mps2", acceleration_limit_mps2, between(0.5, 50),
           "that the driver asks for [m/s^2]");
  keys.add("braking_limit_mps2", braking_limit_mps2, between(0.5, 60), "that the driver plans with [m/s^2]");
  keys.add("lookahead_s", lookahead_s, between(0.05, 3), "steering looks this far ahead [s] ...");
  keys.add("lookahead_min_m", lookahead_min_m, between(1, 50), "... but at least so far [m]");
  keys.add("steering_gain_deg_per_m", steering_gain_deg_per_m, between(0.01, 20),
           "steering per offset from the line at the lookahead [deg/m], at 10 m/s; it falls with the speed");
  keys.add("yaw_damping_s", yaw_damping_s, between(0, 2),
           "steering against a yaw rate that the line does not ask for [rad per rad/s]");
  keys.add("wander_m", wander_m, between(0, 5),
           "how far laps differ from the racing line, standard deviation [m]");
  keys.add("wander_length_m", wander_length_m, between(50, 10'000), "over this length of road [m]");
}

}  // namespace raceloc
