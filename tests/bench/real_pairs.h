/** \file
 * What the comparisons share: real scan pairs with their references, starts drawn round them, errors, figures. */
#pragma once

#include <cstddef>
#include <filesystem>
#include <iomanip>
#include <random>
#include <sstream>
#include <string>
#include <utility>
#include <vector>

#include "cloud/covariances.h"
#include "core/errors.h"
#include "core/statistics.h"
#include "core/types.h"
#include "sensors/kitti.h"
#include "sensors/rawlog.h"
#include "support/run_command.h"
#include "tests/scenes.h"

namespace raceloc::bench {

struct RealPair {
  std::string name;
  Cloud source, target;   ///< raw scans
  Pose T_target_source;   ///< reference
  Pose guess;             ///< what a first guess without other sensors would be
  double ten_neighbours;  ///< radius, in leaves, within which the median point of a thinned scan has 10
};

/** The pair of small_gicp, guessed as no motion. Its reference is no independent truth: small_gicp made it, and
 * settings that are as good end 0.02 m and 0.7 deg away from it.
 * \throws InputError if it is not beside the checkout. */
[[nodiscard]] inline RealPair scanPair() {
  const std::string data = RACELOC_ROOT "/../shared/data";
  auto pair = gpu::test::readScanPair(data);
  if (!pair) throw InputError("no scan pair in " + data + "/scan_pair");
  const auto cloud = [](gpu::Points& p) { return Cloud{std::move(p.x), std::move(p.y), std::move(p.z), {}}; };
  return {"scan_pair",         cloud(pair->source),
          cloud(pair->target), toPose(pair->T_target_source),
          Pose::Identity(),    2.0};
}

/** Consecutive scans, with the body's true poses. */
struct ScanSequence {
  std::string name;
  std::vector<Cloud> scans;      ///< body frame
  std::vector<Pose> T_map_body;  ///< at each scan
  /** Scan `i` >= 2 on the one before it, guessed as the true motion between those two before. */
  [[nodiscard]] RealPair pair(std::size_t i) const {
    const auto motion = [&](std::size_t k) { return T_map_body[k - 1].inverse() * T_map_body[k]; };
    return {name + " #" + std::to_string(i), scans[i], scans[i - 1], motion(i), motion(i - 1), 2.4};
  }
};

/** KITTI odometry 01, a motorway at 10 to 18 m/s. \throws InputError if the recording is not unpacked. */
[[nodiscard]] inline ScanSequence kittiSequence() {
  KittiOdometrySequence source;
  source.folder = RACELOC_ROOT "/build/data/kitti_odom/sequences/01";
  if (!std::filesystem::exists(source.folder))
    throw InputError("no " + source.folder +
                     ": run tests/support/unpack_kitti.sh ../shared/data build/data in the checkout");
  const test::TemporaryFolder folder;
  const std::string log = folder / "motorway.rawlog";
  const auto truth = importLog(source, log, [](double) {}).truth;
  if (!truth) throw InputError("no poses with " + source.folder);

  ScanSequence sequence{"KITTI 01", {}, {}};
  LogReader reader(log, {});
  while (auto sample = reader.next()) {
    const auto* scan = std::get_if<Scan>(&*sample);
    if (scan == nullptr) continue;
    const std::size_t i = sequence.scans.size();
    constexpr double tick_s = 1e-6;  // of a rawlog's stamps
    if (i >= truth->poses.size() || std::abs(truth->poses[i].stamp_s - scan->stamp_s) > tick_s)
      throw InputError(source.folder + ": scan " + std::to_string(i) + " has no pose");
    sequence.scans.push_back(transformed(scan->cloud, scan->T_body_lidar));
    sequence.T_map_body.push_back(truth->poses[i].T_map_body);
  }
  return sequence;
}

struct PoseDistance {
  double translation_m, rotation_deg;
};
[[nodiscard]] inline PoseDistance distance(const Pose& a, const Pose& b) {
  const Pose between = a.inverse() * b;
  return {between.translation().norm(), Eigen::AngleAxisd(between.linear()).angle() / kDegree};
}

/** A pose at these distances from `T` exactly, in directions that are uniform on the sphere. */
[[nodiscard]] inline Pose perturbed(const Pose& T, const PoseDistance& by, std::mt19937& engine) {
  std::normal_distribution<double> normal;
  const auto direction = [&] {
    return Eigen::Vector3d(normal(engine), normal(engine), normal(engine)).normalized().eval();
  };
  Pose step = Pose::Identity();
  step.linear() = Eigen::AngleAxisd(by.rotation_deg * kDegree, direction()).toRotationMatrix();
  step.translation() = by.translation_m * direction();
  return T * step;
}

[[nodiscard]] inline double median(const std::vector<double>& values) { return quantile(values, 0.5); }

[[nodiscard]] inline std::string number(double value, int digits) {
  std::ostringstream text;
  text << std::fixed << std::setprecision(digits) << value;
  return text.str();
}

}  // namespace raceloc::bench
