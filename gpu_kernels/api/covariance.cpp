#include "raceloc/gpu/covariance.h"

#include "api/check.hpp"
#include "core/backend.hpp"

namespace raceloc::gpu {

Covariances covariances(Context& context, const PointsView& points, const CovarianceOptions& options) {
  requirePositive("radius_m", options.radius_m);
  requirePositive("rbf_gamma_per_m2", options.rbf_gamma_per_m2);
  requirePositive("gaussian_sigma_m", options.gaussian_sigma_m);
  requirePositive("laplacian_sigma_m", options.laplacian_sigma_m);
  requirePositive("polynomial_alpha_per_m2", options.polynomial_alpha_per_m2);
  requirePositive("polynomial_c", options.polynomial_c);
  requirePositive("hist_s_m", options.hist_s_m);
  require(options.polynomial_degree >= 1, "polynomial_degree", options.polynomial_degree, ">= 1");
  require(options.plane_epsilon > 0 && options.plane_epsilon <= 1, "plane_epsilon", options.plane_epsilon,
          "in (0, 1]");
  require(options.nearest >= 4 && options.nearest <= kMostNearest, "nearest", options.nearest,
          "from 4 to 64");
  requireCountable(points.size);
  for (std::size_t i = 0; i < points.size; ++i) {
    if (!std::isfinite(points.x[i]) || !std::isfinite(points.y[i]) || !std::isfinite(points.z[i]))
      throw std::invalid_argument("covariances: point " + std::to_string(i) + " is not finite");
  }
  if (options.neighbourhood == Neighbourhood::nearest && context.backend() == Backend::cuda)
    return makeCpuBackend(1)->covariances(points, options);
  return context.implementation().covariances(points, options);
}

}  // namespace raceloc::gpu
