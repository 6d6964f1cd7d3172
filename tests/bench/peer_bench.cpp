/** \file
 * Our steps against small_gicp's on real scans: peer, ours, peer, ours, ... in one run, serial CPU time of the process.
 * The peer comes from its source package (PyPI, `pip download --no-binary :all: --no-deps small_gicp==1.0.1`), unpacked
 * and named to CMake by RACELOC_SMALL_GICP; nothing of it is installed. */
#include <raceloc/gpu/covariance.h>
#include <raceloc/gpu/matcher.h>
#include <raceloc/gpu/voxel_grid.h>

#include <array>
#include <ctime>
#include <iostream>

#include "bench/peer.h"
#include "bench/real_pairs.h"
#include "cli/app.h"

namespace raceloc::bench {
namespace {

constexpr float kLeaf_m = 0.25F;
constexpr double kVoxel_m = 1.0;
constexpr std::size_t kRounds = 35;

enum class Step { grid, covariances, map, vgicp, gicp, raw_to_pose };

struct StepRow {
  Step step;
  std::string text;
};
const std::array<StepRow, 6> kSteps{{{Step::grid, "voxel downsampling 0.25 m of the raw scan"},
                                     {Step::covariances, "neighbours + covariances, per point"},
                                     {Step::map, "voxel map 1 m"},
                                     {Step::vgicp, "VGICP align"},
                                     {Step::gicp, "GICP align"},
                                     {Step::raw_to_pose, "raw pair to pose, VGICP"}}};

/** A pair and what each step starts from. */
struct OurPair {
  OurPair(gpu::Context& context, const RealPair& pair, const gpu::CovarianceOptions& covariance_options)
      : source(gpu::voxelGrid(context, viewOf(pair.source), kLeaf_m)),
        target(gpu::voxelGrid(context, viewOf(pair.target), kLeaf_m)),
        C_source(gpu::covariances(context, source.view(), covariance_options)),
        C_target(gpu::covariances(context, target.view(), covariance_options)),
        map(context, kVoxel_m),
        points(target.view(), C_target.view()),
        covariance(covariance_options) {
    map.insert(target.view(), C_target.view(), {});
  }
  gpu::Points source, target;
  gpu::Covariances C_source, C_target;
  gpu::VoxelMap map;
  gpu::NearestTarget points;
  gpu::CovarianceOptions covariance;
};

struct PeerPair {
  explicit PeerPair(const RealPair& pair)
      : raw_source(peerPoints(pair.source)),
        raw_target(peerPoints(pair.target)),
        source(peerVoxelGrid(*raw_source, kLeaf_m)),
        target(peerVoxelGrid(*raw_target, kLeaf_m)),
        source_tree(peerCovariances(source)),
        target_tree(peerCovariances(target)),
        map(peerVoxelMap(*target, kVoxel_m)) {}
  std::shared_ptr<PeerPoints> raw_source, raw_target, source, target;
  std::shared_ptr<PeerTree> source_tree, target_tree;
  std::shared_ptr<PeerMap> map;
};

/** What a step ended with, when it was a match. */
struct Outcome {
  Pose T_target_source = Pose::Identity();
  int iterations = 0;
};

Outcome runOurs(gpu::Context& context, Step step, const RealPair& pair, const OurPair& ours) {
  const auto matched = [&](const gpu::Points& source, const gpu::Covariances& C, const auto& target) {
    const auto match = gpu::match(context, source.view(), C.view(), target, toTransform(pair.guess),
                                  gicpAsPeer().forKernels());
    return Outcome{toPose(match.T_map_source), match.iterations};
  };
  switch (step) {
    case Step::grid:
      (void)gpu::voxelGrid(context, viewOf(pair.source), kLeaf_m);
      break;
    case Step::covariances:
      (void)gpu::covariances(context, ours.source.view(), ours.covariance);
      break;
    case Step::map:
      gpu::VoxelMap(context, kVoxel_m).insert(ours.target.view(), ours.C_target.view(), {});
      break;
    case Step::vgicp:
      return matched(ours.source, ours.C_source, ours.map);
    case Step::gicp:
      return matched(ours.source, ours.C_source, ours.points);
    case Step::raw_to_pose: {
      const auto source = gpu::voxelGrid(context, viewOf(pair.source), kLeaf_m);
      const auto target = gpu::voxelGrid(context, viewOf(pair.target), kLeaf_m);
      const auto C_source = gpu::covariances(context, source.view(), ours.covariance);
      const auto C_target = gpu::covariances(context, target.view(), ours.covariance);
      gpu::VoxelMap map(context, kVoxel_m);
      map.insert(target.view(), C_target.view(), {});
      return matched(source, C_source, map);
    }
  }
  return {};
}

Outcome runPeer(Step step, const RealPair& pair, const PeerPair& peer) {
  const auto outcome = [](const PeerMatch& m) { return Outcome{m.T_target_source, m.iterations}; };
  switch (step) {
    case Step::grid:
      (void)peerVoxelGrid(*peer.raw_source, kLeaf_m);
      break;
    case Step::covariances:
      (void)peerCovariances(peer.source);
      break;
    case Step::map:
      (void)peerVoxelMap(*peer.target, kVoxel_m);
      break;
    case Step::vgicp:
      return outcome(peerVgicp(*peer.map, *peer.source, pair.guess));
    case Step::gicp:
      return outcome(peerGicp(*peer.target, *peer.target_tree, *peer.source, pair.guess));
    case Step::raw_to_pose: {
      const auto source = peerVoxelGrid(*peer.raw_source, kLeaf_m);
      const auto target = peerVoxelGrid(*peer.raw_target, kLeaf_m);
      (void)peerCovariances(source);
      (void)peerCovariances(target);
      return outcome(peerVgicp(*peerVoxelMap(*target, kVoxel_m), *source, pair.guess));
    }
  }
  return {};
}

double now_ms(clockid_t clock) {
  timespec t{};
  clock_gettime(clock, &t);
  return 1e3 * static_cast<double>(t.tv_sec) + 1e-6 * static_cast<double>(t.tv_nsec);
}

/** Times and results of one step by one program, a value a round. */
struct Measured {
  std::vector<double> cpu_ms, wall_ms, iterations, error_m, error_deg;

  /** \param units what the times are divided by, 1 or the number of points */
  template <class Run>
  void add(const RealPair& pair, double units, const Run& run) {
    const double wall_start_ms = now_ms(CLOCK_MONOTONIC), cpu_start_ms = now_ms(CLOCK_PROCESS_CPUTIME_ID);
    const Outcome outcome = run();
    cpu_ms.push_back((now_ms(CLOCK_PROCESS_CPUTIME_ID) - cpu_start_ms) / units);
    wall_ms.push_back((now_ms(CLOCK_MONOTONIC) - wall_start_ms) / units);
    const PoseDistance error = distance(pair.T_target_source, outcome.T_target_source);
    iterations.push_back(outcome.iterations);
    error_m.push_back(error.translation_m);
    error_deg.push_back(error.rotation_deg);
  }
};

/** The rows of one recording; rounds go through its pairs in turn. */
void printRows(const std::string& data, const std::vector<RealPair>& pairs) {
  gpu::Context one(gpu::Backend::cpu, 0, 1), two(gpu::Backend::cpu, 0, 2);
  const double radius_m = pairs.front().ten_neighbours * kLeaf_m;
  const auto covariance = covarianceAsPeer(radius_m).forKernels();
  std::vector<OurPair> ours;
  std::vector<PeerPair> peers;
  std::vector<double> neighbours;
  for (const RealPair& pair : pairs) {
    ours.emplace_back(one, pair, covariance);
    const auto& n = ours.back().C_source.neighbours;
    neighbours.insert(neighbours.end(), n.begin(), n.end());
    if constexpr (kPeerInstalled) peers.emplace_back(pair);
  }

  for (const StepRow& row : kSteps) {
    const bool per_point = row.step == Step::covariances;
    // 1e-3: microseconds a point rather than milliseconds
    const auto units = [&](std::size_t i) {
      return per_point ? 1e-3 * static_cast<double>(ours[i].source.size()) : 1;
    };
    const auto runWith = [&](gpu::Context& context, std::size_t i, Measured& measured) {
      measured.add(pairs[i], units(i), [&] { return runOurs(context, row.step, pairs[i], ours[i]); });
    };
    Measured peer, serial, alone, threaded;
    for (std::size_t round = 0; round < kRounds; ++round) {
      const std::size_t i = round % pairs.size();
      if constexpr (kPeerInstalled)
        peer.add(pairs[i], units(i), [&] { return runPeer(row.step, pairs[i], peers[i]); });
      runWith(one, i, serial);
    }
    // Apart from the rounds above: idle workers spin for a while, and the process pays for it.
    for (std::size_t round = 0; round < kRounds; ++round) {
      const std::size_t i = round % pairs.size();
      runWith(one, i, alone);
      runWith(two, i, threaded);
    }

    const bool is_match = row.step == Step::vgicp || row.step == Step::gicp || row.step == Step::raw_to_pose;
    const auto result = [&](const Measured& m) {
      return is_match ? number(median(m.iterations), 0) + "; " + number(median(m.error_m), 4) + " m, " +
                            number(median(m.error_deg), 3) + " deg"
                      : "";
    };
    const std::string unit = per_point ? " us" : " ms";
    std::cout << "| " << data << " | " << row.text << " | "
              << (kPeerInstalled ? number(median(peer.cpu_ms), 3) + unit : "not installed") << " | "
              << number(median(serial.cpu_ms), 3) << unit << " | "
              << (kPeerInstalled ? number(median(serial.cpu_ms) / median(peer.cpu_ms), 3) : "-") << " | "
              << number(median(alone.wall_ms) / median(threaded.wall_ms), 2) << " | "
              << (kPeerInstalled ? result(peer) : "") << " | " << result(serial) << " |\n"
              << std::flush;
  }
  std::cout << "| " << data << " | neighbours of the median point, ours within " << number(radius_m, 2)
            << " m | 10 | " << number(median(neighbours), 0) << " | | | | |\n";
}

void run() {
  const auto sequence = kittiSequence();
  std::vector<RealPair> consecutive;
  for (std::size_t i = 4; i < sequence.scans.size(); i += 12) consecutive.push_back(sequence.pair(i));

  std::cout << "Medians of " << kRounds << " rounds: CPU time of one thread, peer and ours in turn; results: "
            << "linearisations, distance from the reference.\n\n"
            << "| data | step | small_gicp | ours | ours / small_gicp | two threads, times faster (wall) | "
               "result, small_gicp | result, ours |\n|---|---|---|---|---|---|---|---|\n";
  printRows("scan_pair", {scanPair()});
  printRows("KITTI 01, " + std::to_string(consecutive.size()) + " pairs", consecutive);
}

}  // namespace
}  // namespace raceloc::bench

int main() { return raceloc::runApp("peer_bench", raceloc::bench::run); }
