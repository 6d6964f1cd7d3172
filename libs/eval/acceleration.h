/** \file
 * Accelerations from positions. */
#pragma once

#include <vector>

#include "eval/pose_errors.h"

namespace raceloc {

/** In the plane, in the axes of the car. */
struct Acceleration {
  double along_mps2, across_mps2;  ///< ahead and left are positive
};

/** Of the truth, at each pose whose neighbourhood of +-0.3 s has at least five poses, on both sides: twice the coefficient of
 * time squared of the parabola of least squares through their positions. Source: Savitzky and Golay, Analytical Chemistry 1964,
 * degree 2, for uneven times. */
[[nodiscard]] std::vector<Acceleration> accelerations(const std::vector<PoseError>& poses);

}  // namespace raceloc
