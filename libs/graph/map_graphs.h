/** \file
 * The two graphs of a survey, and both in one: which factors each has. */
#pragma once

#include <vector>

#include "core/options.h"
#include "graph/keyframe.h"
#include "graph/loop_closure.h"
#include "graph/optimise.h"

namespace raceloc {

/** Section [graph]. */
struct GraphOptions {
  double odometry_sigma_m = 0.03;
  double odometry_sigma_deg = 0.05;
  double gps_min_sigma_m = 0.05;
  double gps_robust_width = 2.0;
  double gps_refuse_sigma = 8;
  double gps_poor_sigma_m = 0.5;
  double gps_span_gap_s = 2;
  double gps_chain_share = 0.002;
  double gps_chain_reach_s = 60;
  double attitude_min_sigma_deg = 0.05;
  double level_sigma_deg = 5.0;
  int max_iterations = 100;
  void describe(OptionList& keys);
};

/** Factors between key poses of one drive, and on them. GPS is p + R l - z, attitude Log(R_ins' R), both whitened by
 * their floored covariances, with a Cauchy loss. Where no INS gives the attitude, the accelerometer's level does, or
 * else roll and pitch are zero within level_sigma_deg: positions along a straight do not fix the roll about it. A drive
 * without fixes that are believed, and each drive of L, is held at its start as weakly as by 100 m and 30 deg.
 * Source: reading.md section 3, eq_gps_factor, eq_lidar_factor, eq_loop_factor. */
enum class GraphKind {
  gps,  ///< G: gyro and wheels between the key poses (LiDAR odometry where they were silent), GPS and INS on them
  lidar,  ///< L: LiDAR odometry and loops, level
  joint   ///< all of L and of G but its own odometry
};

struct GraphSolution {
  std::vector<Pose> T_map_body;  ///< one a key pose
  double cost;                   ///< half the sum of squared whitened (robust) residuals
  bool converged;                ///< as of optimise()
};

/** Odometry aligned with GPS, drive by drive (alignGraphs()): where a solution starts. A drive without fixes stays at
 * its own origin. */
[[nodiscard]] std::vector<Pose> alignedOdometry(const std::vector<Keyframe>& keyframes);

/** Minimises a graph from a start. The width of the loss on fixes begins 64 times as wide and shrinks: a start that is
 * metres off must not take the truth for a lie. A joint graph without any GPS is held at its first pose.
 * \throws std::invalid_argument for fewer than 2 key poses, or a start of another length */
[[nodiscard]] GraphSolution solveGraph(GraphKind kind, const std::vector<Keyframe>& keyframes,
                                       const std::vector<LoopEdge>& loops, std::vector<Pose> T_start,
                                       const GraphOptions& options);

/** The factors of a graph over such poses, but for its loops. */
[[nodiscard]] PoseGraph graphWithoutLoops(GraphKind kind, const std::vector<Keyframe>& keyframes,
                                          std::vector<Pose> T_map_body, const GraphOptions& options);
[[nodiscard]] Factor loopFactor(const LoopEdge& loop);

/** The odometry's covariance, no better than the options say. */
[[nodiscard]] Matrix6d flooredOdometry(const Matrix6d& covariance, const GraphOptions& options);

/** A fix's covariance, likewise. */
[[nodiscard]] Eigen::Matrix3d flooredFix(const Eigen::Matrix3d& covariance, const GraphOptions& options);

/** Of the fixes that were not refused, all axes together; 0 without any. [m] */
[[nodiscard]] double gpsRmse(const std::vector<Keyframe>& keyframes, const std::vector<Pose>& T_map_body);

}  // namespace raceloc
