/** \file
 * Kernel-weighted covariances of the paper (Table of kernel descriptors), as reading.md section 4 defines
 * them. */
#pragma once

#include "raceloc/gpu/context.h"
#include "raceloc/gpu/types.h"

namespace raceloc::gpu {

/** Weight of a neighbour at offset d, all 1 at d = 0:
 * rbf exp(-gamma |d|^2); gaussian exp(-|d|^2 / (2 sigma^2)); laplacian exp(-|d| / sigma);
 * polynomial (1 + (alpha/c) |d|^2)^(-degree/2); hist max(0, 1 - |d|_1 / (3 s)). */
enum class Weight { rbf, gaussian, polynomial, hist, laplacian };

/** What makes a raw covariance fit for registration: `plane` sets its eigenvalues to (plane_epsilon, 1, 1) as
 * GICP does, `min_eig` raises them to plane_epsilon times the largest, `none` leaves them. */
enum class Regularisation { plane, min_eig, none };

/** Which points are neighbours: all within a radius, weighted; or the k nearest, all of weight 1 (plain GICP, for
 * comparison: on the CPU, whatever the context). */
enum class Neighbourhood { radius, nearest };

inline constexpr int kMostNearest = 64;

struct CovarianceOptions {
  Neighbourhood neighbourhood = Neighbourhood::radius;
  int nearest = 10;  ///< neighbours of `nearest`, the point itself included, in [4, kMostNearest]
  Weight weight = Weight::laplacian;
  Regularisation regularisation = Regularisation::plane;
  float radius_m = 1.0F;                 ///< neighbours are within this distance, > 0
  float rbf_gamma_per_m2 = 1.0F;         ///< > 0
  float gaussian_sigma_m = 0.5F;         ///< > 0
  float laplacian_sigma_m = 0.5F;        ///< > 0
  float polynomial_alpha_per_m2 = 1.0F;  ///< > 0
  float polynomial_c = 1.0F;             ///< > 0
  int polynomial_degree = 2;             ///< >= 1
  float hist_s_m = 1.0F;                 ///< > 0; the radius is a good choice
  float plane_epsilon = 4e-4F;           ///< in (0, 1]; of 1 m along a surface, the 2 cm of a LiDAR across it
  /** With fewer the covariance is isotropic and says so by `neighbours`: of variance radius^2 [m^2], for `plane`
   * of 4 among its 1s. */
  int min_neighbours = 5;
};

/** For every point i over its neighbours j within the radius: mu = sum w p / sum w, C = sum w (p-mu)(p-mu)' /
 * sum w, then regularised. Neighbours come from a cell list, built once. A neighbourhood that is one point,
 * or for `plane` has no normal (the two smallest eigenvalues closer than 1e-3 of the largest), gets the
 * isotropic covariance as well. \param into  what is no longer needed: its memory is used again
 * \throws std::invalid_argument for a point that is not finite (drop them with voxelGrid first) or an option out of
 * range. */
[[nodiscard]] Covariances covariances(Context& context, const PointsView& points,
                                      const CovarianceOptions& options, Covariances into = {});

}  // namespace raceloc::gpu
