/** \file
 * How far an estimated trajectory is from the truth. Pure, but for readTrajectoryFile(). */
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "core/trajectory.h"

namespace raceloc {

/** A trajectory with what a message or a report says about its file. */
struct TrajectoryFile {
  std::string path;  ///< as the user gave it
  std::uintmax_t bytes;
  Trajectory trajectory;  ///< at least one pose
};

/** \throws InputError as readTum() does. */
[[nodiscard]] TrajectoryFile readTrajectoryFile(const std::string& path);

enum class Alignment {
  none,  ///< both are taken to be in one map frame
  se3    ///< the estimate is moved rigidly to the least squared distance first: for odometry without
         ///< georeference
};

struct EvalOptions {
  double max_gap_s = 0.5;  ///< truth poses further apart are not interpolated between, > 0
  Alignment align = Alignment::none;
  std::vector<double> segment_lengths_m = {20, 40, 80};  ///< of the relative errors, each > 0
};

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

/** Mean drift over all segments of one length, wherever they start. */
struct RelativeError {
  double length_m;
  std::size_t segments;  ///< 0: the path is too short, and the rest is no number to believe
  double translation_percent, rotation_deg_per_m;
};

struct Evaluation {
  TrajectoryFile truth, estimate;
  EvalOptions options;
  std::size_t outside_truth;     ///< estimate poses before the truth starts or after it ends
  std::size_t in_gaps;           ///< estimate poses where the truth has a gap
  std::vector<PoseError> poses;  ///< the matched ones, in order of time; never empty
  Pose T_map_estimate_frame;     ///< the alignment: identity without one
  Statistics position_3d_m, position_plane_m, lateral_m, longitudinal_m, height_m, heading_deg;
  std::vector<RelativeError> relative;  ///< one for each of the segment lengths
  double path_length_m, min_speed_mps, max_speed_mps;
  std::vector<std::string> warnings;  ///< likely mix-ups of frames, one sentence each

  [[nodiscard]] double matchShare() const;
  [[nodiscard]] double coveredTruth_s() const;  ///< from the first matched pose to the last
};

/** The truth at `stamp_s`, position linear and attitude by slerp; nothing outside its span or in a gap.
 * \param truth  poses in order of time, at least one */
[[nodiscard]] std::optional<Pose> interpolated(const std::vector<StampedPose>& truth, double stamp_s,
                                               double max_gap_s);

/** Errors of the estimate at each of its stamps.
 * The relative error of a segment from pose i to j, the first at least `length_m` further on along the truth,
 * is (T_i^-1 T_j)_estimate^-1 (T_i^-1 T_j)_truth over the length of the segment itself: sparse poses
 * overshoot the nominal length, by which KITTI's own tool divides. \throws InputError naming both files if
 * less than half of the estimate has a truth, if both say where their map lies and differ (Alignment::none
 * only), or if there is too little to align. Source: Sturm et al., IROS 2012 (ATE); Geiger et al., CVPR 2012
 * (relative errors); Umeyama, PAMI 1991. */
[[nodiscard]] Evaluation evaluate(TrajectoryFile truth, TrajectoryFile estimate, const EvalOptions& options);

}  // namespace raceloc
