/** \file
 * Racetrack IDs over 1 to 50 laps: time per key pose for the ID, the dictionary and the loop candidates. */
#include <benchmark/benchmark.h>

#include <cstdint>

#include "graph/loop_closure.h"
#include "support/centre_line.h"
#include "track/circuit.h"
#include "track/track_id.h"

namespace {

using namespace raceloc;

/** Key poses every metre of the course like Monza, lap after lap. */
struct Laps {
  Laps() {
    const Track track = readCircuit(RACELOC_ROOT "/share/tracks/monza_like.ini").track;
    ids.emplace(wayPointsAlong(test::centreLine(track, 2), TrackIdOptions{}.spacing_m), TrackIdOptions{});
    for (int s_m = 0; s_m < static_cast<int>(track.length_m()); ++s_m)
      lap.push_back(track.at(s_m).T_map_road);
  }
  /** Files the next key pose as the mapper does; returns how many earlier passes it is to be matched with. */
  std::size_t drive(RacetrackDict& dict, std::vector<Pose>& T_map_body, const Pose& T_now) const {
    const auto key = static_cast<std::uint32_t>(T_map_body.size());
    T_map_body.push_back(T_now);
    const auto id = ids->idAt(T_now);
    if (!id) return 0;
    dict.add({key, key}, *id, 0);
    return loopCandidates(dict, T_map_body, {}).size();
  }
  std::optional<TrackIds> ids;
  std::vector<Pose> lap;
};

void BM_KeyPosesOfLaps(benchmark::State& state) {
  const Laps laps;
  std::size_t candidates = 0;
  std::vector<Pose> T_map_body;
  for (auto _ : state) {
    RacetrackDict dict(laps.ids->count());
    T_map_body.clear();
    for (int lap = 0; lap < state.range(0); ++lap)
      for (const auto& T : laps.lap) candidates += laps.drive(dict, T_map_body, T);
  }
  const auto all_laps = static_cast<double>(state.range(0)) * static_cast<double>(state.iterations());
  state.counters["per_key_pose"] =
      benchmark::Counter(all_laps * static_cast<double>(laps.lap.size()),
                         benchmark::Counter::kIsRate | benchmark::Counter::kInvert);
  state.counters["candidates_per_lap"] = static_cast<double>(candidates) / all_laps;
}
BENCHMARK(BM_KeyPosesOfLaps)
    ->Arg(1)
    ->Arg(2)
    ->Arg(5)
    ->Arg(10)
    ->Arg(20)
    ->Arg(50)
    ->Unit(benchmark::kMillisecond);

void BM_IdAlone(benchmark::State& state) {
  const Laps laps;
  std::size_t k = 0;
  for (auto _ : state) {
    benchmark::DoNotOptimize(laps.ids->idAt(laps.lap[k]));
    k = k + 1 < laps.lap.size() ? k + 1 : 0;
  }
}
BENCHMARK(BM_IdAlone);

}  // namespace

BENCHMARK_MAIN();
