/** \file
 * One graph brought onto the other: "ICP between the graphs", with known correspondences. */
#pragma once

#include <vector>

#include "core/types.h"

namespace raceloc {

struct GraphAlignment {
  Pose T_to_from;
  double rmse_m;        ///< of the pairs that count at least half
  double inlier_share;  ///< of those among all pairs
};

/** The rigid motion (SE(3), no scale) that brings points onto their partners, in spite of partners that are wrong:
 * weighted least squares in closed form, weights of Geman and McClure whose width is twice the median distance, at
 * least `width_m`, until nothing moves. It starts from all pairs or from a tenth of them in a row, whichever leaves
 * the least median distance: up to 40 % may be wrong, also all the same way. Points along a straight leave the roll
 * about it open, so the `up` vectors of both frames are a pair of directions too, as good as 1 deg.
 * \param from, to  N >= 2 pairs \param up_from, up_to  unit vectors
 * \throws std::invalid_argument for fewer than 2 pairs or lengths that differ
 * Source: reading.md section 3; Arun et al., PAMI 9(5), 1987 (closed form); Geman and McClure as in Zhang, Parameter
 * estimation techniques, 1997; the start: Rousseeuw, Least median of squares regression, 1984. */
[[nodiscard]] GraphAlignment alignGraphs(const std::vector<Eigen::Vector3d>& from,
                                         const std::vector<Eigen::Vector3d>& to,
                                         const Eigen::Vector3d& up_from = Eigen::Vector3d::UnitZ(),
                                         const Eigen::Vector3d& up_to = Eigen::Vector3d::UnitZ(),
                                         double width_m = 0.5);

/** Where the bodies are: what alignGraphs() takes. */
[[nodiscard]] std::vector<Eigen::Vector3d> positionsOf(const std::vector<Pose>& T_map_body);

}  // namespace raceloc
