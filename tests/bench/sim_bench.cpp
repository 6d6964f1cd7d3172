/** \file
 * The simulator: rays and simulated seconds per wall second. */
#include <benchmark/benchmark.h>
#include <tbb/global_control.h>

#include <algorithm>

#include "sim/race.h"
#include "sim/scenery.h"
#include "support/lap.h"

namespace {

using namespace raceloc;

/** Rays alone: sweeps of 128 x 1024 round the road car. */
void BM_Sweep(benchmark::State& state) {
  const tbb::global_control limit(tbb::global_control::max_allowed_parallelism,
                                  static_cast<std::size_t>(state.range(0)));
  test::Lap lap("monza_like", "road_car");
  const World world(sceneryMesh(lap.circuit, 1));
  const Traffic nobody(lap.circuit.track, lap.line, lap.profile, lap.file.car, 0, 1);
  const auto top = std::find_if(lap.file.lidars.begin(), lap.file.lidars.end(),
                                [](const auto& lidar) { return lidar.first == "lidar_top"; });
  const LidarOptions& options = top->second;
  const LidarModel lidar(options, "lidar", 1);
  lap.driveUntil(30);
  std::uint64_t number = 0;
  for (auto _ : state) {
    benchmark::DoNotOptimize(
        lidar.sweep(lap.motion, world, nobody, 1 + 0.1 * static_cast<double>(number % 280), number));
    ++number;
  }
  state.counters["rays/s"] = benchmark::Counter(static_cast<double>(number) * options.beams * options.columns,
                                                benchmark::Counter::kIsRate);
}
BENCHMARK(BM_Sweep)->Arg(1)->Arg(2)->UseRealTime()->Unit(benchmark::kMillisecond);

/** The road car with all its devices, without a log: how many seconds of race a second of wall time gives. */
void BM_Race(benchmark::State& state) {
  const tbb::global_control limit(tbb::global_control::max_allowed_parallelism,
                                  static_cast<std::size_t>(state.range(0)));
  const Circuit circuit = readCircuit(test::shipped("share/tracks/monza_like.ini"));
  const CarFile car = readCarFile(test::shipped("ini/sim/road_car.ini"));
  RaceOptions options;
  options.laps = 100;
  Race race(circuit, car, options);
  double time_s = 0;
  for (auto _ : state) {
    const double end_s = time_s + 1;
    while (time_s < end_s) time_s = race.next()->time_s;
  }
  state.counters["race_s/s"] = benchmark::Counter(time_s, benchmark::Counter::kIsRate);
}
BENCHMARK(BM_Race)->Arg(1)->Arg(2)->UseRealTime()->Unit(benchmark::kMillisecond);

}  // namespace

BENCHMARK_MAIN();
