#include "pipeline/map_qa.h"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <map>
#include <utility>

#include "core/statistics.h"

namespace raceloc {

namespace {

constexpr double kDriven_m = 5;  // between stations where there is no racing line

/** Where the key poses are along the racing line, or else along the drive. */
struct Stations {
  bool closed;
  double spacing_m;
  int count;
  std::vector<std::optional<int>> number;   ///< by key pose
  std::vector<std::optional<double>> at_m;  ///< by key pose

  /** From one key pose to the next, in stations; none if either is off the line. */
  [[nodiscard]] std::optional<int> step(std::size_t from, std::size_t to) const {
    if (!number[from] || !number[to]) return std::nullopt;
    const int ahead = *number[to] - *number[from];
    if (!closed) return ahead;
    return ahead - count * static_cast<int>(std::lround(static_cast<double>(ahead) / count));
  }
  [[nodiscard]] std::size_t wrapped(int station) const {
    return static_cast<std::size_t>((station % count + count) % count);
  }
};

Stations stationsOf(const MapContent& content) {
  const auto& keys = content.key_poses;
  const bool closed = !content.waypoints.empty();
  Stations s{closed, closed ? content.info.waypoint_spacing_m : kDriven_m, 0, {}, {}};
  if (closed) {
    s.count = static_cast<int>(content.waypoints.size());
    const double lap_m = s.count * s.spacing_m;
    for (const KeyPose& k : keys) {
      s.number.emplace_back(k.racetrack_id);
      if (!k.racetrack_id) {
        s.at_m.emplace_back();
        continue;
      }
      const MapWaypoint& w = content.waypoints[static_cast<std::size_t>(*k.racetrack_id)];
      const Eigen::Vector2d ahead(std::cos(w.heading_rad), std::sin(w.heading_rad));
      const double at_m =
          *k.racetrack_id * s.spacing_m + ahead.dot((k.T_map_body.translation() - w.p_map_m).head<2>());
      s.at_m.emplace_back(at_m - lap_m * std::floor(at_m / lap_m));
    }
    return s;
  }
  double driven_m = 0;
  for (std::size_t key = 0; key < keys.size(); ++key) {
    if (key > 0 && keys[key].session == keys[key - 1].session)
      driven_m += (keys[key].T_map_body.translation() - keys[key - 1].T_map_body.translation()).norm();
    s.number.emplace_back(static_cast<int>(driven_m / s.spacing_m));
    s.at_m.emplace_back(driven_m);
  }
  s.count = static_cast<int>(driven_m / s.spacing_m) + 1;
  return s;
}

/** Counts each station once a pass: what lies between key poses that follow each other within max_gap_m belongs to the
 * pass, and a car that backs up or jitters begins none. */
void countPasses(const MapContent& content, const Stations& s, double max_gap_m,
                 std::vector<StationQa>& stations) {
  const auto& keys = content.key_poses;
  int now = 0, farthest = 0;  // not wrapped
  for (std::size_t key = 0; key < keys.size(); ++key) {
    if (!s.number[key]) continue;
    const auto step =
        key > 0 && keys[key].session == keys[key - 1].session ? s.step(key - 1, key) : std::nullopt;
    const bool goes_on =
        step &&
        (keys[key].T_map_body.translation() - keys[key - 1].T_map_body.translation()).norm() <= max_gap_m;
    now = goes_on ? now + *step : *s.number[key];
    if (!goes_on) farthest = now - 1;
    for (; farthest < now; ++farthest) ++stations[s.wrapped(farthest + 1)].passes;
  }
}

Weakest weakestOf(const Matrix6d& covariance) {
  const Eigen::Matrix3d C = covariance.bottomRightCorner<3, 3>();
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> eigen(C);
  Eigen::Index axis = 0;
  eigen.eigenvectors().col(2).cwiseAbs().maxCoeff(&axis);
  return {std::sqrt(eigen.eigenvalues()(2)), std::sqrt(C(0, 0)), "xyz"[axis]};
}

/** The weakest odometry at each station that it leads over. */
void weakenStations(const MapContent& content, const Stations& s, std::vector<StationQa>& stations) {
  for (const MapEdge& edge : content.edges) {
    if (edge.kind != EdgeKind::odometry) continue;
    const auto i = static_cast<std::size_t>(edge.i), j = static_cast<std::size_t>(edge.j);
    const auto step = s.step(i, j);
    if (!step) continue;
    const Weakest weakest = weakestOf(edge.information.inverse());
    for (int n = std::min(0, *step); n <= std::max(0, *step); ++n) {
      auto& odometry = stations[s.wrapped(*s.number[i] + n)].odometry;
      if (!odometry || odometry->sigma_m < weakest.sigma_m) odometry = weakest;
    }
  }
}

/** Stretches of the stations for which `lacks` holds. */
template <class Lacks>
std::vector<Stretch> stretches(const std::vector<StationQa>& stations, double spacing_m, const Lacks& lacks) {
  std::vector<Stretch> found;
  bool before = false;
  for (const StationQa& station : stations) {
    const bool now = lacks(station);
    if (now && !before) found.push_back({station.station_m, 0});
    if (now) found.back().end_m = station.station_m + spacing_m;
    before = now;
  }
  return found;
}

/** The longest one without a fix; on a closed line the last may go on as the first. */
double longestWithoutFix(const std::vector<Stretch>& stretches, const std::vector<StationQa>& stations,
                         const Stations& s) {
  double longest_m = 0;
  for (const Stretch& stretch : stretches) longest_m = std::max(longest_m, stretch.end_m - stretch.begin_m);
  if (!s.closed || stretches.size() < 2 || stations.front().fix || stations.back().fix) return longest_m;
  return std::max(longest_m, stretches.front().end_m + s.count * s.spacing_m - stretches.back().begin_m);
}

/** Loops in a row along the line that are weak in a direction. */
std::vector<Stretch> degenerateLoops(const std::vector<LoopResidual>& loops, double degenerate_sigma_m) {
  std::vector<std::pair<double, bool>> by_station;
  for (const LoopResidual& loop : loops)
    if (loop.station_m) by_station.emplace_back(*loop.station_m, loop.weakest.sigma_m > degenerate_sigma_m);
  std::sort(by_station.begin(), by_station.end());
  std::vector<Stretch> found;
  bool before = false;
  for (const auto& [station_m, now] : by_station) {
    if (now && !before) found.push_back({station_m, 0});
    if (now) found.back().end_m = station_m;
    before = now;
  }
  return found;
}

template <class Holds>
double share(const std::vector<StationQa>& stations, const Holds& holds) {
  return static_cast<double>(std::count_if(stations.begin(), stations.end(), holds)) /
         static_cast<double>(stations.size());
}

/** Velocity of a receiver's antenna at a key pose, by the key poses around it; none at the ends of a session. */
std::optional<Eigen::Vector3d> antennaVelocity(const std::vector<KeyPose>& keys, const MapFix& fix) {
  const auto key = static_cast<std::size_t>(fix.key);
  if (key == 0 || key + 1 >= keys.size()) return std::nullopt;
  const KeyPose& before = keys[key - 1];
  const KeyPose& after = keys[key + 1];
  const double duration_s = after.stamp_s - before.stamp_s;
  if (before.session != after.session || !(duration_s > 0)) return std::nullopt;
  const Eigen::Vector3d& l = fix.p_body_antenna_m;
  return (after.T_map_body * l - before.T_map_body * l) / duration_s;
}

bool refused(const MapFix& fix) { return fix.weight == 0; }

Eigen::Vector3d residual(const std::vector<KeyPose>& keys, const MapFix& fix) {
  return fix.p_map_antenna_m - keys[static_cast<std::size_t>(fix.key)].T_map_body * fix.p_body_antenna_m;
}

/** Unknowns: dl, dt, s. \see qaOf() */
void calibrate(const std::vector<KeyPose>& keys, const std::vector<const MapFix*>& fixes, const QaOptions& o,
               ReceiverQa& receiver) {
  using Vector7d = Eigen::Matrix<double, 7, 1>;
  using Matrix7d = Eigen::Matrix<double, 7, 7>;
  constexpr double kShift_m = 10, kOffset_s = 1;
  const Vector7d prior =
      (Vector7d() << kShift_m, kShift_m, kShift_m, kOffset_s, kShift_m, kShift_m, kShift_m).finished();
  Matrix7d H = prior.array().square().inverse().matrix().asDiagonal();
  Vector7d b = Vector7d::Zero();
  double squared = 0;
  int rows = 0;
  for (const MapFix* fix : fixes) {
    const auto velocity = refused(*fix) ? std::nullopt : antennaVelocity(keys, *fix);
    if (!velocity) continue;
    Eigen::Matrix<double, 3, 7> J;
    J << keys[static_cast<std::size_t>(fix->key)].T_map_body.linear(), *velocity, Eigen::Matrix3d::Identity();
    const Eigen::Matrix3d W = fix->weight * fix->cov_map_m2.inverse();
    const Eigen::Vector3d r = residual(keys, *fix);
    H += J.transpose() * W * J;
    b += J.transpose() * W * r;
    squared += r.dot(W * r);
    rows += 3;
  }
  const Matrix7d C = H.inverse();
  const Vector7d x = C * b;
  const double left = squared - b.dot(x);  // what the unknowns do not explain
  const double scale = std::sqrt(std::max(1.0, left / std::max(1, rows - 7)));
  const auto estimate = [&](Eigen::Index i, double max_sigma) {
    const double sigma = scale * std::sqrt(C(i, i));
    return Estimate{x(i), sigma, sigma <= max_sigma};
  };
  for (std::size_t i = 0; i < 3; ++i)
    receiver.lever_m[i] = estimate(static_cast<Eigen::Index>(i), o.max_lever_sigma_m);
  receiver.time_offset_s = estimate(3, o.max_time_sigma_s);
}

void judgeFixes(const MapContent& content, const Stations& s, const QaOptions& options, QaResult& qa) {
  std::map<std::string, std::vector<const MapFix*>> by_receiver;
  for (const MapFix& fix : content.fixes) by_receiver[fix.receiver].push_back(&fix);
  for (const auto& [name, fixes] : by_receiver) {
    ReceiverQa receiver{name, fixes.size(), 0, 0, {}, {}};
    double squared_m2 = 0;
    for (const MapFix* fix : fixes) {
      const double off_m = residual(content.key_poses, *fix).norm();
      qa.fixes.push_back(
          {fix->key, qa.receivers.size(), s.at_m[static_cast<std::size_t>(fix->key)], off_m, refused(*fix)});
      if (refused(*fix))
        ++receiver.refused;
      else
        squared_m2 += off_m * off_m;
    }
    if (receiver.refused < receiver.fixes)
      receiver.rmse_m = std::sqrt(squared_m2 / static_cast<double>(receiver.fixes - receiver.refused));
    calibrate(content.key_poses, fixes, options, receiver);
    qa.receivers.push_back(std::move(receiver));
  }
}

void judgeLoops(const MapContent& content, const MapReport& report, const Stations& s, QaResult& qa) {
  for (const LoopEdge& loop : report.loops) {
    const Pose& T_map_i = content.key_poses[loop.i].T_map_body;
    const Pose& T_map_j = content.key_poses[loop.j].T_map_body;
    const double off_m = (loop.T_i_j.inverse() * T_map_i.inverse() * T_map_j).translation().norm();
    qa.loops.push_back({loop.i, loop.j, s.at_m[loop.j], off_m, loop.rivals, weakestOf(loop.covariance)});
    if (loop.rivals > 0) ++qa.loops_with_rivals;
  }
  for (const RefusedLoop& loop : report.refused_loops) {
    qa.refused_loops_at_m.push_back(s.at_m[loop.j]);
    if (loop.reason == LoopRefusal::ambiguous) ++qa.loops_ambiguous;
  }
}

void decide(const MapReport& report, const QaOptions& o, QaResult& qa) {
  const auto atMost = [&](const std::string& name, const std::string& unit, double value, double limit) {
    qa.checks.push_back({name, unit, value, limit, false});
  };
  const auto atLeast = [&](const std::string& name, const std::string& unit, double value, double limit) {
    qa.checks.push_back({name, unit, value, limit, true});
  };
  atMost("graphs that did not converge", "", report.converged ? 0 : 1, 0);
  atLeast("GPS fixes", "", static_cast<double>(qa.fixes.size()), 1);
  if (!qa.fixes.empty()) {
    const auto refused_fixes =
        std::count_if(qa.fixes.begin(), qa.fixes.end(), [](const auto& f) { return f.refused; });
    atMost("refused fixes", "%",
           100 * static_cast<double>(refused_fixes) / static_cast<double>(qa.fixes.size()),
           100 * o.max_refused_share);
    atMost("GPS rmse", "m", report.gps_rmse_m, o.max_gps_rmse_m);
    atMost("way without a fix", "m", qa.longest_without_fix_m, o.max_way_without_fix_m);
  }
  int full_laps = 0, most = 0;
  if (qa.on_lap) {
    const auto [least_at, most_at] =
        std::minmax_element(qa.stations.begin(), qa.stations.end(),
                            [](const StationQa& a, const StationQa& b) { return a.passes < b.passes; });
    full_laps = least_at->passes;
    most = most_at->passes;
  }
  atLeast("full laps", "", full_laps, o.min_passes);
  if (qa.on_lap) {
    if (most > 1) atLeast("loops", "", static_cast<double>(qa.loops.size()), 1);
    if (!qa.loops.empty()) atMost("loop residual", "m", report.loop_residual_m, o.max_loop_residual_m);
    atLeast("stations with road", "%", 100 * qa.road_share, 100 * o.min_road_share);
    atLeast("stations with a wall", "%", 100 * qa.wall_share, 100 * o.min_wall_share);
  }
  atMost("degenerate stations", "%", 100 * qa.degenerate_share, 100 * o.max_degenerate_share);
  atLeast("measured pieces of wall", "", static_cast<double>(report.walls.cells), 1);
  if (report.walls.cells > 0) atMost("wall thickness", "m", report.walls.median_m, o.max_wall_thickness_m);
  for (const ReceiverQa& r : qa.receivers) {
    double worst_m = 0;
    bool known = false;
    for (const Estimate& lever : r.lever_m)
      if (lever.observable) {
        worst_m = std::max(worst_m, std::abs(lever.value));
        known = true;
      }
    if (known) atMost(r.receiver + " lever arm error", "m", worst_m, o.max_lever_error_m);
    if (r.time_offset_s.observable)
      atMost(r.receiver + " time offset", "s", std::abs(r.time_offset_s.value), o.max_time_offset_s);
  }
}

void listFaults(const MapReport& report, QaResult& qa) {
  for (const SessionReport& s : report.sessions) {
    const auto tell = [&](std::vector<std::string>& list, const std::string& what, std::size_t times) {
      list.push_back((report.sessions.size() > 1 ? s.session + ": " : "") + what + " (" +
                     std::to_string(times) + " times)");
    };
    for (const auto& [fault, times] : s.odometry.faults)
      tell(fault.find(kTakenAsItIs) == std::string::npos ? qa.degraded : qa.taken_as_they_are, fault, times);
    if (s.odometry.restarts > 0)
      tell(qa.degraded, "LiDAR odometry lost for good and begun anew", s.odometry.restarts);
  }
}

std::string joined(const std::vector<std::string>& items) {
  std::string text;
  for (const auto& item : items) text += (text.empty() ? "" : "; ") + item;
  return text;
}

}  // namespace

std::string text(const QaCheck& check) {
  const char* pattern = "%.0f";
  if (check.unit == "m") pattern = "%.3f m";
  if (check.unit == "s") pattern = "%.4f s";
  if (check.unit == "%") pattern = "%.1f %%";
  const auto figure = [&](double value) {
    char line[64];
    std::snprintf(line, sizeof line, pattern, value);
    return std::string(line);
  };
  const char* sign = check.passed() ? (check.at_least ? " >= " : " <= ") : (check.at_least ? " < " : " > ");
  return check.name + " " + figure(check.value) + sign + figure(check.limit);
}

bool QaResult::passed() const {
  return std::all_of(checks.begin(), checks.end(), [](const QaCheck& check) { return check.passed(); });
}

std::string verdict(const QaResult& qa) {
  std::vector<std::string> reasons;
  for (const QaCheck& check : qa.checks)
    if (!check.passed()) reasons.push_back(text(check));
  std::string words = reasons.empty() ? "PASS" : "FAIL: " + joined(reasons);
  if (!qa.taken_as_they_are.empty()) words += "; scans used as they are: " + joined(qa.taken_as_they_are);
  if (!qa.degraded.empty()) words += "; degraded: " + joined(qa.degraded);
  return words;
}

QaResult qaOf(const MapContent& content, const MapReport& report, const QaOptions& options) {
  const Stations s = stationsOf(content);
  QaResult qa{};
  qa.on_lap = s.closed;
  qa.spacing_m = s.spacing_m;
  for (int n = 0; n < s.count; ++n)
    qa.stations.push_back({n * s.spacing_m, 0, false, false, false, false, {}});
  const auto at = [&](double station_m) -> StationQa& {
    return qa.stations[s.wrapped(static_cast<int>(std::lround(station_m / s.spacing_m)))];
  };
  for (const RoadStation& road : content.road) at(road.station_m).road = true;
  for (const WallPoint& wall : content.walls)
    (wall.side == WallSide::left ? at(wall.station_m).wall_left : at(wall.station_m).wall_right) = true;
  countPasses(content, s, options.max_gap_m, qa.stations);
  weakenStations(content, s, qa.stations);

  for (const MapFix& fix : content.fixes)
    if (const auto& number = s.number[static_cast<std::size_t>(fix.key)]; number && !refused(fix))
      qa.stations[s.wrapped(*number)].fix = true;

  const auto unpassed = [&](const StationQa& at_station) { return at_station.passes < options.min_passes; };
  const auto road = [](const StationQa& at_station) { return at_station.road; };
  const auto wall = [](const StationQa& at_station) { return at_station.wall_left || at_station.wall_right; };
  const auto degenerate = [&](const StationQa& at_station) {
    return at_station.odometry && at_station.odometry->sigma_m > options.degenerate_sigma_m;
  };
  qa.unpassed = stretches(qa.stations, s.spacing_m, unpassed);
  qa.without_road = stretches(qa.stations, s.spacing_m, [&](const StationQa& a) { return !road(a); });
  qa.without_wall = stretches(qa.stations, s.spacing_m, [&](const StationQa& a) { return !wall(a); });
  qa.degenerate = stretches(qa.stations, s.spacing_m, degenerate);
  qa.without_fix = stretches(qa.stations, s.spacing_m, [](const StationQa& a) { return !a.fix; });
  qa.longest_without_fix_m = longestWithoutFix(qa.without_fix, qa.stations, s);
  const auto is_short = [&](const Stretch& a) { return a.end_m - a.begin_m <= options.max_gap_m; };
  qa.without_fix.erase(std::remove_if(qa.without_fix.begin(), qa.without_fix.end(), is_short),
                       qa.without_fix.end());
  qa.road_share = share(qa.stations, road);
  qa.wall_share = share(qa.stations, wall);
  qa.degenerate_share = share(qa.stations, degenerate);

  judgeFixes(content, s, options, qa);
  judgeLoops(content, report, s, qa);
  qa.degenerate_loops = degenerateLoops(qa.loops, options.degenerate_loop_sigma_m);
  decide(report, options, qa);
  listFaults(report, qa);
  return qa;
}

}  // namespace raceloc
