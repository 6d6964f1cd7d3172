#include "registration/align.h"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>

namespace raceloc {

namespace {

/** No match is better than its map: adds the floor to every axis. */
Matrix6d floored(Matrix6d covariance, double min_sigma_rad, double min_sigma_m) {
  covariance.diagonal().head<3>().array() += min_sigma_rad * min_sigma_rad;
  covariance.diagonal().tail<3>().array() += min_sigma_m * min_sigma_m;
  return covariance;
}

template <class Target>
Registration alignTo(gpu::Context& context, const CovarianceCloud& source, const Target& target,
                     const Pose& T_target_source_guess, const GicpOptions& options) {
  const gpu::Match match = gpu::match(context, viewOf(source.cloud), source.covariances.view(), target,
                                      toTransform(T_target_source_guess), options.forKernels());
  const Matrix6d H = Eigen::Map<const Matrix6d>(match.last.H.data());
  const auto pairs = static_cast<double>(std::max<std::int64_t>(1, match.last.pairs));
  const auto points = static_cast<double>(std::max<std::size_t>(1, source.cloud.size()));

  Registration r;
  r.T_target_source = toPose(match.T_map_source);
  r.inlier_share = static_cast<double>(match.last.inliers) / points;
  r.residual_m = std::sqrt(match.last.squared_distance_m2 / pairs);
  r.iterations = match.iterations;
  r.stop = match.stop;

  // A direction without information gets a large, finite variance: the ridge is 1e-6 of a point's.
  const Eigen::SelfAdjointEigenSolver<Matrix6d> eigen(H);
  const Vector6d information = eigen.eigenvalues().cwiseMax(1e-6);
  const Matrix6d inverse =
      eigen.eigenvectors() * information.cwiseInverse().asDiagonal() * eigen.eigenvectors().transpose();
  r.covariance =
      floored(options.covariance_scale * inverse, options.min_sigma_deg * M_PI / 180, options.min_sigma_m);
  r.information = r.covariance.inverse();
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> position(r.covariance.bottomRightCorner<3, 3>());
  r.weakest_direction = position.eigenvectors().col(2);
  r.weakest_sigma_m = std::sqrt(position.eigenvalues()[2]);
  return r;
}

}  // namespace

Registration align(gpu::Context& context, const CovarianceCloud& source, const gpu::VoxelMap& target,
                   const Pose& T_target_source_guess, const GicpOptions& options) {
  return alignTo(context, source, target, T_target_source_guess, options);
}

Registration align(gpu::Context& context, const CovarianceCloud& source, const gpu::NearestTarget& target,
                   const Pose& T_target_source_guess, const GicpOptions& options) {
  return alignTo(context, source, target, T_target_source_guess, options);
}

}  // namespace raceloc
