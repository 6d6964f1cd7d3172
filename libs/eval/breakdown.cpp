#include "eval/breakdown.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <utility>

#include "eval/format.h"

namespace raceloc {

namespace {

constexpr double kNear_m = 15;  // wider than a track, narrower than two of its straights are apart
constexpr double kAway_m = 50;
constexpr double kSameWay_rad = 45 * kDegree;

/** Sums first, roots at the end. */
class Gathered {
 public:
  void add(const PoseError& p) {
    ++x_sum.poses;
    x_sum.plane_rmse_m += p.position_plane_m * p.position_plane_m;
    x_sum.lateral_rmse_m += p.lateral_m * p.lateral_m;
    x_sum.longitudinal_rmse_m += p.longitudinal_m * p.longitudinal_m;
    x_sum.height_rmse_m += p.height_m * p.height_m;
    x_sum.heading_rmse_deg += p.heading_deg * p.heading_deg;
    x_sum.plane_max_m = std::max(x_sum.plane_max_m, p.position_plane_m);
  }
  [[nodiscard]] ErrorBin bin(std::string name) const {
    ErrorBin bin = x_sum;
    bin.name = std::move(name);
    for (double* rmse : {&bin.plane_rmse_m, &bin.lateral_rmse_m, &bin.longitudinal_rmse_m, &bin.height_rmse_m,
                         &bin.heading_rmse_deg})
      *rmse = std::sqrt(*rmse / std::max(1.0, static_cast<double>(bin.poses)));
    return bin;
  }

 private:
  ErrorBin x_sum{};
};

/** The lap that each station belongs to. */
std::size_t lapOf(double station_m, const std::vector<double>& starts_m) {
  return static_cast<std::size_t>(std::upper_bound(starts_m.begin(), starts_m.end(), station_m) -
                                  starts_m.begin()) -
         1;
}

}  // namespace

std::vector<double> lapStarts(const std::vector<PoseError>& poses) {
  std::vector<double> starts_m{0};
  const Pose& T_first = poses.front().T_map_truth;
  bool was_away = false;
  double nearest_m = kNear_m, nearest_station_m = 0;
  for (const PoseError& pose : poses) {
    const double distance_m = (pose.T_map_truth.translation() - T_first.translation()).norm();
    if (distance_m > kAway_m) was_away = true;
    if (!was_away) continue;
    const bool is_near = distance_m <= kNear_m &&
                         std::abs(wrapAngle(yawOf(pose.T_map_truth) - yawOf(T_first))) <= kSameWay_rad;
    if (is_near && distance_m < nearest_m) {
      nearest_m = distance_m;
      nearest_station_m = pose.station_m;
    } else if (nearest_m < kNear_m && distance_m > nearest_m) {
      // Past it: the nearest pose is one only if the car comes no nearer any more.
      if (distance_m < std::min(kNear_m, nearest_m + 1)) continue;
      starts_m.push_back(nearest_station_m);
      nearest_m = kNear_m;
      was_away = false;
    }
  }
  return starts_m;
}

double lapLength_m(const std::vector<PoseError>& poses, const std::vector<double>& starts_m) {
  return starts_m.size() > 1 ? starts_m.back() / static_cast<double>(starts_m.size() - 1)
                             : poses.back().station_m;
}

std::vector<double> lapStations_m(const std::vector<PoseError>& poses, const std::vector<double>& starts_m) {
  const double length_m = lapLength_m(poses, starts_m);
  std::vector<double> stations_m;
  stations_m.reserve(poses.size());
  for (const PoseError& pose : poses) {
    const std::size_t lap = lapOf(pose.station_m, starts_m);
    const double since_m = pose.station_m - starts_m[lap];
    const bool is_full = lap + 1 < starts_m.size();
    const double scale = is_full ? length_m / (starts_m[lap + 1] - starts_m[lap]) : 1;
    stations_m.push_back(std::min(scale * since_m, length_m));
  }
  return stations_m;
}

std::vector<ErrorBin> errorsBySector(const std::vector<PoseError>& poses, const std::vector<double>& starts_m,
                                     int count) {
  const double sector_m = lapLength_m(poses, starts_m) / count;
  const std::vector<double> stations_m = lapStations_m(poses, starts_m);
  std::vector<Gathered> gathered(static_cast<std::size_t>(count));
  for (std::size_t i = 0; i < poses.size(); ++i) {
    const double sector = sector_m > 0 ? std::floor(stations_m[i] / sector_m) : 0;
    gathered[static_cast<std::size_t>(std::min(sector, count - 1.0))].add(poses[i]);
  }
  std::vector<ErrorBin> bins;
  for (std::size_t k = 0; k < gathered.size(); ++k) {
    const auto number = static_cast<double>(k);
    bins.push_back(gathered[k].bin(format("%.0f .. %.0f m", number * sector_m, (number + 1) * sector_m)));
  }
  return bins;
}

std::vector<ErrorBin> errorsByLap(const std::vector<PoseError>& poses, const std::vector<double>& starts_m) {
  if (starts_m.size() < 2) return {};
  std::vector<Gathered> gathered(starts_m.size());
  for (const PoseError& pose : poses) gathered[lapOf(pose.station_m, starts_m)].add(pose);
  std::vector<ErrorBin> bins;
  for (std::size_t k = 0; k < gathered.size(); ++k) {
    const double end_m = k + 1 < starts_m.size() ? starts_m[k + 1] : poses.back().station_m;
    bins.push_back(
        gathered[k].bin(format("lap %.0f, %.0f m", static_cast<double>(k + 1), end_m - starts_m[k])));
  }
  return bins;
}

std::vector<ErrorBin> errorsBySpeed(const std::vector<PoseError>& poses, double width_mps) {
  std::map<double, Gathered> gathered;
  for (const PoseError& pose : poses) gathered[std::floor(pose.speed_mps / width_mps)].add(pose);
  std::vector<ErrorBin> bins;
  bins.reserve(gathered.size());
  for (const auto& [number, sum] : gathered)
    bins.push_back(sum.bin(format("%g .. %g m/s", number * width_mps, (number + 1) * width_mps)));
  return bins;
}

}  // namespace raceloc
