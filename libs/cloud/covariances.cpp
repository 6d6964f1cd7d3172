#include "cloud/covariances.h"

#include <utility>

namespace raceloc {

gpu::PointsView viewOf(const Cloud& cloud) {
  return {cloud.x.data(), cloud.y.data(), cloud.z.data(), cloud.size()};
}

gpu::Transform toTransform(const Pose& pose) {
  gpu::Transform transform;
  Eigen::Map<Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(transform.R.data()) = pose.linear();
  Eigen::Map<Eigen::Vector3d>(transform.t.data()) = pose.translation();
  return transform;
}

Pose toPose(const gpu::Transform& transform) {
  Pose pose = Pose::Identity();
  pose.linear() = Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(transform.R.data());
  pose.translation() = Eigen::Map<const Eigen::Vector3d>(transform.t.data());
  return pose;
}

void CovarianceOptions::describe(OptionList& keys) {
  keys.add(
      "neighbourhood", neighbourhood,
      {{"radius", gpu::Neighbourhood::radius}, {"nearest", gpu::Neighbourhood::nearest}},
      "radius: all points within radius_m, weighted by the kernel; nearest: so many nearest points, all of "
      "weight 1, as in plain GICP, for comparison and on the CPU only");
  keys.add("nearest", nearest, between(4, gpu::kMostNearest),
           "of neighbourhood nearest, the point itself included");
  keys.add("kernel", kernel,
           {{"rbf", gpu::Weight::rbf},
            {"gaussian", gpu::Weight::gaussian},
            {"polynomial", gpu::Weight::polynomial},
            {"hist", gpu::Weight::hist},
            {"laplacian", gpu::Weight::laplacian}},
           "weight of a neighbour by its distance");
  keys.add(
      "regularisation", regularisation,
      {{"plane", gpu::Regularisation::plane},
       {"min_eig", gpu::Regularisation::min_eig},
       {"none", gpu::Regularisation::none}},
      "plane: eigenvalues plane_epsilon, 1, 1 as in GICP; min_eig: at least plane_epsilon times the largest");
  keys.add("radius_m", radius_m, above(0),
           "neighbours are within this distance, two voxels of the thinned scan or a little more [m]");
  keys.add("rbf_gamma_per_m2", rbf_gamma_per_m2, above(0), "rbf: exp(-gamma d^2) [1/m^2]");
  keys.add("gaussian_sigma_m", gaussian_sigma_m, above(0), "gaussian: exp(-d^2 / (2 sigma^2)) [m]");
  keys.add("laplacian_sigma_m", laplacian_sigma_m, above(0), "laplacian: exp(-d / sigma) [m]");
  keys.add("polynomial_alpha_per_m2", polynomial_alpha_per_m2, above(0),
           "polynomial: (1 + alpha/c d^2)^(-degree/2) [1/m^2]");
  keys.add("polynomial_c", polynomial_c, above(0), "polynomial: constant");
  keys.add("polynomial_degree", polynomial_degree, between(1, 16), "polynomial: degree");
  keys.add("hist_s_m", hist_s_m, above(0), "hist: max(0, 1 - (|dx|+|dy|+|dz|) / (3 s)) [m]");
  keys.add("plane_epsilon", plane_epsilon, between(1e-6, 1),
           "variance across a surface, relative to along it: of 1 m along it, the 2 cm that a LiDAR errs "
           "across it");
  keys.add("min_neighbours", min_neighbours, atLeast(4), "with fewer, the covariance is isotropic");
}

gpu::CovarianceOptions CovarianceOptions::forKernels() const {
  gpu::CovarianceOptions o;
  o.neighbourhood = neighbourhood;
  o.nearest = nearest;
  o.weight = kernel;
  o.regularisation = regularisation;
  o.radius_m = static_cast<float>(radius_m);
  o.rbf_gamma_per_m2 = static_cast<float>(rbf_gamma_per_m2);
  o.gaussian_sigma_m = static_cast<float>(gaussian_sigma_m);
  o.laplacian_sigma_m = static_cast<float>(laplacian_sigma_m);
  o.polynomial_alpha_per_m2 = static_cast<float>(polynomial_alpha_per_m2);
  o.polynomial_c = static_cast<float>(polynomial_c);
  o.polynomial_degree = polynomial_degree;
  o.hist_s_m = static_cast<float>(hist_s_m);
  o.plane_epsilon = static_cast<float>(plane_epsilon);
  o.min_neighbours = min_neighbours;
  return o;
}

CovarianceCloud withCovariances(gpu::Context& context, Cloud cloud, const CovarianceOptions& options,
                                gpu::Covariances into) {
  into = gpu::covariances(context, viewOf(cloud), options.forKernels(), std::move(into));
  return {std::move(cloud), std::move(into)};
}

}  // namespace raceloc
