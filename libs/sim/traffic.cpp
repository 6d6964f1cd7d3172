#include "sim/traffic.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace raceloc {

BoxHit firstHit(const std::vector<Box>& boxes, const Eigen::Vector3d& origin_map_m,
                const Eigen::Vector3d& direction_map) {
  BoxHit first;
  for (const auto& box : boxes) {
    const Eigen::Matrix3d& R = box.T_map_box.linear();
    const Eigen::Vector3d o = R.transpose() * (origin_map_m - box.T_map_box.translation());
    const Eigen::Vector3d d = R.transpose() * direction_map;
    double enter_m = -std::numeric_limits<double>::infinity(), leave_m = -enter_m;
    int side = 0;
    for (int k = 0; k < 3; ++k) {
      const double a_m = (-box.half_m[k] - o[k]) / d[k], b_m = (box.half_m[k] - o[k]) / d[k];
      if (std::min(a_m, b_m) > enter_m) {
        enter_m = std::min(a_m, b_m);
        side = k;
      }
      leave_m = std::min(leave_m, std::max(a_m, b_m));
    }
    if (!(enter_m > 0 && enter_m <= leave_m)) continue;
    if (first.range_m == 0 || enter_m < first.range_m) first = {enter_m, std::abs(d[side])};
  }
  return first;
}

Traffic::Traffic(const Track& track, const RacingLine& line, const SpeedProfile& profile,
                 const CarOptions& car, int cars, std::uint64_t seed)
    : x_track(track), x_line(line), x_profile(profile), x_car(car) {
  const Noise noise(seed, "traffic");
  for (int i = 0; i < cars; ++i) {
    const auto k = 3 * static_cast<std::uint64_t>(i);
    const double share = (i + 0.3 + 0.4 * noise.uniform(k)) / cars;
    x_drivers.push_back({share * profile.lap_s(), 0.94 + 0.04 * noise.uniform(k + 1),
                         (noise.uniform(k + 2) < 0.5 ? -1 : 1) * (1 + 0.25 * i)});
  }
}

std::vector<Box> Traffic::at(double time_s) const {
  std::vector<Box> boxes;
  boxes.reserve(2 * x_drivers.size());
  for (const auto& driver : x_drivers) {
    const double s_m = x_profile.stationAfter(driver.start_s + driver.pace * time_s);
    const auto line = x_line.at(s_m);
    const auto centre = x_track.at(s_m);
    const double margin_m = 0.7 * x_car.width_m;
    const double n_m = std::clamp(line.n_m + driver.beside_m * x_car.width_m, margin_m - centre.right_m,
                                  std::max(margin_m - centre.right_m, centre.left_m - margin_m));
    const Pose T_map_road = x_track.surface(s_m, n_m).T_map_surface *
                            Eigen::AngleAxisd(line.direction_rad, Eigen::Vector3d::UnitZ());
    const double l = x_car.length_m, w = x_car.width_m, h = x_car.height_m;
    boxes.push_back(
        {T_map_road * Eigen::Translation3d(0.3 * l, 0, 0.35 * h + 0.05), {0.5 * l, 0.3 * w, 0.35 * h}});
    boxes.push_back({T_map_road * Eigen::Translation3d(-0.1 * l, 0, 0.8 * h), {0.05 * l, 0.5 * w, 0.2 * h}});
  }
  return boxes;
}

}  // namespace raceloc
