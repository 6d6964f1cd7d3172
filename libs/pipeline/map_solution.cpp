#include "pipeline/map_solution.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "core/errors.h"
#include "track/driven_line.h"

namespace raceloc {

namespace {

std::optional<TrackLoop> loopOf(const std::vector<Pose>& T_map_body, const SurveyedDrives& drives,
                                std::optional<std::vector<Eigen::Vector3d>> line,
                                const MapperOptions& options) {
  // Without fixes the ends of a lap may have drifted apart by as much as loops are looked for in.
  FirstLapOptions drifted = options.first_lap;
  drifted.close_m += options.loops.search_m;
  for (const FirstLapOptions& first_lap : {options.first_lap, drifted})
    for (std::size_t begin = 0; begin < T_map_body.size() && !line;) {
      std::size_t end = begin + 1;
      while (end < T_map_body.size() && drives.session_of[end] == drives.session_of[begin]) ++end;
      const auto at = [&](std::size_t key) { return T_map_body.begin() + static_cast<std::ptrdiff_t>(key); };
      line = firstFullLap({at(begin), at(end)}, first_lap);
      begin = end;
    }
  if (!line) return std::nullopt;
  double length_m = 0;
  for (std::size_t i = 0; i < line->size(); ++i)
    length_m += ((*line)[(i + 1) % line->size()] - (*line)[i]).norm();
  TrackIds ids(wayPointsAlong(*line, options.track_id.spacing_m), options.track_id);
  RacetrackDict dict(ids.count());
  return TrackLoop{std::move(ids), std::move(dict), length_m};
}

/** How far off each key pose may be before loops are closed: fixes that agree with it hold it, and odometry drifts
 * away from them. [m] */
std::vector<double> doubtOf(const std::vector<Keyframe>& keyframes, const std::vector<Pose>& T_map_body,
                            const GraphOptions& o) {
  constexpr double kFixes_m = 0.5, kDrift_share = 0.005, kLost_m = 1e3;
  std::vector<double> doubt_m(keyframes.size());
  double now_m = kLost_m;
  for (std::size_t key = 0; key < keyframes.size(); ++key) {
    now_m = beginsDrive(keyframes[key])
                ? kLost_m
                : now_m + kDrift_share * keyframes[key].since_last.T_start_end.translation().norm();
    for (const KeyGps& gps : keyframes[key].gps) {
      const double sigma_m = std::sqrt(flooredFix(gps.cov_map_m2, o).trace() / 3);
      const double off_m = (T_map_body[key] * gps.p_body_antenna_m - gps.p_map_antenna_m).norm();
      if (off_m < 3 * sigma_m) now_m = std::min(now_m, kFixes_m + 3 * sigma_m);
    }
    doubt_m[key] = now_m;
  }
  for (std::size_t key = keyframes.size() - 1; key > 0; --key)  // and from the fixes that follow
    if (!beginsDrive(keyframes[key]))
      doubt_m[key - 1] =
          std::min(doubt_m[key - 1],
                   doubt_m[key] + kDrift_share * keyframes[key].since_last.T_start_end.translation().norm());
  return doubt_m;
}

/** Enters a key pose that has an ID into the dictionary. \return whether it has */
bool passed(TrackLoop& loop, const SurveyedDrives& drives, const std::vector<Pose>& T_map_body,
            std::size_t key) {
  const auto id = loop.ids.idAt(T_map_body[key]);
  const auto number = static_cast<std::uint32_t>(key);
  if (id) loop.dict.add({number, number}, *id, drives.session_of[key]);
  return id.has_value();
}

/** Loops, and T_map_body bent by them. */
LoopClosures closeLoops(gpu::Context& context, TrackLoop& loop, const SurveyedDrives& drives,
                        std::vector<Pose>& T_map_body, const ScanStore& scans, const MapperOptions& options,
                        const StageProgress& progress) {
  OdometryChain chain;
  for (const Keyframe& k : drives.keyframes)
    chain.add({k.since_last.duration_s, k.since_last.T_start_end,
               flooredOdometry(k.since_last.covariance, options.graph)});
  const LoopMatcher matcher(
      context, chain, [&](std::size_t key) { return scans.scan(key); }, options.loops,
      options.matching.registration, options.matching.covariance);
  const std::vector<double> doubt_m = doubtOf(drives.keyframes, T_map_body, options.graph);
  LoopSearch search(graphWithoutLoops(GraphKind::joint, drives.keyframes, T_map_body, options.graph), chain,
                    options.loops);
  for (std::size_t key = 0; key < T_map_body.size(); ++key) {
    if (!passed(loop, drives, search.T_map_body(), key)) continue;
    std::vector<LoopMatch> matches;
    for (LoopCandidate candidate : loopCandidates(loop.dict, search.T_map_body(), options.loops)) {
      candidate.drift_m = std::min(candidate.drift_m, doubt_m[candidate.i] + doubt_m[candidate.j]);
      matches.push_back(matcher.match(candidate));
    }
    search.add(matches);
    progress("loops", static_cast<double>(key) / static_cast<double>(T_map_body.size()));
  }
  T_map_body = search.T_map_body();
  return search.closures();
}

}  // namespace

MapSolution solveGraphs(gpu::Context& context, SurveyedDrives& drives, const std::vector<SurveyLog>& logs,
                        const std::optional<std::vector<Eigen::Vector3d>>& race_line_m,
                        const ScanStore& scans, const MapperOptions& options, const StageProgress& progress) {
  auto& keyframes = drives.keyframes;
  progress("graphs", 0);
  GraphSolution gps = solveGraph(GraphKind::gps, keyframes, {}, alignedOdometry(keyframes), options.graph);
  requireOnePlace(drives, gps.T_map_body, logs);
  refuseUnchained(keyframes, gps.T_map_body, options.graph);
  gps = solveGraph(GraphKind::gps, keyframes, {}, gps.T_map_body, options.graph);
  GraphSolution joint = solveGraph(GraphKind::joint, keyframes, {}, gps.T_map_body, options.graph);
  progress("graphs", 1);

  std::optional<TrackLoop> loop = loopOf(joint.T_map_body, drives, race_line_m, options);
  if (race_line_m && std::none_of(joint.T_map_body.begin(), joint.T_map_body.end(),
                                  [&](const Pose& T) { return loop->ids.idAt(T).has_value(); }))
    throw InputError(
        "race line: the survey is nowhere near it; its metres are east and north of the map's origin");
  LoopClosures loops;
  if (loop) loops = closeLoops(context, *loop, drives, joint.T_map_body, scans, options, progress);

  progress("refinement", 0);
  GraphSolution lidar = solveGraph(GraphKind::lidar, keyframes, loops.edges, joint.T_map_body, options.graph);
  const GraphAlignment aligned = drives.origin
                                     ? alignGraphs(positionsOf(lidar.T_map_body), positionsOf(gps.T_map_body))
                                     : GraphAlignment{Pose::Identity(), 0, 1};
  // What is refused by one solution has no more say in the next.
  std::vector<GpsSpan> spans;
  constexpr int kRounds = 2;
  for (int round = 0; round < kRounds; ++round) {
    joint = solveGraph(GraphKind::joint, keyframes, loops.edges, joint.T_map_body, options.graph);
    spans = gpsSpans(keyframes, joint.T_map_body, options.graph);
    refuse(keyframes, spans);
  }
  joint = solveGraph(GraphKind::joint, keyframes, loops.edges, joint.T_map_body, options.graph);
  if (loop && !race_line_m) {  // where the car drove, as is known now
    loop = loopOf(joint.T_map_body, drives, std::nullopt, options);
    for (std::size_t key = 0; loop && key < keyframes.size(); ++key)
      (void)passed(*loop, drives, joint.T_map_body, key);
  }
  progress("refinement", 1);
  return {std::move(gps),  std::move(lidar), std::move(joint), aligned,
          std::move(loop), std::move(loops), std::move(spans)};
}

}  // namespace raceloc
