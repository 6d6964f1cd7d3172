/** \file
 * Limits of normalised innovations. */
#pragma once

namespace raceloc {

/** The value that a chi-square variable exceeds with probability `false_alarm`, to about 1e-13 relative.
 * Closed form for two degrees of freedom, Newton's method on the closed form of the tail for three
 * (Abramowitz and Stegun, 26.4.4 and 26.4.5).
 * \param false_alarm  (0, 1]
 * \param degrees_of_freedom  2 or 3
 * \throws std::invalid_argument for any other */
[[nodiscard]] double chiSquareLimit(double false_alarm, int degrees_of_freedom);

}  // namespace raceloc
