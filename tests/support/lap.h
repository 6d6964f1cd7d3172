/** \file
 * A car on a shipped circuit, driven for a while. */
#pragma once

#include <string>

#include "sim/race.h"

namespace raceloc::test {

inline std::string shipped(const std::string& path) { return RACELOC_ROOT "/" + path; }

/** What Race sets up, without devices. */
struct Lap {
  explicit Lap(const std::string& track = "lor", const std::string& car_file = "indy", std::uint64_t seed = 1)
      : circuit(readCircuit(shipped("share/tracks/" + track + ".ini"))),
        file(readCarFile(shipped("ini/sim/" + car_file + ".ini"))),
        line(circuit.track, file.driver.margin_m),
        profile(circuit.track, line, file.car, file.driver, circuit.pace),
        car(circuit.track, line, profile, file.car, file.driver, profile.at(0).speed_mps, seed),
        motion(circuit.track, file.car, 1e6) {
    motion.add(car.state());
  }
  /** Drives on and remembers the motion. */
  void driveUntil(double time_s) {
    while (car.state().time_s < time_s) {
      car.step();
      motion.add(car.state());
    }
  }

  Circuit circuit;
  CarFile file;
  RacingLine line;
  SpeedProfile profile;
  RaceCar car;
  TrueMotion motion;
};

}  // namespace raceloc::test
