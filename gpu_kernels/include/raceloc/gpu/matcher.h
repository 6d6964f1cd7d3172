/** \file
 * GICP and VGICP: distribution to distribution, against the nearest point or a voxel map. Source: Segal et al., RSS
 * 2009 (cost); Koide et al., ICRA 2021 (voxels); Sola et al., arXiv:1812.01537, Eq. (25) (right increments). */
#pragma once

#include <array>
#include <vector>

#include "raceloc/gpu/context.h"
#include "raceloc/gpu/nearest_target.h"
#include "raceloc/gpu/prepare.h"
#include "raceloc/gpu/types.h"
#include "raceloc/gpu/voxel_map.h"

namespace raceloc::gpu {

struct MatchOptions {
  int max_iterations = 30;              ///< Gauss-Newton steps, >= 1
  double translation_epsilon_m = 1e-3;  ///< stop when a step is shorter, > 0 ...
  double rotation_epsilon_rad = 1e-3;   ///< ... and turns less, > 0
  int neighbour_voxels = 1;     ///< 1, 7 (faces) or 27 voxels are tried around a point; each hit is a pair
  double robust_width = 1.0;    ///< Cauchy width on the whitened residual; 0: plain least squares
  double max_distance_m = 2.0;  ///< pairs farther apart do not count, > 0
};

/** One linearisation at T: cost = 1/2 sum rho(e' (C_map + R C_src R')^-1 e), e = mean - (R p + t). */
struct Linearization {
  std::array<double, 36> H{};  ///< 6x6 Gauss-Newton Hessian, rows; right increment (rotation, translation)
  std::array<double, 6> b{};   ///< gradient: the step solves H xi = -b
  double cost = 0;             ///< robust cost summed over pairs
  /** Sum over pairs of e' W e / trace W, W the inverse of the pair's covariance: the squared distance across
   * the surface where there is one (its axis then is nearly all of the trace), |e|^2 / 3 where there is none. */
  double squared_distance_m2 = 0;
  std::int64_t pairs = 0;    ///< point-voxel pairs that counted
  std::int64_t inliers = 0;  ///< source points with at least one pair
};

enum class Stop { converged, max_iterations, too_few_inliers, singular, not_finite };

struct Match {
  Transform T_map_source;
  Linearization last;  ///< at T_map_source; when converged, at the pose before the last step, which is short
  int iterations = 0;
  Stop stop = Stop::max_iterations;  ///< only `converged` is a success
};

/** The VGICP pass. \throws std::invalid_argument if points and covariances differ in number. */
[[nodiscard]] Linearization linearize(Context& context, const PointsView& source,
                                      const CovariancesView& covariances, const VoxelMap& map,
                                      const Transform& T_map_source, const MatchOptions& options);

/** The GICP pass: a point's pair is the nearest of the target within max_distance_m; neighbour_voxels has no say. */
[[nodiscard]] Linearization linearize(Context& context, const PointsView& source,
                                      const CovariancesView& covariances, const NearestTarget& target,
                                      const Transform& T_target_source, const MatchOptions& options);

/** Gauss-Newton from a guess, steps damped (Levenberg-Marquardt) when the cost over the same pairs would
 * grow. Fewer than 10 source points or fewer than 10 inliers give Stop::too_few_inliers and the guess.
 * \throws as linearize(), or for an option out of range. */
[[nodiscard]] Match match(Context& context, const PointsView& source, const CovariancesView& covariances,
                          const VoxelMap& map, const Transform& T_map_source_guess,
                          const MatchOptions& options);

[[nodiscard]] Match match(Context& context, const PointsView& source, const CovariancesView& covariances,
                          const NearestTarget& target, const Transform& T_target_source_guess,
                          const MatchOptions& options);

/** match() of what prepare() gave, unchanged: where the context's device still has it, it is not sent there again. */
[[nodiscard]] Match match(Context& context, const PreparedScan& source, const VoxelMap& map,
                          const Transform& T_map_source_guess, const MatchOptions& options);

/** match() from each of several guesses: points go to the device once. */
[[nodiscard]] std::vector<Match> matchAll(Context& context, const PointsView& source,
                                          const CovariancesView& covariances, const VoxelMap& map,
                                          const std::vector<Transform>& T_map_source_guesses,
                                          const MatchOptions& options);

}  // namespace raceloc::gpu
