#include "registration/gicp_options.h"

#include <cmath>

namespace raceloc {

void GicpOptions::describe(OptionList& keys) {
  keys.add("voxel_size_m", voxel_size_m, above(0), "edge of a target voxel [m]");
  keys.add("max_iterations", max_iterations, between(1, 1000), "Gauss-Newton steps at most");
  keys.add("translation_epsilon_m", translation_epsilon_m, above(0),
           "converged when a step is shorter [m] ...");
  keys.add("rotation_epsilon_deg", rotation_epsilon_deg, above(0), "... and turns less [deg]");
  keys.add("neighbour_voxels", neighbour_voxels, {{"1", 1}, {"7", 7}, {"27", 27}},
           "voxels tried around a point");
  keys.add("robust_width", robust_width, atLeast(0),
           "width of the Cauchy loss in sigmas; 0: plain least squares");
  keys.add("max_distance_m", max_distance_m, above(0), "pairs farther apart do not count [m]");
  keys.add("min_inlier_share", min_inlier_share, between(0, 1),
           "a match with fewer points in pairs is not trusted");
  keys.add("max_residual_m", max_residual_m, above(0),
           "nor one whose pairs are farther apart across the surface [m]");
  keys.add("covariance_scale", covariance_scale, atLeast(1),
           "points of one surface share their error: the covariance is this many times the inverse Hessian");
  keys.add("min_sigma_m", min_sigma_m, above(0), "no match is better than this along any axis [m]");
  keys.add("min_sigma_deg", min_sigma_deg, above(0), "nor than this about any axis [deg]");
}

gpu::MatchOptions GicpOptions::forKernels() const {
  gpu::MatchOptions o;
  o.max_iterations = max_iterations;
  o.translation_epsilon_m = translation_epsilon_m;
  o.rotation_epsilon_rad = rotation_epsilon_deg * M_PI / 180;
  o.neighbour_voxels = neighbour_voxels;
  o.robust_width = robust_width;
  o.max_distance_m = max_distance_m;
  return o;
}

}  // namespace raceloc
