/** \file
 * Times of the kernels on the real scan pair (69.8k and 69.1k points): one thread of the CPU, and CUDA where
 * it is. */
#include <benchmark/benchmark.h>

#include <iostream>

#include "raceloc/gpu/covariance.h"
#include "raceloc/gpu/matcher.h"
#include "raceloc/gpu/voxel_grid.h"
#include "tests/scenes.h"

namespace raceloc::gpu {
namespace {

constexpr float kLeaf_m = 0.25F;
constexpr double kVoxel_m = 1.0;

void voxelGridOf(benchmark::State& state, Context& context, const Points& scan) {
  for (auto _ : state) benchmark::DoNotOptimize(voxelGrid(context, scan.view(), kLeaf_m));
  state.SetItemsProcessed(state.iterations() * static_cast<std::int64_t>(scan.size()));
}

void covariancesOf(benchmark::State& state, Context& context, const Points& cloud, Weight weight) {
  CovarianceOptions options;
  options.weight = weight;
  for (auto _ : state) benchmark::DoNotOptimize(covariances(context, cloud.view(), options));
  state.SetItemsProcessed(state.iterations() * static_cast<std::int64_t>(cloud.size()));
}

void insertOf(benchmark::State& state, Context& context, const Points& cloud) {
  const Covariances C = covariances(context, cloud.view(), {});
  for (auto _ : state) {
    VoxelMap map(context, kVoxel_m);
    benchmark::DoNotOptimize(map.insert(cloud.view(), C.view(), {}));
  }
  state.SetItemsProcessed(state.iterations() * static_cast<std::int64_t>(cloud.size()));
}

void matchOf(benchmark::State& state, Context& context, const Points& source, const Points& target,
             int voxels) {
  const Covariances C_source = covariances(context, source.view(), {});
  VoxelMap map(context, kVoxel_m);
  map.insert(target.view(), covariances(context, target.view(), {}).view(), {});
  MatchOptions options;
  options.neighbour_voxels = voxels;
  Match result;
  for (auto _ : state) result = match(context, source.view(), C_source.view(), map, {}, options);
  state.counters["iterations"] = result.iterations;
  state.counters["converged"] = result.stop == Stop::converged ? 1 : 0;
}

}  // namespace
}  // namespace raceloc::gpu

int main(int argc, char** argv) {
  using namespace raceloc::gpu;
  benchmark::Initialize(&argc, argv);
  const auto pair = test::readScanPair(GK_SHARED_DATA);
  if (!pair) {
    std::cerr << "no scan pair in " << GK_SHARED_DATA << '\n';
    return 2;
  }
  std::vector<Context> contexts;
  contexts.emplace_back(Backend::cpu);
  try {
    contexts.emplace_back(Backend::cuda);
  } catch (const DeviceError& reason) {
    std::cerr << "CUDA: " << reason.what() << '\n';
  }
  const Points source = voxelGrid(contexts[0], pair->source.view(), kLeaf_m);
  const Points target = voxelGrid(contexts[0], pair->target.view(), kLeaf_m);
  for (Context& context : contexts) {
    const std::string device = context.backend() == Backend::cpu ? "/cpu" : "/cuda";
    const auto bench = [&](const std::string& name, auto&& body) {
      benchmark::RegisterBenchmark((name + device).c_str(), body)
          ->Unit(benchmark::kMillisecond)
          ->UseRealTime();
    };
    bench("voxel_grid", [&](auto& s) { voxelGridOf(s, context, pair->source); });
    bench("covariances/rbf", [&](auto& s) { covariancesOf(s, context, source, Weight::rbf); });
    bench("covariances/gaussian", [&](auto& s) { covariancesOf(s, context, source, Weight::gaussian); });
    bench("covariances/polynomial", [&](auto& s) { covariancesOf(s, context, source, Weight::polynomial); });
    bench("covariances/hist", [&](auto& s) { covariancesOf(s, context, source, Weight::hist); });
    bench("covariances/laplacian", [&](auto& s) { covariancesOf(s, context, source, Weight::laplacian); });
    bench("map_insert", [&](auto& s) { insertOf(s, context, target); });
    bench("match/1", [&](auto& s) { matchOf(s, context, source, target, 1); });
    bench("match/7", [&](auto& s) { matchOf(s, context, source, target, 7); });
  }
  benchmark::RunSpecifiedBenchmarks();
  return 0;
}
