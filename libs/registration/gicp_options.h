#pragma once

#include <raceloc/gpu/matcher.h>

#include "core/options.h"

namespace raceloc {

/** Section [registration]. */
struct GicpOptions {
  double voxel_size_m = 1.0;
  int max_iterations = 60;
  double translation_epsilon_m = 1e-3;
  double rotation_epsilon_deg = 0.02;
  int neighbour_voxels = 1;
  double robust_width = 3.0;
  double max_distance_m = 2.0;
  double min_inlier_share = 0.4;
  double max_residual_m = 0.5;
  double covariance_scale = 50;
  double min_sigma_m = 0.03;
  double min_sigma_deg = 0.05;
  void describe(OptionList& keys);
  [[nodiscard]] gpu::MatchOptions forKernels() const;
};

}  // namespace raceloc
