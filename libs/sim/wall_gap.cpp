#include "sim/wall_gap.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace raceloc {

namespace {

/** Offset of the nearest wall's face from the centre line, to the left. */
std::optional<double> faceOffset_m(const Circuit& circuit, double s_m, Side side) {
  const RoadFrame road = circuit.track.at(s_m);
  const double s = circuit.track.wrapped(s_m);
  std::optional<double> nearest_m;
  for (const Barrier& wall : circuit.barriers) {
    if (wall.side != side || s < wall.from_m || s > wall.to_m) continue;
    const double out_m = (side == Side::left ? road.left_m : road.right_m) + wall.offset_m;
    if (!nearest_m || out_m < *nearest_m) nearest_m = out_m;
  }
  if (nearest_m && side == Side::right) nearest_m = -*nearest_m;
  return nearest_m;
}

}  // namespace

std::optional<double> wallGap_m(const Circuit& circuit, double s_m, double n_m, double height_m, Side side) {
  const auto face_m = faceOffset_m(circuit, s_m, side);
  if (!face_m) return std::nullopt;
  const double left_m =
      height_m * std::tan(circuit.track.at(s_m).bank_rad);  // the road's normal leans to the low side
  return side == Side::left ? *face_m - n_m - left_m : n_m + left_m - *face_m;
}

double wheelToWall_m(const Circuit& circuit, const CarOptions& car, const RaceCarState& state) {
  const Pose T_map_car = circuit.track.surface(state.s_m, state.n_m).T_map_surface *
                         Eigen::Translation3d(0, 0, car.axle_height_m) *
                         Eigen::AngleAxisd(state.heading_rad, Eigen::Vector3d::UnitZ());
  double least_m = std::numeric_limits<double>::infinity();
  for (const double x_m : {0.0, car.wheelbase_m})
    for (const double y_m : {-0.5 * car.width_m, 0.5 * car.width_m}) {
      const Eigen::Vector3d p_map_m = T_map_car * Eigen::Vector3d(x_m, y_m, 0);
      const auto place = circuit.track.locate(p_map_m);
      if (!place) continue;
      const Pose T_map_road = circuit.track.at(place->s_m).T_map_road;
      const Eigen::Vector2d left = T_map_road.linear().col(1).head<2>().normalized();
      for (const Side side : {Side::left, Side::right}) {
        const auto face_m = faceOffset_m(circuit, place->s_m, side);
        if (!face_m) continue;
        const Eigen::Vector3d foot_map_m = T_map_road * Eigen::Vector3d(0, *face_m, 0);
        const double inside_m = (side == Side::left ? 1 : -1) * (foot_map_m - p_map_m).head<2>().dot(left);
        least_m = std::min(least_m, inside_m);
      }
    }
  return least_m;
}

}  // namespace raceloc
