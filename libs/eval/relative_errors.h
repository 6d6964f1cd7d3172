/** \file
 * Errors of motions instead of poses: what an offset of the whole trajectory does not hide. */
#pragma once

#include <string>
#include <vector>

#include "eval/pose_errors.h"

namespace raceloc {

/** Mean drift over all segments of one length, wherever they start. */
struct RelativeError {
  double length_m;
  std::size_t segments;  ///< 0: the path is too short, and the rest is no number to believe
  double translation_percent, rotation_deg_per_m;
};

/** The segment from pose i to j, the first at least `length_m` further on along the truth, is off by
 * (T_i^-1 T_j)_estimate^-1 (T_i^-1 T_j)_truth, over the length of the segment itself: sparse poses overshoot the
 * nominal length, by which KITTI's own tool divides. Source: Geiger et al., CVPR 2012. */
[[nodiscard]] RelativeError relativeError(const std::vector<PoseError>& poses, double length_m);

/** How far apart the two poses of a relative pose error are. */
struct RpeStep {
  enum class Unit { seconds, metres } unit;
  double length;  ///< > 0
};
[[nodiscard]] std::string text(const RpeStep& step);  ///< "1 s", "10 m"

/** Relative pose error (RPE) over all steps of one length. */
struct RelativePoseError {
  RpeStep step;
  std::size_t pairs;  ///< 0: the drive is too short, and the rest is no number to believe
  Statistics translation_m, rotation_deg;
};

/** Pairs follow one another: each begins where the one before ended, and ends at the first pose that is at least one
 * step later, or further on along the truth. A hole between poses is one step, however long. Error of the pair (i, j):
 * E = (T_i^-1 T_j)_truth^-1 (T_i^-1 T_j)_estimate; length of its translation, angle of its rotation.
 * Source: Sturm et al., IROS 2012; pairs as evo makes them with `pairs_from_reference` and without `all_pairs`. */
[[nodiscard]] RelativePoseError relativePoseError(const std::vector<PoseError>& poses, const RpeStep& step);

}  // namespace raceloc
