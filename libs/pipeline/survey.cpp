#include "pipeline/survey.h"

#include <algorithm>
#include <cmath>
#include <exception>
#include <filesystem>
#include <map>
#include <thread>
#include <utility>

#include "cloud/voxel_grid.h"
#include "core/bounded_queue.h"
#include "core/errors.h"
#include "core/statistics.h"
#include "pipeline/device_watch.h"
#include "pipeline/log_faults.h"

namespace raceloc {

void MapOptions::describe(OptionList& keys) {
  keys.add("point_spacing_m", point_spacing_m, between(0.02, 5),
           "the map keeps one point a voxel of this edge [m]");
  keys.add(
      "covariance_radius_m", covariance_radius_m, between(0.05, 20),
      "neighbours of a map point, in place of radius_m of [covariance]: the map is denser than a scan [m]");
  keys.add("tile_size_m", tile_size_m, between(4, 1000), "edge of a square tile [m]");
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
  ini.load("track_id", options.track_id);
  ini.load("first_lap", options.first_lap);
  ini.load("loops", options.loops);
  ini.load("static", options.static_points);
  ini.load("map", options.map);
  ini.load("qa", options.qa);
  ini.rejectUnknownSections();
  return options;
}

std::string MapperOptions::iniText() const {
  return matching.iniText() + "\n" + raceloc::iniText("graph", graph) + "\n" +
         raceloc::iniText("track_id", track_id) + "\n" + raceloc::iniText("first_lap", first_lap) + "\n" +
         raceloc::iniText("loops", loops) + "\n" + raceloc::iniText("static", static_points) + "\n" +
         raceloc::iniText("map", map) + "\n" + raceloc::iniText("qa", qa);
}

std::string MapperOptions::resultText() const {
  MapperOptions options = *this;
  options.matching.device.threads = DeviceOptions{}.threads;
  return options.iniText();
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

/** Linear in between: over 0.05 s at 70 m/s a curve of 150 m radius bulges by 10 mm. */
std::optional<KeyGps> gpsAt(const std::string& receiver, const ReceiverTrack& track, double stamp_s,
                            double max_gap_s) {
  const auto b = bracket(track.fixes, stamp_s, max_gap_s);
  if (!b) return std::nullopt;
  const Eigen::Vector3d p =
      b->before.p_map_antenna_m + b->share * (b->after.p_map_antenna_m - b->before.p_map_antenna_m);
  const bool before_is_worse = b->before.cov_map_m2.trace() > b->after.cov_map_m2.trace();
  return KeyGps{receiver, p, before_is_worse ? b->before.cov_map_m2 : b->after.cov_map_m2,
                b->before.p_body_antenna_m};
}

std::optional<KeyAttitude> attitudeAt(const ReceiverTrack& track, double stamp_s, double max_gap_s) {
  const auto b = bracket(track.poses, stamp_s, max_gap_s);
  if (!b) return std::nullopt;
  const Eigen::Quaterniond q_before(b->before.T_map_body.linear()), q_after(b->after.T_map_body.linear());
  return KeyAttitude{q_before.slerp(b->share, q_after).toRotationMatrix(),
                     b->before.covariance.topLeftCorner<3, 3>()};
}

/** Thins and keeps the scans of the key poses, on a thread of its own: that takes about as long as the odometry. */
class ScanKeeper {
 public:
  ScanKeeper(const MapperOptions& options, const std::function<void(std::size_t, const Cloud&)>& keep)
      : x_thread([this, &options, &keep] {
          try {
            gpu::Context context(gpu::Backend::cpu);
            while (const auto scan = x_queue.pop())
              keep(scan->first, voxelGrid(context, scan->second, 0.5 * options.map.point_spacing_m));
          } catch (...) {
            x_error = std::current_exception();
          }
          x_queue.close();
        }) {}
  ~ScanKeeper() { stop(); }
  ScanKeeper(const ScanKeeper&) = delete;
  ScanKeeper& operator=(const ScanKeeper&) = delete;

  void add(std::size_t key, Cloud scan) {
    if (!x_queue.push({key, std::move(scan)})) finish();
  }
  /** Waits for the last. \throws what keeping one threw. */
  void finish() {
    stop();
    if (x_error) std::rethrow_exception(x_error);
  }

 private:
  void stop() {
    x_queue.close();
    if (x_thread.joinable()) x_thread.join();
  }
  BoundedQueue<std::pair<std::size_t, Cloud>> x_queue{4};
  std::exception_ptr x_error;  ///< written before the queue is closed, read after it
  std::thread x_thread;        ///< the last member: it uses the others
};

/** Samples in, key poses out. */
class Surveyor {
 public:
  Surveyor(gpu::Context& context, const MapperOptions& options,
           const std::function<void(std::size_t, const Cloud&)>& keep)
      : x_options(options), x_keeper(options, keep), x_stream(odometryStream(context, options.matching)) {}

  void add(Sample sample) {
    if (const auto* fix = std::get_if<GpsFix>(&sample)) x_receivers[fix->label].fixes.push_back(*fix);
    if (const auto* pose = std::get_if<InsPose>(&sample)) x_receivers[pose->label].poses.push_back(*pose);
    if (const auto* scan = std::get_if<Scan>(&sample))
      x_places_m[scan->label] = scan->T_body_lidar.translation();
    x_stream.add(std::move(sample), [this](OdometryStep& step) { take(step); });
  }
  void finish() {
    x_stream.finish([this](OdometryStep& step) { take(step); });
    x_keeper.finish();
    const double max_gap_s = x_options.map.gps_max_gap_s;
    for (auto& k : keyframes)
      for (const auto& [receiver, track] : x_receivers) {
        if (auto gps = gpsAt(receiver, track, k.stamp_s, max_gap_s)) k.gps.push_back(std::move(*gps));
        if (const auto attitude = attitudeAt(track, k.stamp_s, max_gap_s)) k.attitudes.push_back(*attitude);
      }
  }
  [[nodiscard]] const OdometryTally& tally() const { return x_stream.tally(); }
  [[nodiscard]] Eigen::Vector3d eyes_m() const {
    Eigen::Vector3d sum = Eigen::Vector3d::Zero();
    for (const auto& place : x_places_m) sum += place.second;
    return sum / static_cast<double>(x_places_m.size());
  }
  [[nodiscard]] bool heardGps() const {
    return std::any_of(x_receivers.begin(), x_receivers.end(),
                       [](const auto& receiver) { return !receiver.second.fixes.empty(); });
  }

  std::vector<Keyframe> keyframes;
  Trajectory odometry;
  std::vector<double> residuals_m, inlier_shares;

 private:
  void take(OdometryStep& step) {
    if (step.trusted && !odometry.poses.empty()) {  // the first one has nothing to match
      residuals_m.push_back(step.match.residual_m);
      inlier_shares.push_back(step.match.inlier_share);
    }
    odometry.poses.push_back({step.stamp_s, step.T_odom_body});

    x_since_key = then(x_since_key, step.since_last);
    if (x_reckoned && step.predicted)
      x_reckoned = then(*x_reckoned, *step.predicted);
    else if (step.since_last.duration_s > 0)
      x_reckoned.reset();
    const double moved_m = x_since_key.T_start_end.translation().norm();
    const double turned_deg = Eigen::AngleAxisd(x_since_key.T_start_end.linear()).angle() / kDegree;
    const bool is_key = keyframes.empty() || moved_m >= x_options.map.keyframe_distance_m ||
                        turned_deg >= x_options.map.keyframe_angle_deg;
    if (!is_key || !step.trusted) return;
    Keyframe k{step.stamp_s, step.T_odom_body, {}};
    if (!keyframes.empty()) {
      k.since_last = x_since_key;
      k.reckoned = x_reckoned;
    }
    if (step.level) k.level = {step.level->up_body, step.level->sigma_rad};
    x_keeper.add(keyframes.size(), std::move(step.full_scan));
    keyframes.push_back(std::move(k));
    x_since_key = {};
    x_reckoned = BodyMotion{};
  }

  const MapperOptions& x_options;
  ScanKeeper x_keeper;
  OdometryStream x_stream;
  std::map<std::string, ReceiverTrack> x_receivers;
  std::map<std::string, Eigen::Vector3d> x_places_m;  ///< of the LiDARs
  BodyMotion x_since_key;
  std::optional<BodyMotion> x_reckoned = BodyMotion{};
};

/** "; LiDAR lidar_top: empty scan (72 times)". */
std::string listed(const FaultCounts& faults) {
  std::string text;
  for (const auto& [fault, times] : faults) text += "; " + fault + " (" + std::to_string(times) + " times)";
  return text;
}

}  // namespace

SurveyLog usableLog(const std::string& path, const LogOptions& options,
                    const std::function<void(double)>& progress) {
  SurveyLog log{path, summarizeRawlog(path, progress)};
  requireDevices(log.summary, options);
  requireOneClock(log.summary, options);
  return log;
}

Survey surveyOf(const SurveyLog& log, const std::optional<GeodeticPoint>& origin,
                const MapperOptions& options, const std::function<void(std::size_t, const Cloud&)>& keep,
                const std::function<void(double)>& progress) {
  const DeviceOptions& device = options.matching.device;
  gpu::Context context(device.device, 0, device.threads);
  DeviceWatch watch(context, device.self_test_every_s);
  Surveyor surveyor(context, options, keep);
  LogReader reader(log.path, options.matching.log, origin);
  while (auto sample = reader.next()) {
    watch.at(stampOf(*sample));
    surveyor.add(std::move(*sample));
    progress(reader.progress());
  }
  surveyor.finish();
  OdometryTally tally = surveyor.tally();
  tally.faults.merge(logFaults(log.summary, options.matching.log, reader));
  if (surveyor.keyframes.size() < 2)
    throw InputError("rawlog " + log.path + ": the car passes only " +
                     std::to_string(surveyor.keyframes.size()) + " key pose(s), with " +
                     std::to_string(tally.trusted) + " of " + std::to_string(tally.scans) +
                     " scans trusted; a map needs two or more " +
                     std::to_string(options.map.keyframe_distance_m) + " m apart" + listed(tally.faults));
  const bool has_gps = std::any_of(surveyor.keyframes.begin(), surveyor.keyframes.end(),
                                   [](const Keyframe& k) { return !k.gps.empty(); });
  if (!has_gps && surveyor.heardGps())
    throw InputError("rawlog " + log.path + ": GPS fixes of label '" + options.matching.log.gps_labels +
                     "' are there, but none can be interpolated at a key pose; raise gps_max_gap_s (" +
                     std::to_string(options.map.gps_max_gap_s) + ") in section [map]");
  return {std::filesystem::path(log.path).filename().string(),
          has_gps ? reader.origin() : std::nullopt,
          log.summary.last_s - log.summary.first_s,
          surveyor.eyes_m(),
          std::move(surveyor.keyframes),
          std::move(surveyor.odometry),
          std::move(tally),
          quantile(surveyor.residuals_m, 0.5),
          quantile(surveyor.inlier_shares, 0.5),
          reader.droppedLate(),
          context.reason()};
}

// ---- Bytes

namespace {

using U64 = std::uint64_t;

void appendMotion(Bytes& bytes, const BodyMotion& motion) {
  append(bytes, motion.duration_s);
  append(bytes, motion.T_start_end.matrix());
  append(bytes, motion.covariance);
}
BodyMotion motionIn(ByteReader& in) {
  BodyMotion motion;
  motion.duration_s = in.number<double>();
  motion.T_start_end.matrix() = in.matrix<Eigen::Matrix4d>();
  motion.covariance = in.matrix<Matrix6d>();
  return motion;
}
bool flagIn(ByteReader& in) { return in.number<std::uint32_t>() != 0; }
void appendFlag(Bytes& bytes, bool flag) { append(bytes, std::uint32_t{flag}); }

}  // namespace

Bytes toBytes(const Survey& survey) {
  Bytes bytes;
  append(bytes, survey.session);
  appendFlag(bytes, survey.origin.has_value());
  if (survey.origin)
    for (const double number :
         {survey.origin->latitude_deg, survey.origin->longitude_deg, survey.origin->height_m})
      append(bytes, number);
  append(bytes, survey.recorded_s);
  append(bytes, survey.p_body_eyes_m);
  append(bytes, U64{survey.keyframes.size()});
  for (const Keyframe& k : survey.keyframes) {
    append(bytes, k.stamp_s);
    append(bytes, k.T_odom_body.matrix());
    appendMotion(bytes, k.since_last);
    appendFlag(bytes, k.reckoned.has_value());
    if (k.reckoned) appendMotion(bytes, *k.reckoned);
    append(bytes, U64{k.gps.size()});
    for (const KeyGps& gps : k.gps) {
      append(bytes, gps.receiver);
      append(bytes, gps.p_map_antenna_m);
      append(bytes, gps.cov_map_m2);
      append(bytes, gps.p_body_antenna_m);
    }
    append(bytes, U64{k.attitudes.size()});
    for (const KeyAttitude& attitude : k.attitudes) {
      append(bytes, attitude.R_map_body);
      append(bytes, attitude.covariance_rad2);
    }
    appendFlag(bytes, k.level.has_value());
    if (k.level) {
      append(bytes, k.level->up_body);
      append(bytes, k.level->sigma_rad);
    }
  }
  append(bytes, U64{survey.odometry.poses.size()});
  for (const StampedPose& pose : survey.odometry.poses) {
    append(bytes, pose.stamp_s);
    append(bytes, pose.T_map_body.matrix());
  }
  const OdometryTally& tally = survey.tally;
  for (const std::size_t count : {tally.scans, tally.trusted, tally.restarts, tally.by_wheels,
                                  survey.dropped_late, tally.faults.size()})
    append(bytes, U64{count});
  for (const auto& [fault, times] : tally.faults) {
    append(bytes, fault);
    append(bytes, U64{times});
  }
  for (const double number : {tally.length_m, survey.match_residual_m, survey.match_inlier_share})
    append(bytes, number);
  append(bytes, survey.device_reason);
  return bytes;
}

Survey surveyFrom(const Bytes& bytes) {
  ByteReader in(bytes);
  Survey survey{};
  survey.session = in.text();
  if (flagIn(in)) {
    survey.origin.emplace();
    survey.origin->latitude_deg = in.number<double>();
    survey.origin->longitude_deg = in.number<double>();
    survey.origin->height_m = in.number<double>();
  }
  survey.recorded_s = in.number<double>();
  survey.p_body_eyes_m = in.matrix<Eigen::Vector3d>();
  for (auto left = in.number<U64>(); left > 0; --left) {
    Keyframe& k = survey.keyframes.emplace_back();
    k.stamp_s = in.number<double>();
    k.T_odom_body.matrix() = in.matrix<Eigen::Matrix4d>();
    k.since_last = motionIn(in);
    if (flagIn(in)) k.reckoned = motionIn(in);
    for (auto fixes = in.number<U64>(); fixes > 0; --fixes) {
      KeyGps& gps = k.gps.emplace_back();
      gps.receiver = in.text();
      gps.p_map_antenna_m = in.matrix<Eigen::Vector3d>();
      gps.cov_map_m2 = in.matrix<Eigen::Matrix3d>();
      gps.p_body_antenna_m = in.matrix<Eigen::Vector3d>();
    }
    for (auto attitudes = in.number<U64>(); attitudes > 0; --attitudes) {
      KeyAttitude& attitude = k.attitudes.emplace_back();
      attitude.R_map_body = in.matrix<Eigen::Matrix3d>();
      attitude.covariance_rad2 = in.matrix<Eigen::Matrix3d>();
    }
    if (flagIn(in)) {
      k.level.emplace();
      k.level->up_body = in.matrix<Eigen::Vector3d>();
      k.level->sigma_rad = in.number<double>();
    }
  }
  for (auto left = in.number<U64>(); left > 0; --left) {
    StampedPose& pose = survey.odometry.poses.emplace_back();
    pose.stamp_s = in.number<double>();
    pose.T_map_body.matrix() = in.matrix<Eigen::Matrix4d>();
  }
  OdometryTally& tally = survey.tally;
  for (std::size_t* count :
       {&tally.scans, &tally.trusted, &tally.restarts, &tally.by_wheels, &survey.dropped_late})
    *count = in.number<U64>();
  for (auto faults = in.number<U64>(); faults > 0; --faults) {
    const std::string fault = in.text();
    tally.faults[fault] = in.number<U64>();
  }
  tally.length_m = in.number<double>();
  survey.match_residual_m = in.number<double>();
  survey.match_inlier_share = in.number<double>();
  survey.device_reason = in.text();
  return survey;
}

Bytes toBytes(const Cloud& cloud) {
  Bytes bytes;
  append(bytes, U64{cloud.size()});
  append(bytes, U64{cloud.intensity.size()});
  for (const auto* values : {&cloud.x, &cloud.y, &cloud.z, &cloud.intensity}) append(bytes, *values);
  return bytes;
}

Cloud cloudFrom(const Bytes& bytes) {
  ByteReader in(bytes);
  const auto points = in.number<U64>(), intensities = in.number<U64>();
  Cloud cloud;
  cloud.x = in.numbers<float>(points);
  cloud.y = in.numbers<float>(points);
  cloud.z = in.numbers<float>(points);
  cloud.intensity = in.numbers<float>(intensities);
  return cloud;
}

}  // namespace raceloc
