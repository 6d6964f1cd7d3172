/** \file
 * What a scan of odometry costs: `odometry_bench LIVE.ini LOG.rawlog`. Ours is all of LivOdometry::add(), de-skew
 * included; the peer gets the points as de-skewed and cropped by us, and our prediction as its guess. One thread, its
 * CPU time, ours and the peer in turn. */
#include <ctime>
#include <iostream>
#include <memory>

#include "bench/peer.h"
#include "bench/real_pairs.h"
#include "cli/app.h"
#include "odometry/liv_odometry.h"
#include "odometry/scan_queue.h"
#include "pipeline/replay.h"

namespace raceloc::bench {
namespace {

double cpu_ms() {
  timespec now{};
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
  return 1e3 * static_cast<double>(now.tv_sec) + 1e-6 * static_cast<double>(now.tv_nsec);
}

struct Driven {
  std::vector<double> ms;
  Pose T_odom_body = Pose::Identity();
};

void print(const std::string& name, const Driven& driven, const Driven& ours) {
  const double median_ms = quantile(driven.ms, 0.5);
  std::cout << "| " << name << " | " << number(median_ms, 2) << " | " << number(quantile(driven.ms, 0.99), 2)
            << " | " << number(quantile(driven.ms, 1.0), 2) << " | "
            << number(quantile(ours.ms, 0.5) / median_ms, 3) << " | "
            << number((ours.T_odom_body.inverse() * driven.T_odom_body).translation().norm(), 2) << " |\n";
}

void run(const std::string& ini, const std::string& log) {
  const MatchingOptions options = ReplayOptions::fromIni(ini).localizer.matching;
  gpu::Context context(gpu::Backend::cpu);
  MotionHistory history(options.motion, options.calibration);
  LivOdometry odometry(context, options.odometry, options.crop, options.covariance, options.registration);
  ScanQueue queue;
  LogReader reader(log, options.log, std::nullopt, Late::passed);
  Driven ours, theirs;
  std::unique_ptr<PeerOdometry> peer;
  if constexpr (kPeerInstalled)
    peer = std::make_unique<PeerOdometry>(options.odometry.scan_voxel_m, options.registration.voxel_size_m);
  std::optional<double> last_s;
  double length_m = 0, points = 0;
  while (auto sample = reader.next()) {
    const double now_s = stampOf(*sample);
    if (const auto* imu = std::get_if<ImuSample>(&*sample)) history.add(*imu);
    if (const auto* motion = std::get_if<MotionSample>(&*sample)) history.add(*motion);
    if (auto* scan = std::get_if<Scan>(&*sample)) queue.push(std::move(*scan));
    while (const Sweep* sweep = queue.pop(history, now_s)) {
      const auto predicted = last_s ? history.between(*last_s, sweep->end_s) : std::nullopt;
      last_s = sweep->end_s;
      const double begin_ms = cpu_ms();
      const OdometryStep& step = odometry.add(*sweep, history);
      ours.ms.push_back(cpu_ms() - begin_ms);
      ours.T_odom_body = step.T_odom_body;
      length_m += step.since_last.T_start_end.translation().norm();
      points += static_cast<double>(step.full_scan.size());
      if constexpr (kPeerInstalled) {
        const auto cloud = peerPoints(step.full_scan);
        const double peer_ms = cpu_ms();
        theirs.T_odom_body =
            peer->add(*cloud, predicted ? theirs.T_odom_body * predicted->T_start_end : theirs.T_odom_body);
        theirs.ms.push_back(cpu_ms() - peer_ms);
      }
    }
  }
  if (ours.ms.empty()) throw InputError("rawlog " + log + ": no scan in it");
  std::cout << ours.ms.size() << " scans of " << number(points / static_cast<double>(ours.ms.size()), 0)
            << " points, " << number(length_m, 0) << " m\n\n"
            << "| odometry | CPU ms a scan: median | p99 | largest | ours over it | end from ours [m] |\n"
               "|---|---|---|---|---|---|\n";
  print("ours", ours, ours);
  if (kPeerInstalled)
    print("small_gicp, VGICP model", theirs, ours);
  else
    std::cout << "small_gicp: not installed\n";
}

}  // namespace
}  // namespace raceloc::bench

int main(int argc, char** argv) {
  return raceloc::runApp("odometry_bench", [&] {
    if (argc != 3) throw raceloc::InputError("usage: odometry_bench LIVE.ini LOG.rawlog");
    raceloc::bench::run(argv[1], argv[2]);
  });
}
