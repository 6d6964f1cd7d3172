/** \file
 * A simulated car that steers by what it measures, into trouble and out of it: the paper's two experiments on resilient
 * navigation, and any other. */
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "sim/fault_options.h"
#include "sim/race.h"
#include "wall/guard.h"
#include "wall/wall_follower.h"

namespace raceloc {

/** A drive of seconds. */
struct ClosedLoopOptions {
  double from_m = 0;       ///< station of the start
  double duration_s = 8;   ///< it ends sooner when a wheel touches a wall
  bool is_guarded = true;  ///< false: the line that is told is driven, whatever the gate and the walls say
  /** What goes wrong, in seconds since the start; labels of the car's devices, and kMatchLabel as a receiver. */
  std::vector<Fault> faults;
  std::uint64_t seed = 1;
};

/** Every receiver and the scan match drift off, to the left of the road as it lies at a station: the first at
 * `drift_mps`, each other one half of that faster than the one before, all with noise on each axis and the claims that
 * they had. No two agree. */
[[nodiscard]] std::vector<Fault> everySourceDrifts(const Track& track, const CarFile& car, double there_m,
                                                   double from_s, double to_s, double drift_mps,
                                                   double noise_m = 1);

/** What happened at one instant. */
struct ClosedLoopRow {
  double time_s;                ///< since the start
  double station_m;             ///< truth
  double speed_mps;             ///< truth
  double steering_command_rad;  ///< to the road wheels, left positive
  double wheel_to_wall_m;       ///< truth, see wheelToWall_m()
  double gap_m;  ///< truth, of the rear axle to the wall on the guard's side, at its height; NaN: none
  double believed_left_m;  ///< of the believed position to the true one, across the true heading
  bool alarm;              ///< no source confirms the estimate
  GuardState guard;        ///< `localized` where there is none
  double seen_gap_m;       ///< by the detector, on the guard's side; NaN: no wall
};

struct ClosedLoopDrive {
  std::vector<ClosedLoopRow> rows;  ///< at 100 Hz; of the last one, wheel_to_wall_m <= 0 means a crash
  [[nodiscard]] bool hasHit() const { return rows.back().wheel_to_wall_m <= 0; }
};

/** A circuit, a car and a line that the car is told to drive; the same arguments give the same drive, bit for bit. */
class ClosedLoop {
 public:
  /** The circuit must outlive it. Of the car's devices: all receivers, the first IMU and vehicle, and those LiDARs that
   * match `lidars`, all of which sweep at once. \throws InputError for a circuit that is not level along its
   * centre line, and for a car without a receiver (heading = body), IMU or vehicle, or without such a LiDAR */
  ClosedLoop(const Circuit& circuit, const CarFile& car, const std::string& lidars, std::uint64_t seed);

  /** \param told  what the car is told to drive; it starts there */
  [[nodiscard]] ClosedLoopDrive drive(const RacingLine& told, const ClosedLoopOptions& options,
                                      const GuardOptions& guard, const WallPathOptions& wall_path) const;

 private:
  const Circuit& x_circuit;
  CarFile x_car;
  World x_world;
};

/** A line at a distance from the wall of a side, all round the circuit. \param gap_m  from the middle of the rear axle
 * \throws InputError naming the first station without such a wall */
[[nodiscard]] RacingLine lineAlongWall(const Circuit& circuit, const CarOptions& car, Side side,
                                       double gap_m);

/** The racing line, moved towards the right by up to `shift_m` between two stations, over `ramp_m` at both ends: a line
 * that was drawn on a picture of the circuit that lies elsewhere. */
[[nodiscard]] RacingLine shiftedLine(const Track& track, const RacingLine& line, double from_m, double to_m,
                                     double ramp_m, double shift_m);

}  // namespace raceloc
