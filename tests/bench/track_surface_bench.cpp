/** \file
 * Time of one look at the road and walls beside a pose, along laps of a course like Monza. */
#include <benchmark/benchmark.h>

#include "pipeline/track_surface.h"
#include "support/surveyed_track.h"
#include "track/circuit.h"

namespace {

using namespace raceloc;

void BM_TrackSurface(benchmark::State& state) {
  const Track track = readCircuit(RACELOC_ROOT "/share/tracks/monza_like.ini").track;
  const TrackSurface surface(test::surveyedTrack(track, TrackIdOptions{}.spacing_m), {});
  std::vector<Pose> lap;
  for (int k = 0; 0.7 * k < track.length_m(); ++k) lap.push_back(track.surface(0.7 * k, 2).T_map_surface);
  std::size_t k = 0;
  for (auto _ : state) {
    const Pose& T = lap[k];
    benchmark::DoNotOptimize(surface.at(T.translation().head<2>(), yawOf(T), T.translation().z()));
    k = k + 1 < lap.size() ? k + 1 : 0;
  }
}
BENCHMARK(BM_TrackSurface);

}  // namespace

BENCHMARK_MAIN();
