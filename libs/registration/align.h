/** \file
 * Pose of a scan among voxel Gaussians (VGICP) or points (GICP). */
#pragma once

#include <raceloc/gpu/nearest_target.h>
#include <raceloc/gpu/voxel_map.h>

#include "cloud/covariances.h"
#include "registration/gicp_options.h"

namespace raceloc {

/** Result of align(): not converging is a result, not an exception. */
struct Registration {
  Pose T_target_source;
  Matrix6d covariance;   ///< of the pose, right increment (rad, m), scaled and floored as GicpOptions say
  Matrix6d information;  ///< its inverse
  Eigen::Vector3d
      weakest_direction;   ///< unit vector in the source's frame along which the position is known worst
  double weakest_sigma_m;  ///< and how badly [m]
  double inlier_share;     ///< source points with a pair, 0..1
  double residual_m;       ///< fitness: root mean square distance of the pairs across their surface
  int iterations;
  gpu::Stop stop;
  [[nodiscard]] bool trusted(const GicpOptions& options) const {
    return stop == gpu::Stop::converged && plausible(options);
  }
  /** As trusted(), but it may still have been on its way along the weakest direction. */
  [[nodiscard]] bool plausible(const GicpOptions& options) const {
    return (stop == gpu::Stop::converged || stop == gpu::Stop::max_iterations) &&
           inlier_share >= options.min_inlier_share && residual_m <= options.max_residual_m;
  }
};

/** VGICP: Gauss-Newton on SE(3), right increments.
 * \param source  points with covariances, e.g. body frame [m, m^2]
 * \param target  voxel Gaussians, e.g. map frame; never changed
 * \param T_target_source_guess  within about one voxel and 5 deg of the truth
 * Source: Segal et al., RSS 2009 (cost, with the pair's covariance C_q + R C_p R'); Koide et al., ICRA 2021
 * (voxels). */
[[nodiscard]] Registration align(gpu::Context& context, const CovarianceCloud& source,
                                 const gpu::VoxelMap& target, const Pose& T_target_source_guess,
                                 const GicpOptions& options);

/** GICP: as above, each point against the nearest of the target within max_distance_m. */
[[nodiscard]] Registration align(gpu::Context& context, const CovarianceCloud& source,
                                 const gpu::NearestTarget& target, const Pose& T_target_source_guess,
                                 const GicpOptions& options);

}  // namespace raceloc
