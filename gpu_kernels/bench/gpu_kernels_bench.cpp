/** \file
 * Times of the kernels on the real scan pair (69.8k and 69.1k points): argument 0 is one thread of the CPU, 1
 * is CUDA. */
#include <benchmark/benchmark.h>

#include <stdexcept>
#include <string>

#include "raceloc/gpu/covariance.h"
#include "raceloc/gpu/deskew.h"
#include "raceloc/gpu/matcher.h"
#include "raceloc/gpu/prepare.h"
#include "raceloc/gpu/voxel_grid.h"
#include "tests/scenes.h"

namespace raceloc::gpu {
namespace {

constexpr float kLeaf_m = 0.25F;
constexpr double kVoxel_m = 1.0;

struct Scans {
  test::ScanPair raw;
  Points source, target;  ///< one point a voxel of kLeaf_m
};

const Scans& scans() {
  static const Scans loaded = [] {
    const auto pair = test::readScanPair(GK_SHARED_DATA);
    if (!pair) throw std::runtime_error(std::string("no scan pair in ") + GK_SHARED_DATA);
    Context cpu(Backend::cpu);
    return Scans{*pair, voxelGrid(cpu, pair->source.view(), kLeaf_m),
                 voxelGrid(cpu, pair->target.view(), kLeaf_m)};
  }();
  return loaded;
}

/** Runs the body on the device of the argument, or says why not. */
template <class Body>
void onDevice(benchmark::State& state, const Body& body) {
  try {
    Context context(state.range(0) == 0 ? Backend::cpu : Backend::cuda);
    body(context);
  } catch (const std::runtime_error& reason) {
    state.SkipWithError(reason.what());
  }
}

void BM_Deskew(benchmark::State& state) {
  onDevice(state, [&](Context& context) {
    const test::MovingScan m = test::moving(scans().raw.source);
    while (state.KeepRunning())
      benchmark::DoNotOptimize(deskew(context, m.scan.view(), m.time_s.data(), m.sweep(), {}));
    state.SetItemsProcessed(state.iterations() * static_cast<std::int64_t>(m.scan.size()));
  });
}
BENCHMARK(BM_Deskew)->DenseRange(0, 1)->UseRealTime()->Unit(benchmark::kMillisecond);

void BM_VoxelGrid(benchmark::State& state) {
  onDevice(state, [&](Context& context) {
    const Points& scan = scans().raw.source;
    while (state.KeepRunning()) benchmark::DoNotOptimize(voxelGrid(context, scan.view(), kLeaf_m));
    state.SetItemsProcessed(state.iterations() * static_cast<std::int64_t>(scan.size()));
  });
}
BENCHMARK(BM_VoxelGrid)->DenseRange(0, 1)->UseRealTime()->Unit(benchmark::kMillisecond);

void BM_Covariances(benchmark::State& state, Weight weight) {
  onDevice(state, [&](Context& context) {
    CovarianceOptions options;
    options.weight = weight;
    const Points& cloud = scans().source;
    while (state.KeepRunning()) benchmark::DoNotOptimize(covariances(context, cloud.view(), options));
    state.SetItemsProcessed(state.iterations() * static_cast<std::int64_t>(cloud.size()));
  });
}
BENCHMARK_CAPTURE(BM_Covariances, rbf, Weight::rbf)
    ->DenseRange(0, 1)
    ->UseRealTime()
    ->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(BM_Covariances, gaussian, Weight::gaussian)
    ->DenseRange(0, 1)
    ->UseRealTime()
    ->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(BM_Covariances, polynomial, Weight::polynomial)
    ->DenseRange(0, 1)
    ->UseRealTime()
    ->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(BM_Covariances, hist, Weight::hist)
    ->DenseRange(0, 1)
    ->UseRealTime()
    ->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(BM_Covariances, laplacian, Weight::laplacian)
    ->DenseRange(0, 1)
    ->UseRealTime()
    ->Unit(benchmark::kMillisecond);

void BM_MapInsert(benchmark::State& state) {
  onDevice(state, [&](Context& context) {
    const Points& cloud = scans().target;
    const Covariances C = covariances(context, cloud.view(), {});
    while (state.KeepRunning()) {
      VoxelMap map(context, kVoxel_m);
      benchmark::DoNotOptimize(map.insert(cloud.view(), C.view(), {}));
    }
    state.SetItemsProcessed(state.iterations() * static_cast<std::int64_t>(cloud.size()));
  });
}
BENCHMARK(BM_MapInsert)->DenseRange(0, 1)->UseRealTime()->Unit(benchmark::kMillisecond);

std::string said(const Match& result) {
  return std::to_string(result.iterations) +
         (result.stop == Stop::converged ? " iterations" : " iterations, NOT converged");
}

/** Second argument: voxels tried around a point. */
void BM_Match(benchmark::State& state) {
  onDevice(state, [&](Context& context) {
    const Points &source = scans().source, &target = scans().target;
    const Covariances C = covariances(context, source.view(), {});
    VoxelMap map(context, kVoxel_m);
    map.insert(target.view(), covariances(context, target.view(), {}).view(), {});
    MatchOptions options;
    options.neighbour_voxels = static_cast<int>(state.range(1));
    Match result;
    while (state.KeepRunning()) result = match(context, source.view(), C.view(), map, {}, options);
    state.SetLabel(said(result));
  });
}
BENCHMARK(BM_Match)->ArgsProduct({{0, 1}, {1, 7}})->UseRealTime()->Unit(benchmark::kMillisecond);

/** Both clouds from raw points to the pose: grid, covariances, map of the target, match. */
void BM_RawPairToPose(benchmark::State& state) {
  onDevice(state, [&](Context& context) {
    const test::ScanPair& raw = scans().raw;
    Match result;
    while (state.KeepRunning()) {
      const Points target = voxelGrid(context, raw.target.view(), kLeaf_m);
      VoxelMap map(context, kVoxel_m);
      map.insert(target.view(), covariances(context, target.view(), {}).view(), {});
      const Points source = voxelGrid(context, raw.source.view(), kLeaf_m);
      result = match(context, source.view(), covariances(context, source.view(), {}).view(), map, {}, {});
    }
    state.SetLabel(said(result));
  });
}
BENCHMARK(BM_RawPairToPose)->DenseRange(0, 1)->UseRealTime()->Unit(benchmark::kMillisecond);

/** A raw scan to its pose in a map that is there: what raceloc-live does. */
void BM_RawScanToPose(benchmark::State& state) {
  onDevice(state, [&](Context& context) {
    const Points& target = scans().target;
    VoxelMap map(context, kVoxel_m);
    map.insert(target.view(), covariances(context, target.view(), {}).view(), {});
    while (state.KeepRunning()) {
      const Points source = voxelGrid(context, scans().raw.source.view(), kLeaf_m);
      benchmark::DoNotOptimize(
          match(context, source.view(), covariances(context, source.view(), {}).view(), map, {}, {}));
    }
  });
}
BENCHMARK(BM_RawScanToPose)->DenseRange(0, 1)->UseRealTime()->Unit(benchmark::kMillisecond);

constexpr Crop kEverything{0, 100, 0, 0, 0};  // the scan ends at 53 m

/** The source with times and the poses of a sensor that does not move: all the work, and the scan stays what it is. */
test::MovingScan stillScan() {
  test::MovingScan m = test::moving(scans().raw.source);
  for (Affine& T : m.T_end_lidar) T = {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0};
  return m;
}

/** Second argument: 0 is its three steps one after another, 1 is prepare(). */
void BM_Prepare(benchmark::State& state) {
  onDevice(state, [&](Context& context) {
    const test::MovingScan m = stillScan();
    const PointsView scan = m.scan.view();
    while (state.KeepRunning()) {
      if (state.range(1) == 1) {
        benchmark::DoNotOptimize(
            prepare(context, scan, m.time_s.data(), m.sweep(), kEverything, kLeaf_m, {}));
      } else {
        const Deskewed moved = deskew(context, scan, m.time_s.data(), m.sweep(), kEverything);
        const Points thinned = voxelGrid(context, moved.points.view(), kLeaf_m);
        benchmark::DoNotOptimize(covariances(context, thinned.view(), {}));
      }
    }
  });
}
BENCHMARK(BM_Prepare)->ArgsProduct({{0, 1}, {0, 1}})->UseRealTime()->Unit(benchmark::kMillisecond);

/** As BM_RawScanToPose, but of a scan with times, by prepare(). */
void BM_MovingScanToPose(benchmark::State& state) {
  onDevice(state, [&](Context& context) {
    const Points& target = scans().target;
    VoxelMap map(context, kVoxel_m);
    map.insert(target.view(), covariances(context, target.view(), {}).view(), {});
    const test::MovingScan m = stillScan();
    Match result;
    while (state.KeepRunning()) {
      const PreparedScan source =
          prepare(context, m.scan.view(), m.time_s.data(), m.sweep(), kEverything, kLeaf_m, {});
      result = match(context, source, map, {}, {});
    }
    state.SetLabel(said(result));
  });
}
BENCHMARK(BM_MovingScanToPose)->DenseRange(0, 1)->UseRealTime()->Unit(benchmark::kMillisecond);

}  // namespace
}  // namespace raceloc::gpu

BENCHMARK_MAIN();
