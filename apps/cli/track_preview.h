#pragma once

#include <string>

#include "sim/speed_profile.h"
#include "track/circuit.h"

namespace raceloc {

/** A PNG of a circuit from above, drawn by gnuplot: road, walls and what stands beside it, the racing line coloured
 * by its speed, a numbered way-point every 100 m, the start and the direction of driving.
 * \throws InputError if gnuplot is not installed. */
[[nodiscard]] std::string trackPreview(const Circuit& circuit, const RacingLine& line,
                                       const SpeedProfile& profile);

}  // namespace raceloc
