/** \file
 * Clouds with a covariance at every point: what registration takes. */
#pragma once

#include <raceloc/gpu/covariance.h>

#include "core/options.h"
#include "core/types.h"

namespace raceloc {

/** Points and their covariances, one each, in one frame. */
struct CovarianceCloud {
  Cloud cloud;
  gpu::Covariances covariances;
};

[[nodiscard]] gpu::PointsView viewOf(const Cloud& cloud);
[[nodiscard]] gpu::Transform toTransform(const Pose& pose);
[[nodiscard]] Pose toPose(const gpu::Transform& transform);

/** Section [covariance]: the kernel that weighs the neighbours of a point (paper, table of kernel
 * descriptors). */
struct CovarianceOptions {
  gpu::Neighbourhood neighbourhood = gpu::Neighbourhood::radius;
  int nearest = 10;
  gpu::Weight kernel = gpu::Weight::laplacian;
  gpu::Regularisation regularisation = gpu::Regularisation::plane;
  double radius_m = 1.0;
  double rbf_gamma_per_m2 = 1.0;
  double gaussian_sigma_m = 0.5;
  double laplacian_sigma_m = 0.5;
  double polynomial_alpha_per_m2 = 1.0;
  double polynomial_c = 1.0;
  int polynomial_degree = 2;
  double hist_s_m = 1.0;
  double plane_epsilon = 4e-4;
  int min_neighbours = 5;
  void describe(OptionList& keys);
  [[nodiscard]] gpu::CovarianceOptions forKernels() const;
};

/** \param cloud finite points. Source: reading.md section 4.
 * \param into  what is no longer needed: its memory is used again
 * \throws std::invalid_argument as gpu::covariances(). */
[[nodiscard]] CovarianceCloud withCovariances(gpu::Context& context, Cloud cloud,
                                              const CovarianceOptions& options, gpu::Covariances into = {});

}  // namespace raceloc
