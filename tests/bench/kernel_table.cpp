/** \file
 * The paper's table of kernels: every scan matched on the one before it, error against the true motion.
 * `kernel_table` on KITTI odometry 01, `kernel_table LIVE.ini LOG.rawlog TRUTH.tum` on a simulated drive, whose sweeps
 * odometry de-skews and crops. */
#include <filesystem>
#include <iostream>

#include "bench/real_pairs.h"
#include "cli/app.h"
#include "cloud/voxel_grid.h"
#include "eval/trajectory_errors.h"
#include "odometry/odometry_stream.h"
#include "pipeline/replay.h"
#include "registration/align.h"

namespace raceloc::bench {
namespace {

constexpr double kLeaf_m = 1.0;  // the paper's

struct KernelErrors {
  std::vector<double> rotation_deg, translation_m;
  std::size_t not_converged = 0;  ///< counted in the errors all the same
};

/** Scans of a log, de-skewed to the ends of their sweeps. */
ScanSequence simulatedSequence(const std::string& ini, const std::string& log,
                               const std::string& truth_path) {
  const MatchingOptions options = ReplayOptions::fromIni(ini).localizer.matching;
  const Trajectory truth = readTum(truth_path);
  gpu::Context context(gpu::Backend::cpu);
  OdometryStream stream = odometryStream(context, options);
  LogReader reader(log, options.log, std::nullopt, Late::passed);
  ScanSequence sequence{std::filesystem::path(log).stem(), {}, {}};
  const auto take = [&](const OdometryStep& step) {
    constexpr double kTruthGap_s = 0.1;
    const auto T_map_body = interpolated(truth.poses, step.stamp_s, kTruthGap_s);
    if (!T_map_body) return;
    sequence.scans.push_back(step.full_scan);
    sequence.T_map_body.push_back(*T_map_body);
  };
  while (auto sample = reader.next()) stream.add(std::move(*sample), take);
  stream.finish(take);
  if (sequence.scans.size() < 3) throw InputError(log + ": fewer than three scans with a truth");
  return sequence;
}

/** Scan to scan; guessed as the motion found before, at first as the true one. */
KernelErrors errorsOf(CovarianceOptions covariance, const ScanSequence& sequence) {
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

void run(const ScanSequence& sequence) {
  std::cout
      << sequence.name << ", " << sequence.scans.size() - 2 << " matches from scan to scan, leaf "
      << number(kLeaf_m, 1) << " m, options at their defaults.\n\n"
      << "| kernel | rotation [deg]: rmse | mean | median | std | translation [m]: rmse | mean | median "
         "| std | not converged |\n|---|---|---|---|---|---|---|---|---|---|\n";
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
    std::cout << "| " << name << " | ";
    for (const auto* values : {&errors.rotation_deg, &errors.translation_m}) {
      const Statistics s = statisticsOf(*values);
      for (const double figure : {s.rmse, s.mean, s.median, s.std}) std::cout << number(figure, 4) << " | ";
    }
    std::cout << errors.not_converged << " |\n";
  }
}

}  // namespace
}  // namespace raceloc::bench

int main(int argc, char** argv) {
  using namespace raceloc::bench;
  return raceloc::runApp("kernel_table", [&] {
    if (argc != 1 && argc != 4)
      throw raceloc::InputError("usage: kernel_table [LIVE.ini LOG.rawlog TRUTH.tum]");
    run(argc == 1 ? kittiSequence() : simulatedSequence(argv[1], argv[2], argv[3]));
  });
}
