#include "pipeline/mapper.h"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <map>
#include <utility>

#include "cloud/voxel_grid.h"
#include "core/errors.h"
#include "core/statistics.h"
#include "pipeline/device_watch.h"

namespace raceloc {

void MapOptions::describe(OptionList& keys) {
  keys.add("point_spacing_m", point_spacing_m, above(0), "the map keeps one point a voxel of this edge [m]");
  keys.add(
      "covariance_radius_m", covariance_radius_m, above(0),
      "neighbours of a map point, in place of radius_m of [covariance]: the map is denser than a scan [m]");
  keys.add("tile_size_m", tile_size_m, above(0), "edge of a square tile [m]");
  keys.add("keyframe_distance_m", keyframe_distance_m, atLeast(0),
           "a new key pose after this distance [m] ...");
  keys.add("keyframe_angle_deg", keyframe_angle_deg, atLeast(0), "... or this turn [deg]");
  keys.add("gps_max_gap_s", gps_max_gap_s, above(0), "fixes farther apart are not interpolated between [s]");
  keys.add("write_simplemap", write_simplemap, "also write NAME.simplemap, for robot-map-gui");
  keys.add("write_scene", write_scene, "also write NAME.3Dscene, for SceneViewer3D");
}

MapperOptions MapperOptions::fromIni(const std::string& path) {
  MapperOptions options;
  IniFile ini(path);
  options.matching.load(ini);
  ini.load("graph", options.graph);
  ini.load("map", options.map);
  ini.rejectUnknownSections();
  return options;
}

std::string MapperOptions::iniText() const {
  return matching.iniText() + "\n" + raceloc::iniText("graph", graph) + "\n" + raceloc::iniText("map", map);
}

namespace {

/** Position and attitude of one receiver over the whole drive. */
struct ReceiverTrack {
  std::vector<GpsFix> fixes;
  std::vector<InsPose> poses;
};

/** The two samples around a stamp, and where it lies between them (0..1); none across a gap. */
template <class S>
struct Bracket {
  const S& before;
  const S& after;
  double share;
};
template <class S>
std::optional<Bracket<S>> bracket(const std::vector<S>& samples, double stamp_s, double max_gap_s) {
  const auto after = std::lower_bound(samples.begin(), samples.end(), stamp_s,
                                      [](const S& s, double t) { return s.stamp_s < t; });
  if (after == samples.begin() || after == samples.end()) return std::nullopt;
  const auto before = std::prev(after);
  const double gap_s = after->stamp_s - before->stamp_s;
  if (gap_s > max_gap_s) return std::nullopt;
  return Bracket<S>{*before, *after, (stamp_s - before->stamp_s) / gap_s};
}

/** Linear in between: over 0.1 s at 12 m/s a curve of 40 m radius bulges by 5 mm. */
std::optional<KeyGps> gpsAt(const ReceiverTrack& track, double stamp_s, double max_gap_s) {
  const auto b = bracket(track.fixes, stamp_s, max_gap_s);
  if (!b) return std::nullopt;
  const Eigen::Vector3d p =
      b->before.p_map_antenna_m + b->share * (b->after.p_map_antenna_m - b->before.p_map_antenna_m);
  const bool before_is_worse = b->before.cov_map_m2.trace() > b->after.cov_map_m2.trace();
  return KeyGps{p, before_is_worse ? b->before.cov_map_m2 : b->after.cov_map_m2, b->before.p_body_antenna_m};
}

std::optional<KeyAttitude> attitudeAt(const ReceiverTrack& track, double stamp_s, double max_gap_s) {
  const auto b = bracket(track.poses, stamp_s, max_gap_s);
  if (!b) return std::nullopt;
  const Eigen::Quaterniond q_before(b->before.T_map_body.linear()), q_after(b->after.T_map_body.linear());
  return KeyAttitude{q_before.slerp(b->share, q_after).toRotationMatrix(),
                     b->before.covariance.topLeftCorner<3, 3>()};
}

/** One pass over the log: odometry, key poses and their scans, and what the receivers said. */
class Survey {
 public:
  Survey(gpu::Context& context, const MapperOptions& options)
      : x_context(context), x_options(options), x_stream(odometryStream(context, options.matching)) {}

  void add(Sample sample) {
    if (const auto* fix = std::get_if<GpsFix>(&sample)) receivers[fix->label].fixes.push_back(*fix);
    if (const auto* pose = std::get_if<InsPose>(&sample)) receivers[pose->label].poses.push_back(*pose);
    for (const OdometryStep& step : x_stream.add(std::move(sample))) take(step);
  }
  void finish() {
    for (const OdometryStep& step : x_stream.finish()) take(step);
  }
  [[nodiscard]] const OdometryTally& tally() const { return x_stream.tally(); }

  std::vector<Keyframe> keyframes;
  std::vector<Cloud> key_clouds;  ///< body frame, thinned to the map's spacing
  std::map<std::string, ReceiverTrack> receivers;
  Trajectory odometry;
  std::vector<double> residuals_m, inlier_shares;

 private:
  void take(const OdometryStep& step) {
    if (step.trusted && !odometry.poses.empty()) {  // the first one has nothing to match

      residuals_m.push_back(step.match.residual_m);
      inlier_shares.push_back(step.match.inlier_share);
    }
    odometry.poses.push_back({step.stamp_s, step.T_odom_body});

    x_since_key = then(x_since_key, step.since_last);
    const double moved_m = x_since_key.T_start_end.translation().norm();
    const double turned_deg = Eigen::AngleAxisd(x_since_key.T_start_end.linear()).angle() * 180 / M_PI;
    const bool is_key = keyframes.empty() || moved_m >= x_options.map.keyframe_distance_m ||
                        turned_deg >= x_options.map.keyframe_angle_deg;
    if (!is_key || !step.trusted) return;
    keyframes.push_back({step.stamp_s, step.T_odom_body, x_since_key, std::nullopt, std::nullopt});
    key_clouds.push_back(voxelGrid(x_context, step.full_scan, 0.5 * x_options.map.point_spacing_m));
    x_since_key = {};
  }

  gpu::Context& x_context;
  const MapperOptions& x_options;
  OdometryStream x_stream;
  BodyMotion x_since_key;
};

/** The receiver with the most fixes: one graph takes one receiver. */
const ReceiverTrack* mainReceiver(const std::map<std::string, ReceiverTrack>& receivers) {
  const ReceiverTrack* best = nullptr;
  for (const auto& entry : receivers)
    if (!entry.second.fixes.empty() && (!best || entry.second.fixes.size() > best->fixes.size()))
      best = &entry.second;
  return best;
}

/** All key scans in the map frame, not thinned together. */
Cloud inMap(const std::vector<Cloud>& clouds, const std::vector<Pose>& poses) {
  Cloud all;
  for (std::size_t i = 0; i < clouds.size(); ++i) {
    const Cloud moved = transformed(clouds[i], poses[i]);
    all.x.insert(all.x.end(), moved.x.begin(), moved.x.end());
    all.y.insert(all.y.end(), moved.y.begin(), moved.y.end());
    all.z.insert(all.z.end(), moved.z.begin(), moved.z.end());
  }
  return all;
}

/** "; LiDAR lidar_top: empty scan (72 times)". */
std::string listed(const FaultCounts& faults) {
  std::string text;
  for (const auto& [fault, times] : faults) text += "; " + fault + " (" + std::to_string(times) + " times)";
  return text;
}

}  // namespace

BuiltMap buildMap(const std::string& log_path, const MapperOptions& options, const std::string& tool_version,
                  const std::function<void(double)>& progress) {
  const LogOptions& log = options.matching.log;
  const LogSummary summary = summarizeRawlog(log_path);
  requireDevice(summary, "lidar", log.lidar_labels);
  if (log.gps_labels != "*") requireDevice(summary, "gps", log.gps_labels);
  if (log.vehicle_labels != "*") requireDevice(summary, "vehicle", log.vehicle_labels);
  requireOneClock(summary, log);

  const DeviceOptions& device = options.matching.device;
  gpu::Context context(device.device, 0, device.threads);
  DeviceWatch watch(context, device.self_test_every_s);
  Survey survey(context, options);
  LogReader reader(log_path, log);
  while (auto sample = reader.next()) {
    watch.at(stampOf(*sample));
    survey.add(std::move(*sample));
    progress(0.8 * reader.progress());
  }
  survey.finish();
  if (survey.keyframes.size() < 2)
    throw InputError(
        "rawlog " + log_path + ": the car passes only " + std::to_string(survey.keyframes.size()) +
        " key pose(s), with " + std::to_string(survey.tally().trusted) + " of " +
        std::to_string(survey.tally().scans) + " scans trusted; a map needs two or more " +
        std::to_string(options.map.keyframe_distance_m) + " m apart" + listed(survey.tally().faults));

  std::size_t attitude_factors = 0;
  if (const ReceiverTrack* receiver = mainReceiver(survey.receivers))
    for (auto& k : survey.keyframes) {
      k.gps = gpsAt(*receiver, k.stamp_s, options.map.gps_max_gap_s);
      k.attitude = attitudeAt(*receiver, k.stamp_s, options.map.gps_max_gap_s);
      if (k.attitude) ++attitude_factors;
    }
  const GraphSolution graph = solveLidarGraph(survey.keyframes, options.graph);
  if (graph.gps_factors == 0 && mainReceiver(survey.receivers))
    throw InputError("rawlog " + log_path + ": GPS fixes of label '" + log.gps_labels +
                     "' are there, but none can be interpolated at a key pose; raise gps_max_gap_s (" +
                     std::to_string(options.map.gps_max_gap_s) + ") in section [map]");
  progress(0.9);

  const Cloud all = inMap(survey.key_clouds, graph.T_map_body);
  BuiltMap built{TiledMap(options.map.tile_size_m), {}, {}, {}, std::move(survey.odometry), {}};
  CovarianceOptions covariance = options.matching.covariance;
  covariance.radius_m = options.map.covariance_radius_m;
  const CovarianceCloud thinned =
      withCovariances(context, voxelGrid(context, all, options.map.point_spacing_m), covariance);
  built.tiles.insert(thinned.cloud, thinned.covariances.view());

  const std::string session = std::filesystem::path(log_path).filename().string();
  built.info = {graph.gps_factors > 0 ? reader.origin() : std::nullopt,
                options.map.tile_size_m,
                options.map.point_spacing_m,
                tool_version,
                options.iniText(),
                {session}};
  for (std::size_t i = 0; i < survey.keyframes.size(); ++i) {
    built.key_poses.push_back({survey.keyframes[i].stamp_s, graph.T_map_body[i], session});
    built.scans.push_back(
        {survey.keyframes[i].stamp_s, graph.T_map_body[i], std::move(survey.key_clouds[i])});
  }
  built.report = {context.reason(),
                  survey.tally(),
                  survey.keyframes.size(),
                  graph.gps_factors,
                  attitude_factors,
                  summary.last_s - summary.first_s,
                  quantile(survey.residuals_m, 0.5),
                  quantile(survey.inlier_shares, 0.5),
                  graph.gps_rmse_m,
                  graph.initial_cost,
                  graph.final_cost,
                  graph.converged,
                  wallThickness(all),
                  thinned.cloud.size(),
                  built.tiles.tiles().size(),
                  reader.droppedLate()};
  progress(1.0);
  return built;
}

}  // namespace raceloc
