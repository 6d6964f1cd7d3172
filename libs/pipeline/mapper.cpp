#include "pipeline/mapper.h"

#include <filesystem>
#include <map>
#include <set>
#include <utility>

#include "core/errors.h"
#include "core/statistics.h"
#include "map/road_surface.h"
#include "map/wall_lines.h"
#include "pipeline/map_solution.h"
#include "pipeline/static_scene.h"
#include "track/driven_line.h"

namespace raceloc {

namespace {

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
void describeGraphs(MapContent& content, const SurveyedDrives& drives, const std::vector<LoopEdge>& loops,
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

MapContent contentOf(const SurveyedDrives& drives, const MapSolution& solved, const TiledMap& tiles,
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

MapReport reportOf(const SurveyedDrives& drives, MapSolution solved, const StaticScene& scene,
                   const TiledMap& tiles) {
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

MapInput mapInput(const std::vector<std::string>& log_paths, const std::string& race_line_path,
                  const MapperOptions& options, const StageProgress& progress) {
  std::map<std::string, std::string> path_of;
  for (const std::string& path : log_paths)
    if (const auto [there, is_new] =
            path_of.try_emplace(std::filesystem::path(path).filename().string(), path);
        !is_new)
      throw InputError("rawlogs " + there->second + " and " + path +
                       ": have one name, by which drives are told apart; rename one of them");
  MapInput input;
  if (!race_line_path.empty()) input.race_line_m = readDrivenLine(race_line_path);
  for (const std::string& path : log_paths)
    input.logs.push_back(
        usableLog(path, options.matching.log, [&](double share) { progress("looking through", share); }));
  requireNearFixes(input.logs);
  return input;
}

BuiltMap buildMap(const MapInput& input, StageStore& store, const MapperOptions& options,
                  const std::string& tool_version, const StageProgress& progress) {
  ScanStore scans(store);
  SurveyedDrives drives = surveyLogs(input.logs, store, scans, options, tool_version, progress);
  const DeviceOptions& device = options.matching.device;
  gpu::Context context(device.device, 0, device.threads);  // tests itself
  MapSolution solved = solveGraphs(context, drives, input.logs, input.race_line_m, scans, options, progress);
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
