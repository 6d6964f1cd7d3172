/** \file
 * The error of one pose, and the figures of many. */
#pragma once

#include <cstddef>
#include <vector>

#include "core/types.h"

namespace raceloc {

constexpr double kStampResolution_s = 1e-6;  ///< of the files

/** rmse, mean, median and std (of the population, 1/N) keep the sign of what they are made of; max is of |x|.
 */
struct Statistics {
  double rmse, mean, median, std, max;
};

/** \throws std::invalid_argument for no value at all. */
[[nodiscard]] Statistics statisticsOf(std::vector<double> values);

/** The estimate at one of its own stamps, and the truth interpolated there. */
struct PoseError {
  std::size_t estimate_index;  ///< in the estimate's file: a jump is a hole in the matching
  double stamp_s;
  Pose T_map_truth, T_map_estimate;  ///< the latter after alignment
  double station_m;                  ///< along the truth, by chords between matched poses
  double speed_mps;                  ///< of the truth, by chords to the neighbours
  double position_3d_m, position_plane_m;
  double longitudinal_m, lateral_m;  ///< along the truth's heading (ahead is positive), across it (left is)
  double height_m;                   ///< up is positive
  double heading_deg;                ///< counter-clockwise is positive, -180 .. 180
};

}  // namespace raceloc
