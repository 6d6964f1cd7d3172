/** \file
 * How long a car waits for its map: `tile_window_bench MAP.rlmap [SPEED_MPS]` drives the map's way-points (without
 * them, its key poses) at a speed, a sweep every 0.1 s of real time, and tells the times of TileWindow::moveTo(). */
#include <algorithm>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <string>
#include <thread>
#include <vector>

#include "cli/app.h"
#include "core/statistics.h"
#include "map/tile_query.h"
#include "pipeline/localizer.h"

namespace {

using namespace raceloc;

/** Positions every `step_m` along the way. */
std::vector<Eigen::Vector2d> driven(const MapContent& content, double step_m) {
  std::vector<Eigen::Vector2d> way, steps;
  for (const MapWaypoint& w : content.waypoints) way.emplace_back(w.p_map_m.head<2>());
  if (way.empty())
    for (const KeyPose& k : content.key_poses) way.emplace_back(k.T_map_body.translation().head<2>());
  double left_m = 0;
  for (std::size_t i = 1; i < way.size(); ++i) {
    const double length_m = (way[i] - way[i - 1]).norm();
    while (left_m < length_m) {
      steps.emplace_back(way[i - 1] + left_m / length_m * (way[i] - way[i - 1]));
      left_m += step_m;
    }
    left_m -= length_m;
  }
  return steps;
}

void run(const std::string& map_path, double speed_mps) {
  using Clock = std::chrono::steady_clock;
  constexpr double kPeriod_s = 0.1;
  const MapFile map(map_path);
  gpu::Context context;
  const LocalizerOptions options;
  TileWindow window(context, map, options.matching.registration.voxel_size_m, options.policy.map_radius_m);
  const auto positions = driven(map.content(), speed_mps * kPeriod_s);
  std::vector<double> times_ms;
  const auto start = Clock::now();
  for (std::size_t i = 0; i < positions.size(); ++i) {
    std::this_thread::sleep_until(start +
                                  std::chrono::duration_cast<Clock::duration>(
                                      std::chrono::duration<double>(static_cast<double>(i) * kPeriod_s)));
    const auto before = Clock::now();
    window.moveTo(positions[i]);
    times_ms.push_back(1e3 * std::chrono::duration<double>(Clock::now() - before).count());
  }
  if (times_ms.empty()) throw InputError("map " + map_path + ": no way to drive");
  const double first_ms = times_ms.front();
  times_ms.erase(times_ms.begin());
  std::printf(
      "%zu sweeps at %.0f m/s; first %.1f ms, then %.4f median, %.2f p99, %.2f longest; %zu rebuilds, %zu "
      "waits\n",
      positions.size(), speed_mps, first_ms, quantile(times_ms, 0.5), quantile(times_ms, 0.99),
      *std::max_element(times_ms.begin(), times_ms.end()), window.rebuilds(), window.waits());
}

}  // namespace

int main(int argc, char** argv) {
  return raceloc::runApp("tile_window_bench", [&] {
    if (argc < 2) throw raceloc::InputError("usage: tile_window_bench MAP.rlmap [SPEED_MPS]");
    run(argv[1], argc > 2 ? std::atof(argv[2]) : 70);
  });
}
