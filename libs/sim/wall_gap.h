/** \file
 * How far a car truly is from the walls of a circuit. */
#pragma once

#include <optional>

#include "sim/race_car.h"
#include "track/circuit.h"

namespace raceloc {

/** Along the road from the rear axle's middle to the face of the nearest wall of a side; none where there is no wall. */
[[nodiscard]] std::optional<double> wallGap_m(const Circuit& circuit, double s_m, double n_m, Side side);

/** The least horizontal distance from the four wheels' outer ends, at the height of the axles, to the face of a wall of
 * either side; not above 0: the car has hit it. Infinite where there is no wall. */
[[nodiscard]] double wheelToWall_m(const Circuit& circuit, const CarOptions& car, const RaceCarState& state);

}  // namespace raceloc
