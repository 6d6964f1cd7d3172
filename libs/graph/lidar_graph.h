/** \file
 * Batch pose graph: LiDAR odometry between key poses, GPS positions on them. */
#pragma once

#include <vector>

#include "core/options.h"
#include "graph/keyframe.h"

namespace raceloc {

/** Section [graph]. */
struct GraphOptions {
  double odometry_sigma_m = 0.05;
  double odometry_sigma_deg = 0.1;
  double gps_min_sigma_m = 0.05;
  double gps_robust_width = 2.0;
  double attitude_min_sigma_deg = 0.05;
  double level_sigma_deg = 5.0;
  int max_iterations = 100;
  void describe(OptionList& keys);
};

struct GraphSolution {
  std::vector<Pose> T_map_body;     ///< one a key pose
  double initial_cost, final_cost;  ///< half the sum of squared whitened (robust) residuals
  double gps_rmse_m;                ///< over the key poses that had GPS, horizontal and vertical together
  std::size_t gps_factors;
  bool converged;  ///< false: it ran into max_iterations
};

/** Aligns odometry with GPS (yaw and translation, closed form), then minimises over all key poses
 * - between: log(T_ij^-1 T_i^-1 T_j), whitened by the odometry's covariance floored as the options say;
 * - GPS: p + R r - z, whitened by the fix's floored covariance, Cauchy loss;
 * - attitude: log(R_ins' R) where an INS gave one; else roll and pitch are held level by `level_sigma_deg`,
 * because positions along a straight do not fix the roll about it. Without any GPS the first pose is held at
 * the identity: the map frame is then the odometry's. Solved by optimise(). Source: reading.md section 3,
 * eq_gps_factor, eq_lidar_factor. \throws std::invalid_argument for fewer than 2 key poses. */
[[nodiscard]] GraphSolution solveLidarGraph(const std::vector<Keyframe>& keyframes,
                                            const GraphOptions& options);

/** Yaw and translation that bring `from` onto `to` (N >= 1 pairs; one pair: translation alone) in the least
 * squares sense; roll and pitch stay, because both frames are level. */
[[nodiscard]] Pose alignLevel(const std::vector<Eigen::Vector3d>& from,
                              const std::vector<Eigen::Vector3d>& to);

}  // namespace raceloc
