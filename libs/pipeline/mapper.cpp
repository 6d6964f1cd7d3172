#include "pipeline/mapper.h"

#include <tbb/parallel_invoke.h>
#include <tbb/parallel_pipeline.h>
#include <tbb/task_arena.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <limits>
#include <map>
#include <set>
#include <utility>

#include "core/errors.h"
#include "core/statistics.h"
#include "graph/graph_alignment.h"
#include "graph/loop_search.h"
#include "map/road_surface.h"
#include "map/static_points.h"
#include "map/voxel_average.h"
#include "map/wall_lines.h"
#include "track/driven_line.h"
#include "track/racetrack_dict.h"

namespace raceloc {

namespace {

/** What identifies a log without reading it whole. */
std::string identityOf(const std::string& path) {
  std::error_code unknown;
  const auto size = std::filesystem::file_size(path, unknown);
  const auto written = std::filesystem::last_write_time(path, unknown).time_since_epoch().count();
  return std::filesystem::path(path).filename().string() + " " + std::to_string(size) + " " +
         std::to_string(written);
}

/** The scans of all key poses, on the disk. */
class ScanStore {
 public:
  explicit ScanStore(StageStore& store) : x_store(store) {}

  void put(std::size_t survey, const std::string& input, std::size_t key, const Cloud& scan) {
    x_store.put(name(survey, key), input, toBytes(scan));
  }
  void addSurvey(std::size_t survey, const std::string& input, std::size_t keys) {
    for (std::size_t key = 0; key < keys; ++key) x_places.push_back({survey, input, key});
  }
  [[nodiscard]] Cloud scan(std::size_t key) const {
    const Place& at = x_places.at(key);
    const auto bytes = x_store.get(name(at.survey, at.key), at.input);
    if (!bytes)
      throw InputError("scan " + std::to_string(key) +
                       ", kept beside the map in its .build file, is damaged: build the map with --replace");
    return cloudFrom(*bytes);
  }

 private:
  static std::string name(std::size_t survey, std::size_t key) {
    return "survey " + std::to_string(survey) + ", scan " + std::to_string(key);
  }
  struct Place {
    std::size_t survey;
    std::string input;
    std::size_t key;  ///< of the survey
  };
  StageStore& x_store;
  std::vector<Place> x_places;  ///< by key pose of all surveys
};

/** All drives as one row of key poses, in the order of the logs. */
struct Drives {
  std::vector<Survey> surveys;  ///< without their key poses
  std::vector<Keyframe> keyframes;
  std::vector<int> session_of;  ///< by key pose
  std::optional<GeodeticPoint> origin;
};

/** Of what surveyOf() makes and how it is kept: another one's results are not taken. */
constexpr char kSurveyFormat[] = "1";

/** Stage: names of the logs whose surveys are kept. */
constexpr char kReadLogs[] = "logs";

/** \throws InputError if a run before read a log that is not named now: it would be lost. */
void requireAllNamed(const StageStore& store, const std::vector<SurveyLog>& logs) {
  const auto kept = store.get(kReadLogs, "");
  if (!kept) return;
  for (ByteReader in(*kept); in.left() > 0;) {
    const std::string name = in.text();
    if (std::none_of(logs.begin(), logs.end(), [&](const SurveyLog& log) {
          return std::filesystem::path(log.path).filename() == name;
        }))
      throw InputError(
          "rawlog " + name +
          ": was read by the build that is to go on, but is not named now; name it too, or build the "
          "map with --replace");
  }
}

Drives survey(const std::vector<SurveyLog>& logs, StageStore& store, ScanStore& scans,
              const MapperOptions& options, const std::string& tool_version, const StageProgress& progress) {
  Drives drives;
  requireAllNamed(store, logs);
  Bytes read;
  for (std::size_t n = 0; n < logs.size(); ++n) {
    const std::string stage = "survey " + std::to_string(n);
    Bytes origin;
    if (drives.origin)
      for (const double number :
           {drives.origin->latitude_deg, drives.origin->longitude_deg, drives.origin->height_m})
        append(origin, number);
    const std::string input = inputHash({tool_version,
                                         kSurveyFormat,
                                         identityOf(logs[n].path),
                                         options.resultText(),
                                         {origin.begin(), origin.end()}});
    const std::string title = logs.size() == 1
                                  ? "odometry"
                                  : "odometry " + std::to_string(n + 1) + "/" + std::to_string(logs.size());
    Survey found;
    if (const auto kept = store.get(stage, input)) {
      found = surveyFrom(*kept);
      found.kept = true;
    } else {
      found = surveyOf(
          logs[n], drives.origin, options,
          [&](std::size_t key, const Cloud& scan) { scans.put(n, input, key, scan); },
          [&](double share) { progress(title, share); });
      store.put(stage, input, toBytes(found));
    }
    if (logs.size() > 1 && !found.origin)
      throw InputError("rawlog " + logs[n].path +
                       ": no GPS, so where it belongs among the other logs is not known; map it alone");
    if (!drives.origin) drives.origin = found.origin;
    append(read, found.session);
    store.put(kReadLogs, "", read);
    scans.addSurvey(n, input, found.keyframes.size());
    drives.session_of.insert(drives.session_of.end(), found.keyframes.size(), static_cast<int>(n));
    for (auto& k : found.keyframes) {
      drives.keyframes.push_back(std::move(k));
    }
    found.keyframes.clear();
    drives.surveys.push_back(std::move(found));
  }
  return drives;
}

InputError ofAnotherPlace(const SurveyLog& log, double nearest_m) {
  return InputError("rawlog " + log.path + ": of another place, " + std::to_string(std::lround(nearest_m)) +
                    " m from the logs before it; map it alone");
}

/** \throws InputError naming a log that was recorded nowhere near those before it. */
void requireOnePlace(const Drives& drives, const std::vector<Pose>& T_map_body,
                     const std::vector<SurveyLog>& logs) {
  constexpr double kNear_m = 200;
  for (std::size_t key = 0; key < T_map_body.size();) {
    const int session = drives.session_of[key];
    const std::size_t begin = key;
    bool near = session == 0;
    double nearest_m = std::numeric_limits<double>::max();
    for (; key < T_map_body.size() && drives.session_of[key] == session; ++key)
      for (std::size_t other = 0; other < begin && !near; ++other) {
        nearest_m =
            std::min(nearest_m, (T_map_body[key].translation() - T_map_body[other].translation()).norm());
        near = nearest_m < kNear_m;
      }
    if (!near) throw ofAnotherPlace(logs[static_cast<std::size_t>(session)], nearest_m);
  }
}

/** What is too far apart for requireOnePlace() is told before the odometry, by the fixes alone. */
void requireNearFixes(const std::vector<SurveyLog>& logs) {
  constexpr double kFar_m = 1000;  // a drive may go on so far without fixes
  for (std::size_t n = 1; n < logs.size(); ++n) {
    const auto& fixes_m = logs[n].summary.fixes_earth_m;
    double nearest_m = std::numeric_limits<double>::max();
    for (std::size_t before = 0; before < n; ++before) {
      const auto& others_m = logs[before].summary.fixes_earth_m;
      if (fixes_m.isEmpty() || others_m.isEmpty()) return;  // told with the odometry
      nearest_m = std::min(nearest_m, fixes_m.exteriorDistance(others_m));
    }
    if (nearest_m > kFar_m) throw ofAnotherPlace(logs[n], nearest_m);
  }
}

std::vector<Eigen::Vector3d> positionsOf(const std::vector<Pose>& poses) {
  std::vector<Eigen::Vector3d> positions;
  positions.reserve(poses.size());
  for (const Pose& T : poses) positions.emplace_back(T.translation());
  return positions;
}

/** Racetrack IDs of the key poses, where there is a loop. */
struct Loop {
  TrackIds ids;
  RacetrackDict dict;
  double length_m;
};

std::optional<Loop> loopOf(const std::vector<Pose>& T_map_body, const Drives& drives,
                           std::optional<std::vector<Eigen::Vector3d>> line, const MapperOptions& options) {
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
  return Loop{std::move(ids), std::move(dict), length_m};
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
bool passed(Loop& loop, const Drives& drives, const std::vector<Pose>& T_map_body, std::size_t key) {
  const auto id = loop.ids.idAt(T_map_body[key]);
  const auto number = static_cast<std::uint32_t>(key);
  if (id) loop.dict.add({number, number}, *id, drives.session_of[key]);
  return id.has_value();
}

/** Loops, and T_map_body bent by them. */
LoopClosures closeLoops(gpu::Context& context, Loop& loop, const Drives& drives,
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

/** Points with their covariances, tile by tile: a tile needs what is within the covariances' radius around it. */
TiledMap tilesOf(gpu::Context& context, const Cloud& points, const CovarianceOptions& covariance,
                 double tile_size_m) {
  std::map<std::pair<int, int>, std::vector<std::size_t>> within;  ///< tile or its margin
  std::map<std::pair<int, int>, std::vector<std::size_t>> own;
  const auto tileOf = [&](double x_m, double y_m) {
    return std::make_pair(static_cast<int>(std::floor(x_m / tile_size_m)),
                          static_cast<int>(std::floor(y_m / tile_size_m)));
  };
  for (std::size_t i = 0; i < points.size(); ++i) {
    const Eigen::Vector3d p = points.point(i).cast<double>();
    own[tileOf(p.x(), p.y())].push_back(i);
    const auto low = tileOf(p.x() - covariance.radius_m, p.y() - covariance.radius_m);
    const auto high = tileOf(p.x() + covariance.radius_m, p.y() + covariance.radius_m);
    for (int ix = low.first; ix <= high.first; ++ix)
      for (int iy = low.second; iy <= high.second; ++iy) within[{ix, iy}].push_back(i);
  }
  TiledMap map(tile_size_m);
  for (const auto& [tile, indices] : own) {
    // The tile's own points first: those are the ones that go into the map.
    std::vector<std::size_t> order = indices;
    std::set_difference(within[tile].begin(), within[tile].end(), indices.begin(), indices.end(),
                        std::back_inserter(order));
    Cloud around;
    around.reserve(order.size());
    const Eigen::Vector3d corner_m(tile.first * tile_size_m, tile.second * tile_size_m, 0);
    for (const std::size_t i : order) around.push((points.point(i).cast<double>() - corner_m).cast<float>());
    CovarianceCloud known = withCovariances(context, std::move(around), covariance);
    const std::size_t n = indices.size();
    for (auto* values : {&known.cloud.x, &known.cloud.y, &known.cloud.z}) values->resize(n);
    gpu::Covariances& c = known.covariances;
    for (auto* values : {&c.xx, &c.xy, &c.xz, &c.yy, &c.yz, &c.zz}) values->resize(n);
    c.neighbours.clear();
    map.insert(Tile{tile.first, tile.second, std::move(known.cloud), std::move(c)});
  }
  return map;
}

double loopResidual(const std::vector<LoopEdge>& loops, const std::vector<Pose>& T_map_body) {
  std::vector<double> off_m;
  off_m.reserve(loops.size());
  for (const LoopEdge& loop : loops)
    off_m.push_back(
        (loop.T_i_j.inverse() * T_map_body[loop.i].inverse() * T_map_body[loop.j]).translation().norm());
  return quantile(off_m, 0.5);
}

Matrix6d informationOf(const Matrix6d& covariance) {
  const Matrix6d information = covariance.inverse();
  return 0.5 * (information + information.transpose());
}

/** Everything of the graphs that the map keeps. */
void describeGraphs(MapContent& content, const Drives& drives, const std::vector<LoopEdge>& loops,
                    const std::vector<Pose>& T_map_body, const GraphOptions& o) {
  const auto number = [](std::size_t key) { return static_cast<std::int32_t>(key); };
  for (std::size_t key = 0; key < drives.keyframes.size(); ++key) {
    const Keyframe& k = drives.keyframes[key];
    if (!beginsDrive(k))
      content.edges.push_back({number(key - 1), number(key), k.since_last.T_start_end,
                               informationOf(flooredOdometry(k.since_last.covariance, o)),
                               EdgeKind::odometry});
    for (const KeyGps& gps : k.gps) {
      const Eigen::Matrix3d covariance = flooredFix(gps.cov_map_m2, o);
      const Eigen::Vector3d off_m = T_map_body[key] * gps.p_body_antenna_m - gps.p_map_antenna_m;
      const RobustLoss loss{RobustLoss::Kind::cauchy, o.gps_robust_width};
      content.fixes.push_back({number(key), gps.receiver, gps.p_map_antenna_m, covariance,
                               gps.p_body_antenna_m,
                               gps.refused ? 0 : loss.weight(off_m.dot(covariance.ldlt().solve(off_m)))});
    }
  }
  for (const LoopEdge& loop : loops)
    content.edges.push_back(
        {number(loop.i), number(loop.j), loop.T_i_j, informationOf(loop.covariance), EdgeKind::loop});
}

/** What the graphs came to. */
struct Solved {
  GraphSolution gps, lidar, joint;
  GraphAlignment aligned;  ///< of the LiDAR graph with the GPS graph
  std::optional<Loop> loop;
  LoopClosures loops;
  std::vector<GpsSpan> spans;
};

Solved solve(gpu::Context& context, Drives& drives, const MapInput& input, const ScanStore& scans,
             const MapperOptions& options, const StageProgress& progress) {
  auto& keyframes = drives.keyframes;
  progress("graphs", 0);
  GraphSolution gps = solveGraph(GraphKind::gps, keyframes, {}, alignedOdometry(keyframes), options.graph);
  requireOnePlace(drives, gps.T_map_body, input.logs);
  refuseUnchained(keyframes, gps.T_map_body, options.graph);
  gps = solveGraph(GraphKind::gps, keyframes, {}, gps.T_map_body, options.graph);
  GraphSolution joint = solveGraph(GraphKind::joint, keyframes, {}, gps.T_map_body, options.graph);
  progress("graphs", 1);

  std::optional<Loop> loop = loopOf(joint.T_map_body, drives, input.race_line_m, options);
  if (input.race_line_m && std::none_of(joint.T_map_body.begin(), joint.T_map_body.end(),
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
  if (loop && !input.race_line_m) {  // where the car drove, as is known now
    loop = loopOf(joint.T_map_body, drives, std::nullopt, options);
    for (std::size_t key = 0; loop && key < keyframes.size(); ++key)
      (void)passed(*loop, drives, joint.T_map_body, key);
  }
  progress("refinement", 1);
  return {std::move(gps),  std::move(lidar), std::move(joint), aligned,
          std::move(loop), std::move(loops), std::move(spans)};
}

/** All that stays of the scans, in the map frame. */
struct StaticScene {
  Cloud points;
  WallThickness walls;
  double moving_share;
};

/** Reads all scans in order; `look` has several of them at once, `take` what it made of them, in order, one by one. */
template <class Look, class Take>
void forEachScan(std::size_t scans, const ScanStore& store, int threads, const Look& look, const Take& take) {
  using KeyScan = std::pair<std::size_t, Cloud>;
  using Made = decltype(look(std::size_t{}, Cloud()));
  std::size_t next = 0, taken = 0;
  const auto read = [&](tbb::flow_control& flow) -> KeyScan {
    if (next == scans) {
      flow.stop();
      return {};
    }
    const std::size_t key = next++;
    return {key, store.scan(key)};
  };
  const auto made = [&](KeyScan scan) { return look(scan.first, std::move(scan.second)); };
  const auto done = [&](Made result) { take(std::move(result), ++taken); };
  tbb::task_arena(threads).execute([&] {
    tbb::parallel_pipeline(2 * static_cast<std::size_t>(threads),
                           tbb::make_filter<void, KeyScan>(tbb::filter_mode::serial_in_order, read) &
                               tbb::make_filter<KeyScan, Made>(tbb::filter_mode::parallel, made) &
                               tbb::make_filter<Made, void>(tbb::filter_mode::serial_in_order, done));
  });
}

/** Scans are read three times rather than kept: which voxels hold points, which of those others see through, the
 * rest. */
StaticScene staticScene(const Drives& drives, const ScanStore& scans, const std::vector<Pose>& T_map_body,
                        const MapperOptions& options, const StageProgress& progress) {
  const std::size_t keys = T_map_body.size();
  const int threads = options.matching.device.threads;
  const auto shareOf = [&](std::size_t taken) {
    return static_cast<double>(taken) / static_cast<double>(keys);
  };
  StaticVoxels still(options.static_points);
  forEachScan(
      keys, scans, threads, [&](std::size_t key, Cloud scan) { return std::make_pair(key, std::move(scan)); },
      [&](const std::pair<std::size_t, Cloud>& scan, std::size_t taken) {
        still.mark(scan.second, T_map_body[scan.first]);
        progress("occupied space", shareOf(taken));
      });
  still.endMarking();
  forEachScan(
      keys, scans, threads,
      [&](std::size_t key, const Cloud& scan) {
        const auto session = static_cast<std::size_t>(drives.session_of[key]);
        return still.look(scan, T_map_body[key], drives.surveys[session].p_body_eyes_m);
      },
      [&](const StaticVoxels::Seen& seen, std::size_t taken) {
        still.count(seen);
        progress("moving objects", shareOf(taken));
      });
  still.endCounting();
  VoxelAverage average(options.map.point_spacing_m);
  WallSharpness sharpness;
  std::size_t seen = 0, moving = 0;
  forEachScan(
      keys, scans, threads,
      [&](std::size_t key, const Cloud& whole) {
        return std::make_pair(whole.size(),
                              transformed(still.staticPart(whole, T_map_body[key]), T_map_body[key]));
      },
      [&](const std::pair<std::size_t, Cloud>& scan, std::size_t taken) {
        seen += scan.first;
        moving += scan.first - scan.second.size();
        tbb::parallel_invoke([&] { average.add(scan.second); }, [&] { sharpness.add(scan.second); });
        progress("points", shareOf(taken));
      });
  return {average.cloud(), sharpness.thickness(),
          seen > 0 ? static_cast<double>(moving) / static_cast<double>(seen) : 0};
}

MapContent contentOf(const Drives& drives, const Solved& solved, const TiledMap& tiles,
                     const MapperOptions& options, const std::string& tool_version) {
  const std::vector<Pose>& T_map_body = solved.joint.T_map_body;
  MapContent content;
  content.info = {drives.origin, options.map.tile_size_m, options.map.point_spacing_m,
                  tool_version,  options.resultText(),    {}};
  for (const Survey& s : drives.surveys) content.info.sessions.push_back(s.session);
  for (std::size_t key = 0; key < T_map_body.size(); ++key) {
    KeyPose& k = content.key_poses.emplace_back(
        KeyPose{drives.keyframes[key].stamp_s, T_map_body[key],
                content.info.sessions[static_cast<std::size_t>(drives.session_of[key])]});
    if (drives.origin) k.T_map_body_gps = solved.gps.T_map_body[key];
    k.T_map_body_lidar = solved.aligned.T_to_from * solved.lidar.T_map_body[key];
    if (solved.loop)
      if (const auto id = solved.loop->ids.idAt(T_map_body[key])) k.racetrack_id = *id;
  }
  describeGraphs(content, drives, solved.loops.edges, T_map_body, options.graph);
  if (const auto& loop = solved.loop) {
    const double spacing_m = loop->length_m / loop->ids.count();
    for (const WayPoint& w : loop->ids.wayPoints()) content.waypoints.push_back({w.p_map_m, w.heading_rad});
    content.info.waypoint_spacing_m = spacing_m;
    content.road = roadSurface(tiles, content.waypoints, spacing_m, content.key_poses);
    content.walls = wallLines(tiles, content.waypoints, spacing_m);
  }
  return content;
}

MapReport reportOf(const Drives& drives, Solved solved, const StaticScene& scene, const TiledMap& tiles) {
  const std::vector<Pose>& T_map_body = solved.joint.T_map_body;
  MapReport report{};
  report.key_poses = T_map_body.size();
  for (const Keyframe& k : drives.keyframes) {
    report.gps_fixes += k.gps.size();
    report.attitudes += k.attitudes.size();
  }
  report.first_s = drives.keyframes.front().stamp_s;
  report.aligned_rmse_m = solved.aligned.rmse_m;
  report.aligned_share = solved.aligned.inlier_share;
  if (drives.origin)
    report.refined_rmse_m = alignGraphs(positionsOf(T_map_body), positionsOf(solved.gps.T_map_body)).rmse_m;
  report.gps_rmse_m = gpsRmse(drives.keyframes, T_map_body);
  report.cost = solved.joint.cost;
  report.converged =
      solved.joint.converged && solved.lidar.converged && (solved.gps.converged || !drives.origin);
  if (solved.loop) {
    report.lap_m = solved.loop->length_m;
    std::set<std::pair<int, int>> laps;
    for (const RacetrackEntry& entry : solved.loop->dict.entries()) laps.insert({entry.session, entry.lap});
    report.laps = static_cast<int>(laps.size());
  }
  report.loop_residual_m = loopResidual(solved.loops.edges, T_map_body);
  report.loops = std::move(solved.loops.edges);
  report.refused_loops = std::move(solved.loops.refused);
  report.gps_spans = std::move(solved.spans);
  report.walls = scene.walls;
  report.moving_share = scene.moving_share;
  report.points = tiles.pointCount();
  report.tiles = tiles.tiles().size();
  std::vector<std::size_t> key_poses_of(drives.surveys.size(), 0);
  for (const int session : drives.session_of) ++key_poses_of[static_cast<std::size_t>(session)];
  for (std::size_t n = 0; n < drives.surveys.size(); ++n) {
    const Survey& s = drives.surveys[n];
    report.sessions.push_back({s.session, s.device_reason, s.recorded_s, s.tally, s.dropped_late,
                               key_poses_of[n], s.match_residual_m, s.match_inlier_share, s.kept});
  }
  return report;
}

}  // namespace

bool holdsSurveys(const StageStore& store) { return store.get(kReadLogs, "").has_value(); }

MapInput mapInput(const std::vector<std::string>& log_paths, const std::string& race_line_path,
                  const MapperOptions& options) {
  std::map<std::string, std::string> path_of;
  for (const std::string& path : log_paths)
    if (const auto [there, is_new] =
            path_of.try_emplace(std::filesystem::path(path).filename().string(), path);
        !is_new)
      throw InputError("rawlogs " + there->second + " and " + path +
                       ": have one name, by which drives are told apart; rename one of them");
  MapInput input;
  if (!race_line_path.empty()) input.race_line_m = readDrivenLine(race_line_path);
  for (const std::string& path : log_paths) input.logs.push_back(usableLog(path, options.matching.log));
  requireNearFixes(input.logs);
  return input;
}

BuiltMap buildMap(const MapInput& input, StageStore& store, const MapperOptions& options,
                  const std::string& tool_version, const StageProgress& progress) {
  ScanStore scans(store);
  Drives drives = survey(input.logs, store, scans, options, tool_version, progress);
  const DeviceOptions& device = options.matching.device;
  gpu::Context context(device.device, 0, device.threads);  // tests itself
  Solved solved = solve(context, drives, input, scans, options, progress);
  const StaticScene scene = staticScene(drives, scans, solved.joint.T_map_body, options, progress);

  progress("tiles", 0);
  if (context.backend() != gpu::Backend::cpu) (void)context.passesSelfTest();  // hours may have gone by
  CovarianceOptions covariance = options.matching.covariance;
  covariance.radius_m = options.map.covariance_radius_m;
  BuiltMap built{tilesOf(context, scene.points, covariance, options.map.tile_size_m), {}, {}, {}};
  built.content = contentOf(drives, solved, built.tiles, options, tool_version);
  built.report = reportOf(drives, std::move(solved), scene, built.tiles);
  for (Survey& s : drives.surveys) built.odometry.push_back(std::move(s.odometry));
  progress("tiles", 1);
  return built;
}

}  // namespace raceloc
