/** \file
 * From a de-skewed scan of 128 x 1024 to the walls, step by step, on one thread; then path and guard. */
#include <benchmark/benchmark.h>
#include <raceloc/gpu/clusters.h>
#include <raceloc/gpu/standing.h>

#include "cloud/scan_check.h"
#include "support/wall_scans.h"
#include "wall/guard.h"
#include "wall/wall_fit.h"

namespace {

using namespace raceloc;

/** The roof LiDAR of the road car, 16 scans round a circuit: more than a cache holds. */
const std::vector<DeskewedScan>& scans(bool is_oval) {
  const auto make = [](const std::string& track) {
    test::ScannedLap lap(track, "road_car");
    lap.keep("lidar_top");
    gpu::Context cpu(gpu::Backend::cpu);
    std::vector<DeskewedScan> out;
    out.reserve(16);
    for (int i = 0; i < 16; ++i) out.push_back(lap.scan(cpu, 1 + i * (lap.lap_s() - 3) / 16));
    return out;
  };
  static const std::vector<DeskewedScan> oval = make("lvms"), road = make("monza_like");
  return is_oval ? oval : road;
}

/** Takes `step(cloud)` through all scans of the circuit that the argument says. */
template <class Step>
void overScans(benchmark::State& state, const Step& step) {
  const auto& all = scans(state.range(0) == 1);
  std::size_t i = 0, points = 0;
  for (auto _ : state) {
    step(all[i % all.size()]);
    points += all[i++ % all.size()].cloud.size();
  }
  state.counters["points"] = static_cast<double>(points) / static_cast<double>(state.iterations());
}

void BM_Chain(benchmark::State& state) {
  gpu::Context cpu(gpu::Backend::cpu);
  WallDetector detector(cpu, {});
  double stamp_s = 0;
  overScans(state, [&](const DeskewedScan& scan) {
    benchmark::DoNotOptimize(detector.detect(scan.cloud, stamp_s += 0.1, Pose::Identity()));
  });
}

void BM_GroundCheck(benchmark::State& state) {
  overScans(state, [&](const DeskewedScan& scan) {
    benchmark::DoNotOptimize(showsGround(scan.cloud, Pose::Identity()));
  });
}

void BM_StandingCells(benchmark::State& state) {
  gpu::Context cpu(gpu::Backend::cpu);
  gpu::StandingCells cells;
  overScans(state, [&](const DeskewedScan& scan) {
    cells =
        gpu::standingCells(cpu, viewOf(scan.cloud), WallOptions{}.forKernels(), nullptr, std::move(cells));
  });
}

/** What a scan's cells go through. */
template <class Step>
void overCells(benchmark::State& state, const Step& step) {
  gpu::Context cpu(gpu::Backend::cpu);
  std::vector<gpu::StandingCells> all;
  for (const DeskewedScan& scan : scans(state.range(0) == 1))
    all.push_back(gpu::standingCells(cpu, viewOf(scan.cloud), WallOptions{}.forKernels()));
  std::size_t i = 0;
  for (auto _ : state) step(cpu, all[i++ % all.size()]);
}

void BM_Clusters(benchmark::State& state) {
  std::vector<std::int32_t> labels;
  overCells(state, [&](gpu::Context& cpu, const gpu::StandingCells& cells) {
    labels = gpu::clusters(cpu, cells.face.view(), 1.5F, std::move(labels));
  });
}

void BM_ClustersAndFit(benchmark::State& state) {
  WallFit fit{{}};
  std::vector<std::int32_t> labels;
  overCells(state, [&](gpu::Context& cpu, const gpu::StandingCells& cells) {
    labels = gpu::clusters(cpu, cells.face.view(), 1.5F, std::move(labels));
    fit.take(cells, labels);
    benchmark::DoNotOptimize(fit.find(Side::left));
    benchmark::DoNotOptimize(fit.find(Side::right));
  });
}

void BM_PathAndGuard(benchmark::State& state) {
  gpu::Context cpu(gpu::Backend::cpu);
  WallDetector detector(cpu, {});
  const WallScan walls = detector.detect(scans(true).front().cloud, 0, Pose::Identity());
  Guard guard({}, {});
  double stamp_s = 0;
  for (auto _ : state) benchmark::DoNotOptimize(guard.update({stamp_s += 0.1, false, walls, {}, 60, 0}));
}

BENCHMARK(BM_Chain)->ArgName("oval")->Arg(1)->Arg(0)->Unit(benchmark::kMillisecond);
BENCHMARK(BM_GroundCheck)->ArgName("oval")->Arg(1)->Arg(0)->Unit(benchmark::kMillisecond);
BENCHMARK(BM_StandingCells)->ArgName("oval")->Arg(1)->Arg(0)->Unit(benchmark::kMillisecond);
BENCHMARK(BM_Clusters)->ArgName("oval")->Arg(1)->Arg(0)->Unit(benchmark::kMillisecond);
BENCHMARK(BM_ClustersAndFit)->ArgName("oval")->Arg(1)->Arg(0)->Unit(benchmark::kMillisecond);
BENCHMARK(BM_PathAndGuard)->Unit(benchmark::kMillisecond);

}  // namespace

BENCHMARK_MAIN();
