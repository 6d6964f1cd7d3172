#include "track/track.h"

#include <algorithm>
#include <stdexcept>

#include "track/planar_cells.h"

namespace raceloc {

namespace {

constexpr double kStep_m = 1;      // between knots
constexpr double kStations_m = 5;  // between the stations that locate() starts from
constexpr double kMaxSearch_m = 200;

using Section = Eigen::Matrix<double, 6, 1>;

Section sectionOf(const TrackPoint& point) {
  Section section;
  section << point.p_map_m, point.bank_rad, point.right_m, point.left_m;
  return section;
}

/** Knots at equal steps of arc length on the closed curve through `points`. */
PeriodicSpline<6> byArcLength(const std::vector<TrackPoint>& points) {
  std::vector<Section> sections;
  sections.reserve(points.size());
  for (const auto& point : points) sections.push_back(sectionOf(point));
  const PeriodicSpline<6> by_index(sections, 1);

  constexpr int kFine = 40;  // chords this much shorter than the gaps: their sum is the arc to 1e-5
  std::vector<double> arc_m{0};
  Eigen::Vector3d last = by_index(0).value.head<3>();
  const std::size_t chords = points.size() * kFine;
  arc_m.reserve(chords + 1);
  for (std::size_t i = 1; i <= chords; ++i) {
    const Eigen::Vector3d p = by_index(static_cast<double>(i) / kFine).value.head<3>();
    arc_m.push_back(arc_m.back() + (p - last).norm());
    last = p;
  }
  const auto knots = static_cast<std::size_t>(std::max(8.0, std::round(arc_m.back() / kStep_m)));
  const double step_m = arc_m.back() / static_cast<double>(knots);
  std::vector<Section> even;
  even.reserve(knots);
  std::size_t i = 0;
  for (std::size_t k = 0; k < knots; ++k) {
    const double s_m = static_cast<double>(k) * step_m;
    while (arc_m[i + 1] <= s_m) ++i;
    const double within = (s_m - arc_m[i]) / (arc_m[i + 1] - arc_m[i]);
    even.push_back(by_index((static_cast<double>(i) + within) / kFine).value);
  }
  return {std::move(even), step_m};
}

}  // namespace

Track::Track(const std::vector<TrackPoint>& points) {
  if (points.size() < 8) throw std::invalid_argument("Track: needs 8 points");
  for (std::size_t i = 0; i < points.size(); ++i) {
    const double gap_m = (points[(i + 1) % points.size()].p_map_m - points[i].p_map_m).norm();
    if (!(gap_m >= 0.2 && gap_m <= 20))
      throw std::invalid_argument("Track: points must be 0.2 to 20 m apart");
  }
  x_road = byArcLength(points);
  const auto stations = static_cast<std::size_t>(std::ceil(length_m() / kStations_m));
  for (std::size_t i = 0; i < stations; ++i) {
    const double s_m = static_cast<double>(i) * kStations_m;
    const auto p = x_road(s_m).value;
    x_stations[planarCell(p.x(), p.y(), kCell_m)].push_back(s_m);
  }
}

double Track::wrapped(double s_m) const {
  const double s = s_m - length_m() * std::floor(s_m / length_m());
  return s < length_m() ? s : 0;
}

RoadFrame Track::at(double s_m) const {
  const auto road = x_road(s_m);
  const Eigen::Vector3d dp = road.first.head<3>(), ddp = road.second.head<3>();
  const double bank = road.value[3], dbank = road.first[3];

  const double pace = dp.norm();  // 1 but for the spline's own error
  const Eigen::Vector3d forward = dp / pace;
  const Eigen::Vector3d dforward = (ddp - forward * forward.dot(ddp)) / pace;
  const double flat2 = dp.head<2>().squaredNorm();
  const double dheading = (dp.x() * ddp.y() - dp.y() * ddp.x()) / flat2;
  const Eigen::Vector3d level_ahead = Eigen::Vector3d(dp.x(), dp.y(), 0) / std::sqrt(flat2);
  const Eigen::Vector3d level_left(-level_ahead.y(), level_ahead.x(), 0);
  const Eigen::Vector3d up = forward.cross(level_left);
  const Eigen::Vector3d dup = dforward.cross(level_left) - forward.cross(dheading * level_ahead);

  const double c = std::cos(bank), s = std::sin(bank);
  const Eigen::Vector3d left = c * level_left - s * up;
  const Eigen::Vector3d normal = forward.cross(left);
  const Eigen::Vector3d dleft = -dbank * (s * level_left + c * up) - c * dheading * level_ahead - s * dup;

  RoadFrame frame;
  frame.T_map_road = Pose::Identity();
  frame.T_map_road.linear() << forward, left, normal;
  frame.T_map_road.translation() = road.value.head<3>();
  frame.turn_per_m = Eigen::Vector3d(dleft.dot(normal), -dforward.dot(normal), dforward.dot(left)) / pace;
  frame.bank_rad = bank;
  frame.right_m = road.value[4];
  frame.left_m = road.value[5];
  return frame;
}

SurfacePoint Track::surface(double s_m, double n_m) const {
  SurfacePoint point{Pose::Identity(), 0, at(s_m)};
  // d/ds (p + n left) = (1 - n turn_z) forward + n turn_x normal: the surface twists where the bank changes.
  const Eigen::Vector3d& turn = point.centre.turn_per_m;
  const double along = 1 - n_m * turn.z(), out = n_m * turn.x();
  point.stretch = std::hypot(along, out);
  const Eigen::AngleAxisd twist(-std::atan2(out, along), Eigen::Vector3d::UnitY());
  point.T_map_surface = point.centre.T_map_road * Eigen::Translation3d(0, n_m, 0) * twist;
  return point;
}

std::optional<Track::Place> Track::locate(const Eigen::Vector3d& p_map_m, double within_m) const {
  constexpr double kFarthest_m = 1e6;  // cells are numbered by 32 bits; NaN is nowhere either
  if (!(p_map_m.cwiseAbs().maxCoeff() < kFarthest_m) || !p_map_m.allFinite()) return std::nullopt;
  const double reach_m = std::min(within_m, kMaxSearch_m) + kStations_m;
  const int cells = static_cast<int>(std::ceil(reach_m / kCell_m));
  double best_s_m = 0, best_m = reach_m;
  for (int dx = -cells; dx <= cells; ++dx)
    for (int dy = -cells; dy <= cells; ++dy) {
      const auto cell =
          x_stations.find(planarCell(p_map_m.x() + dx * kCell_m, p_map_m.y() + dy * kCell_m, kCell_m));
      if (cell == x_stations.end()) continue;
      for (const double s_m : cell->second) {
        const double distance_m = (x_road(s_m).value.head<3>() - p_map_m).norm();
        if (distance_m < best_m) {
          best_m = distance_m;
          best_s_m = s_m;
        }
      }
    }
  if (!(best_m < reach_m)) return std::nullopt;

  Place place{best_s_m, 0, 0};
  constexpr int kMaxSteps = 20;
  for (int step = 0; step < kMaxSteps; ++step) {
    const RoadFrame frame = at(place.s_m);
    const Eigen::Vector3d p_road_m = frame.T_map_road.inverse() * p_map_m;
    place.n_m = p_road_m.y();
    place.height_m = p_road_m.z();
    const double pace = 1 - p_road_m.y() * frame.turn_per_m.z() + p_road_m.z() * frame.turn_per_m.y();
    const double ahead_m = std::clamp(p_road_m.x() / std::max(0.2, pace), -kStations_m, kStations_m);
    place.s_m += ahead_m;
    if (std::abs(ahead_m) < 1e-7) break;
  }
  place.s_m = wrapped(place.s_m);
  if (std::hypot(place.n_m, place.height_m) > within_m) return std::nullopt;
  return place;
}

}  // namespace raceloc
