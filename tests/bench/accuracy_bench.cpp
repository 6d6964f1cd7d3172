/** \file
 * How exact and how forgiving our VGICP is beside small_gicp's: real pairs, matched from 200 starts that are off by
 * a known amount. For small_gicp see peer_bench.cpp. */
#include <array>
#include <cmath>
#include <functional>
#include <iostream>

#include "bench/peer.h"
#include "bench/real_pairs.h"
#include "cli/app.h"
#include "cloud/voxel_grid.h"
#include "registration/align.h"

namespace raceloc::bench {
namespace {

constexpr std::size_t kStarts = 200;
constexpr double kVoxel_m = 1.0;

/** A success is a match that calls itself converged and lies this close to the reference. The reference of scan_pair
 * is good to 0.02 m and 0.7 deg, KITTI's from scan to scan to a few centimetres: three times that is no failure. A
 * wrong minimum of voxels of 1 m lies a good part of a voxel away. */
constexpr PoseDistance kSuccess{0.3, 2.0};

struct Outcome {
  Pose T_target_source;
  bool converged;
  int iterations;
};

/** Matches one pair from a guess. */
using Aligner = std::function<Outcome(const Pose&)>;

/** Source and target, thinned once for all. */
struct ThinPair {
  Cloud source, target;
  Pose T_target_source;
  double radius_m;  ///< within which the median point has the 10 neighbours that the peer takes
};

struct Method {
  std::string name;
  std::function<Aligner(const ThinPair&)> prepare;
};

Aligner ourAligner(CovarianceCloud source, const CovarianceCloud& target, const GicpOptions& gicp) {
  struct Prepared {
    gpu::Context context{gpu::Backend::cpu};
    CovarianceCloud source;
    gpu::VoxelMap map{context, kVoxel_m};
  };
  auto prepared = std::make_shared<Prepared>();
  prepared->source = std::move(source);
  prepared->map.insert(viewOf(target.cloud), target.covariances.view(), {});
  return [prepared, gicp](const Pose& guess) {
    const auto match = align(prepared->context, prepared->source, prepared->map, guess, gicp);
    return Outcome{match.T_target_source, match.stop == gpu::Stop::converged, match.iterations};
  };
}

Aligner ours(const ThinPair& pair, const CovarianceOptions& covariance, const GicpOptions& gicp) {
  gpu::Context context(gpu::Backend::cpu);
  return ourAligner(withCovariances(context, pair.source, covariance),
                    withCovariances(context, pair.target, covariance), gicp);
}

/** small_gicp's covariances on its own cloud of the same points. */
std::shared_ptr<PeerPoints> withPeerCovariances(const Cloud& cloud) {
  auto points = peerPoints(cloud);
  (void)peerCovariances(points);
  return points;
}

/** The peer, and ours with its settings: all that is there of them. */
std::vector<Method> peerAndEquals() {
  std::vector<Method> all;
  if constexpr (kPeerInstalled) {
    all.push_back({"small_gicp", [](const ThinPair& pair) -> Aligner {
                     const auto source = withPeerCovariances(pair.source);
                     const auto map = peerVoxelMap(*withPeerCovariances(pair.target), kVoxel_m);
                     return [source, map](const Pose& guess) {
                       const auto match = peerVgicp(*map, *source, guess);
                       return Outcome{match.T_target_source, match.converged, match.iterations};
                     };
                   }});
    all.push_back({"ours, as small_gicp, with its covariances", [](const ThinPair& pair) {
                     const auto both = [](const Cloud& cloud) {
                       return CovarianceCloud{cloud, covariancesOf(*withPeerCovariances(cloud))};
                     };
                     return ourAligner(both(pair.source), both(pair.target), gicpAsPeer());
                   }});
  }
  all.push_back({"ours, as small_gicp", [](const ThinPair& pair) {
                   return ours(pair, covarianceAsPeer(pair.radius_m), gicpAsPeer());
                 }});
  return all;
}

/** What a method made of the starts. */
struct Tally {
  std::size_t successes = 0;
  std::size_t wrong = 0;                               ///< says it converged, and is no success
  std::vector<double> error_m, error_deg, iterations;  ///< of the successes
};

/** Start k is on pair k modulo their number; the same for every method. */
Tally tally(const Method& method, const std::vector<ThinPair>& pairs, const PoseDistance& off) {
  std::vector<Aligner> aligners;
  aligners.reserve(pairs.size());
  for (const ThinPair& pair : pairs) aligners.push_back(method.prepare(pair));
  Tally result;
  std::mt19937 engine(1);
  for (std::size_t k = 0; k < kStarts; ++k) {
    const Pose& truth = pairs[k % pairs.size()].T_target_source;
    const Outcome outcome = aligners[k % pairs.size()](perturbed(truth, off, engine));
    const PoseDistance error = distance(truth, outcome.T_target_source);
    if (!outcome.converged) continue;
    if (error.translation_m > kSuccess.translation_m || error.rotation_deg > kSuccess.rotation_deg) {
      ++result.wrong;
      continue;
    }
    ++result.successes;
    result.error_m.push_back(error.translation_m);
    result.error_deg.push_back(error.rotation_deg);
    result.iterations.push_back(outcome.iterations);
  }
  return result;
}

std::string percentOfStarts(std::size_t part) {
  return number(100 * static_cast<double>(part) / static_cast<double>(kStarts), 1);
}

/** median / 90th percentile / rmse */
std::string spread(const std::vector<double>& errors, int digits) {
  double squares = 0;
  for (const double e : errors) squares += e * e;
  return number(median(errors), digits) + " / " + number(quantile(errors, 0.9), digits) + " / " +
         number(errors.empty() ? 0 : std::sqrt(squares / static_cast<double>(errors.size())), digits);
}

std::string text(const PoseDistance& d) {
  return number(d.translation_m, 1) + " m, " + number(d.rotation_deg, 1) + " deg";
}

struct Recording {
  std::string name;
  std::vector<RealPair> pairs;
  [[nodiscard]] std::vector<ThinPair> thinned(double leaf_m) const {
    gpu::Context context(gpu::Backend::cpu);
    std::vector<ThinPair> thin;
    for (const RealPair& pair : pairs)
      thin.push_back({voxelGrid(context, pair.source, leaf_m), voxelGrid(context, pair.target, leaf_m),
                      pair.T_target_source, pair.ten_neighbours * leaf_m});
    return thin;
  }
};

void printErrors(const std::vector<Recording>& recordings) {
  std::cout << "## Errors and success beside small_gicp\n\n"
            << "Errors of the successes: median / 90th percentile / rmse; linearisations: median. The "
               "reference of scan_pair was made by "
               "small_gicp and is good to 0.02 m and 0.7 deg only.\n\n"
            << "| recording | leaf [m] | start off by | method | success [%] | converged elsewhere [%] | "
               "translation [m] | rotation [deg] | linearisations |\n|---|---|---|---|---|---|---|---|---|\n";
  auto compared = peerAndEquals();
  compared.push_back({"ours, defaults", [](const ThinPair& pair) { return ours(pair, {}, {}); }});
  for (const auto& recording : recordings)
    for (const double leaf_m : {0.25, 0.5}) {
      const auto pairs = recording.thinned(leaf_m);
      for (const PoseDistance off : {PoseDistance{0.3, 2}, PoseDistance{1, 5}})
        for (const auto& method : compared) {
          const Tally t = tally(method, pairs, off);
          std::cout << "| " << recording.name << " | " << number(leaf_m, 2) << " | " << text(off) << " | "
                    << method.name << " | " << percentOfStarts(t.successes) << " | "
                    << percentOfStarts(t.wrong) << " | " << spread(t.error_m, 4) << " | "
                    << spread(t.error_deg, 3) << " | " << number(median(t.iterations), 0) << " |\n"
                    << std::flush;
        }
    }
}

void printBasin(const std::vector<Recording>& recordings) {
  constexpr double leaf_m = 0.5;  // what odometry takes
  const std::array<PoseDistance, 4> offs{{{0.5, 2.5}, {1, 5}, {1.5, 7.5}, {2, 10}}};
  auto compared = peerAndEquals();
  const std::vector<std::pair<std::string, gpu::Weight>> kernels{{"rbf", gpu::Weight::rbf},
                                                                 {"gaussian", gpu::Weight::gaussian},
                                                                 {"polynomial", gpu::Weight::polynomial},
                                                                 {"hist", gpu::Weight::hist},
                                                                 {"laplacian", gpu::Weight::laplacian}};
  for (const auto& [name, kernel] : kernels) {
    CovarianceOptions covariance;
    covariance.kernel = kernel;
    compared.push_back({"ours, defaults, " + name,
                        [covariance](const ThinPair& pair) { return ours(pair, covariance, {}); }});
  }
  std::cout << "\n## Basin: success (converged elsewhere) [%] from starts off by\n\n| recording | method";
  for (const auto& off : offs) std::cout << " | " << text(off);
  std::cout << " |\n|---|---|---|---|---|---|\n";
  for (const auto& recording : recordings) {
    const auto pairs = recording.thinned(leaf_m);
    for (const auto& method : compared) {
      std::cout << "| " << recording.name << " | " << method.name;
      for (const auto& off : offs) {
        const Tally t = tally(method, pairs, off);
        std::cout << " | " << percentOfStarts(t.successes) << " (" << percentOfStarts(t.wrong) << ")";
      }
      std::cout << " |\n" << std::flush;
    }
  }
}

void run() {
  const auto sequence = kittiSequence();
  Recording motorway{"KITTI 01", {}};
  for (std::size_t i = 4; i < sequence.scans.size(); i += 8) motorway.pairs.push_back(sequence.pair(i));
  motorway.name += ", " + std::to_string(motorway.pairs.size()) + " pairs";
  const std::vector<Recording> recordings{{"scan_pair", {scanPair()}}, motorway};

  std::cout << kStarts << " starts each; success: converged within " << text(kSuccess)
            << " of the reference. Voxels of " << number(kVoxel_m, 1) << " m.\n\n";
  if (!kPeerInstalled) std::cout << "small_gicp: not installed\n\n";
  printErrors(recordings);
  printBasin(recordings);
}

}  // namespace
}  // namespace raceloc::bench

int main() { return raceloc::runApp("accuracy_bench", raceloc::bench::run); }
