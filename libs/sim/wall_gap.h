/** \file
 * How far a car truly is from the walls of a circuit. */
#pragma once

#include <optional>

#include "sim/race_car.h"
#include "track/circuit.h"

namespace raceloc {

/** Across the road, in parallel to it and `height_m` above it, from a place to the face of the nearest wall of a side: walls
 * are upright, also where the road leans. None where there is no wall. */
[[nodiscard]] std::optional<double> wallGap_m(const Circuit& circuit, double s_m, double n_m, double height_m,
                                              Side side);

/** The least horizontal distance from the four wheels' outer ends, at the height of the axles, to the face of a wall of
 * either side; not above 0: the car has hit it. Infinite where there is no wall. */
[[nodiscard]] double wheelToWall_m(const Circuit& circuit, const CarOptions& car, const RaceCarState& state);

}  // namespace raceloc
