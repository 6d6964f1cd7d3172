/** \file
 * The paper's table of kernels on KITTI odometry 01: every scan matched on the one before it, error of the rotation
 * against the true motion. */
#include <iostream>

#include "bench/real_pairs.h"
#include "cli/app.h"
#include "cloud/voxel_grid.h"
#include "eval/trajectory_errors.h"
#include "registration/align.h"

namespace raceloc::bench {
namespace {

constexpr double kLeaf_m = 1.0;  // the paper's

struct KernelErrors {
  std::vector<double> rotation_deg, translation_m;
  std::size_t not_converged = 0;  ///< counted in the errors all the same
};

/** Scan to scan; guessed as the motion found before, at first as the true one. */
KernelErrors errorsOf(CovarianceOptions covariance, const KittiSequence& sequence) {
  gpu::Context context(gpu::Backend::cpu);
  const double scale =
      2 * kLeaf_m / covariance.radius_m;  // the defaults are for two voxels of the thinned scan
  for (double* length_m : {&covariance.radius_m, &covariance.gaussian_sigma_m, &covariance.laplacian_sigma_m,
                           &covariance.hist_s_m})
    *length_m *= scale;
  covariance.rbf_gamma_per_m2 /= scale * scale;
  covariance.polynomial_alpha_per_m2 /= scale * scale;
  const GicpOptions gicp;
  const auto prepared = [&](const Cloud& scan) {
    return withCovariances(context, voxelGrid(context, scan, kLeaf_m), covariance);
  };
  KernelErrors errors;
  CovarianceCloud target = prepared(sequence.scans[1]);
  Pose guess = sequence.pair(2).guess;
  for (std::size_t i = 2; i < sequence.scans.size(); ++i) {
    CovarianceCloud source = prepared(sequence.scans[i]);
    gpu::VoxelMap map(context, gicp.voxel_size_m);
    map.insert(viewOf(target.cloud), target.covariances.view(), {});
    const Registration match = align(context, source, map, guess, gicp);
    const PoseDistance error = distance(sequence.pair(i).T_target_source, match.T_target_source);
    errors.rotation_deg.push_back(error.rotation_deg);
    errors.translation_m.push_back(error.translation_m);
    if (match.stop != gpu::Stop::converged) ++errors.not_converged;
    guess = match.T_target_source;
    target = std::move(source);
  }
  return errors;
}

void run() {
  const auto sequence = kittiSequence();
  std::cout
      << "KITTI 01, " << sequence.scans.size() - 2 << " matches from scan to scan, leaf "
      << number(kLeaf_m, 1) << " m, options at their defaults.\n\n"
      << "| kernel | rotation [deg]: rmse | mean | median | std | translation [m]: rmse | not converged "
         "|\n|---|---|---|---|---|---|---|\n";
  const auto kernel = [](gpu::Weight weight) {
    CovarianceOptions o;
    o.kernel = weight;
    return o;
  };
  CovarianceOptions nearest;
  nearest.neighbourhood = gpu::Neighbourhood::nearest;
  const std::vector<std::pair<std::string, CovarianceOptions>> rows{
      {"polynomial", kernel(gpu::Weight::polynomial)},
      {"hist", kernel(gpu::Weight::hist)},
      {"gaussian", kernel(gpu::Weight::gaussian)},
      {"rbf", kernel(gpu::Weight::rbf)},
      {"laplacian", kernel(gpu::Weight::laplacian)},
      {"none, " + std::to_string(nearest.nearest) + " nearest", nearest}};
  for (const auto& [name, covariance] : rows) {
    const KernelErrors errors = errorsOf(covariance, sequence);
    const Statistics rotation = statisticsOf(errors.rotation_deg);
    std::cout << "| " << name << " | " << number(rotation.rmse, 4) << " | " << number(rotation.mean, 4)
              << " | " << number(rotation.median, 4) << " | " << number(rotation.std, 4) << " | "
              << number(statisticsOf(errors.translation_m).rmse, 4) << " | " << errors.not_converged
              << " |\n";
  }
}

}  // namespace
}  // namespace raceloc::bench

int main() { return raceloc::runApp("kernel_table", raceloc::bench::run); }
