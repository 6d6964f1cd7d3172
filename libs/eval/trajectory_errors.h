/** \file
 * How far an estimated trajectory is from the truth. Pure, but for readTrajectoryFile(). */
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "core/trajectory.h"
#include "eval/breakdown.h"
#include "eval/pose_errors.h"
#include "eval/relative_errors.h"

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
  se3,   ///< the estimate is moved rigidly to the least squared distance first: for odometry without
         ///< georeference
  axes   ///< as se3; then its body frame is turned by the mean of the turns to the truth's, the same at all
         ///< poses: for a truth whose body axes are calibrated otherwise, which would count as drift. On a
         ///< straight way the turn about it is arbitrary
};

/** As options and files spell it. */
[[nodiscard]] const char* nameOf(Alignment alignment);

struct EvalOptions {
  double max_gap_s = 0.5;  ///< truth poses further apart are not interpolated between, > 0
  Alignment align = Alignment::none;
  std::vector<double> segment_lengths_m = {20, 40, 80};  ///< of the relative errors, each > 0
  std::vector<RpeStep> rpe_steps = {{RpeStep::Unit::seconds, 1}, {RpeStep::Unit::metres, 10}};
  int sectors = 12;           ///< parts of a lap, >= 1
  double speed_bin_mps = 10;  ///< > 0
};

struct Evaluation {
  TrajectoryFile truth, estimate;
  EvalOptions options;
  std::size_t outside_truth;              ///< estimate poses before the truth starts or after it ends
  std::size_t in_gaps;                    ///< estimate poses where the truth has a gap
  std::vector<PoseError> poses;           ///< the matched ones, in order of time; never empty
  Pose T_map_estimate_frame;              ///< the alignment: identity without one
  Eigen::Matrix3d R_estimate_truth_body;  ///< likewise of the body's axes: identity but for Alignment::axes
  Statistics position_3d_m, position_plane_m, lateral_m, longitudinal_m, height_m, heading_deg;
  std::vector<RelativeError> relative;  ///< one for each of the segment lengths
  std::vector<RelativePoseError> rpe;   ///< one for each of the steps
  std::vector<double> lap_starts_m;     ///< of lapStarts()
  std::vector<ErrorBin> by_lap, by_sector, by_speed;
  double path_length_m, min_speed_mps, max_speed_mps;
  std::vector<std::string> warnings;  ///< likely mix-ups of frames, one sentence each

  [[nodiscard]] double matchShare() const;
  [[nodiscard]] double coveredTruth_s() const;         ///< from the first matched pose to the last
  [[nodiscard]] Eigen::Vector3d bodyTurn_deg() const;  ///< rotation vector of R_estimate_truth_body
};

/** The truth at `stamp_s`, position linear and attitude by slerp; nothing outside its span or in a gap.
 * \param truth  poses in order of time, at least one */
[[nodiscard]] std::optional<Pose> interpolated(const std::vector<StampedPose>& truth, double stamp_s,
                                               double max_gap_s);

/** Errors of the estimate at each of its stamps.
 * \throws InputError naming both files if less than half of the estimate has a truth; if there is too little to
 * align; and without alignment, if both say where their map lies and differ, or if they show it (frameMismatches()).
 * Source: Sturm et al., IROS 2012 (ATE); Umeyama, PAMI 1991; Moakher, SIAM J. Matrix Anal. Appl. 2002 (projected
 * arithmetic mean of rotations). */
[[nodiscard]] Evaluation evaluate(TrajectoryFile truth, TrajectoryFile estimate, const EvalOptions& options);

}  // namespace raceloc
