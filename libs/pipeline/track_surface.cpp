#include "pipeline/track_surface.h"

#include <Eigen/Geometry>
#include <cmath>
#include <stdexcept>
#include <string>

namespace raceloc {

void TrackSurfaceOptions::describe(OptionList& keys) {
  keys.add("reach_m", reach_m, between(0.5, 100),
           "places farther from the racing line, in the plane, are off the track [m]");
  keys.add("max_turn_deg", max_turn_deg, between(1, 90),
           "so are cars that turn farther from the direction of driving [deg]");
}

namespace {

/** Slope of a value from its neighbours that there are. */
double slopeOf(const std::optional<double>& before, double here, const std::optional<double>& after,
               double spacing_m) {
  if (before && after) return (*after - *before) / (2 * spacing_m);
  if (before) return (here - *before) / spacing_m;
  return after ? (*after - here) / spacing_m : 0;
}

std::optional<double> between(const std::optional<double>& from, const std::optional<double>& to, double u) {
  if (!from || !to) return std::nullopt;
  return *from + u * (*to - *from);
}

}  // namespace

TrackSurface::TrackSurface(const MapContent& content, const TrackSurfaceOptions& options)
    : x_spacing_m(content.info.waypoint_spacing_m) {
  if (content.waypoints.empty()) return;
  std::vector<WayPoint> way_points;
  for (const MapWaypoint& w : content.waypoints) {
    way_points.push_back({w.p_map_m, w.heading_rad});
    const Eigen::Vector2d along(std::cos(w.heading_rad), std::sin(w.heading_rad));
    x_sections.push_back(
        {w.p_map_m.head<2>(), along, {-along.y(), along.x()}, w.heading_rad, {}, {}, {}, {}});
  }
  x_ids.emplace(std::move(way_points), TrackIdOptions{x_spacing_m, options.reach_m, options.max_turn_deg});

  for (const RoadStation& r : content.road) {
    Section& section = sectionAt(r.station_m);
    section.height_m = Knot{r.height_m, std::tan(r.grade_rad)};
    section.tan_bank = Knot{std::tan(r.bank_rad), 0};
  }
  const auto bankOf = [&](std::size_t i) {
    const auto& knot = x_sections[i].tan_bank;
    return knot ? std::optional(knot->value) : std::nullopt;
  };
  for (std::size_t i = 0; i < x_sections.size(); ++i)
    if (auto& knot = x_sections[i].tan_bank)
      knot->slope_per_m = slopeOf(bankOf(previous(i)), knot->value, bankOf(next(i)), x_spacing_m);
  for (const WallPoint& w : content.walls) {
    Section& section = sectionAt(w.station_m);
    const double left_m = section.left.dot(w.p_map_foot_m.head<2>() - section.p_map_m);
    if (w.side == WallSide::left)
      section.left_wall_m = left_m;
    else
      section.right_wall_m = -left_m;
  }
}

TrackSurface::Section& TrackSurface::sectionAt(double station_m) {
  const double number = std::round(station_m / x_spacing_m);
  if (!(number >= 0 && number < static_cast<double>(x_sections.size())) ||
      std::abs(number * x_spacing_m - station_m) > 0.01 * x_spacing_m)
    throw std::invalid_argument("TrackSurface: no way-point at station " + std::to_string(station_m));
  return x_sections[static_cast<std::size_t>(number)];
}

double TrackSurface::hermite(const Knot& from, const Knot& to, double length_m, double u) {
  const double v = 1 - u;
  return v * v * ((1 + 2 * u) * from.value + u * length_m * from.slope_per_m) +
         u * u * ((3 - 2 * u) * to.value - v * length_m * to.slope_per_m);
}

double TrackSurface::hermiteSlope(const Knot& from, const Knot& to, double length_m, double u) {
  const double v = 1 - u;
  return 6 * u * v * (to.value - from.value) / length_m + v * (1 - 3 * u) * from.slope_per_m +
         u * (3 * u - 2) * to.slope_per_m;
}

std::optional<TrackPlace> TrackSurface::at(const Eigen::Vector2d& p_map_m, double heading_rad,
                                           std::optional<double> height_m) const {
  if (!x_ids) return std::nullopt;
  const auto id = height_m ? x_ids->idAt(Eigen::Vector3d(p_map_m.x(), p_map_m.y(), *height_m), heading_rad)
                           : x_ids->idAt(p_map_m, heading_rad);
  if (!id) return std::nullopt;

  // The nearest way-point is one end of the piece, but for bends: there the cross-sections decide.
  constexpr int kSteps = 4;
  auto i = static_cast<std::size_t>(*id);
  double from_m = 0, to_m = 0;  // to the cross-sections behind and ahead
  for (int step = 0; step < kSteps; ++step) {
    from_m = x_sections[i].along.dot(p_map_m - x_sections[i].p_map_m);
    to_m = x_sections[next(i)].along.dot(x_sections[next(i)].p_map_m - p_map_m);
    if (from_m < 0)
      i = previous(i);
    else if (to_m <= 0)
      i = next(i);
    else
      break;
  }
  if (!(from_m >= 0 && to_m > 0)) return std::nullopt;
  const Section &from = x_sections[i], &to = x_sections[next(i)];
  const double u = from_m / (from_m + to_m), length_m = (to.p_map_m - from.p_map_m).norm();

  const double turn_rad = wrapAngle(to.heading_rad - from.heading_rad);
  const double line_heading_rad = wrapAngle(from.heading_rad + u * turn_rad);
  const Eigen::Vector2d along(std::cos(line_heading_rad), std::sin(line_heading_rad)),
      left(-along.y(), along.x());
  const auto lineAt = [&](int axis) {
    return hermite({from.p_map_m(axis), from.along(axis)}, {to.p_map_m(axis), to.along(axis)}, length_m, u);
  };
  const double lateral_m = left.dot(p_map_m - Eigen::Vector2d(lineAt(0), lineAt(1)));
  const double stretch = 1 - turn_rad / length_m * lateral_m;  // of a metre of the line, beside it
  constexpr double kLeast = 0.1;  // nearer to the centre of a bend nothing is told apart
  if (stretch < kLeast) return std::nullopt;
  TrackPlace place{(static_cast<double>(i) + u) * x_spacing_m, lateral_m, line_heading_rad, {}, {}, {}};

  if (from.height_m && to.height_m) {
    const double tan_bank = hermite(*from.tan_bank, *to.tan_bank, length_m, u);
    const double tan_grade = (hermiteSlope(*from.height_m, *to.height_m, length_m, u) -
                              hermiteSlope(*from.tan_bank, *to.tan_bank, length_m, u) * lateral_m) /
                             stretch;
    const Eigen::Vector2d slope = tan_grade * along - tan_bank * left;
    place.road = RoadPlane{hermite(*from.height_m, *to.height_m, length_m, u) - tan_bank * lateral_m,
                           std::atan(tan_grade), std::atan(tan_bank),
                           Eigen::Vector3d(-slope.x(), -slope.y(), 1).normalized()};
  }
  if (const auto wall_m = between(from.left_wall_m, to.left_wall_m, u))
    place.gap_left_m = *wall_m - lateral_m;
  if (const auto wall_m = between(from.right_wall_m, to.right_wall_m, u))
    place.gap_right_m = *wall_m + lateral_m;
  return place;
}

Eigen::Matrix3d standingOn(const Eigen::Vector3d& up_map, double heading_rad) {
  const Eigen::Vector2d ahead(std::cos(heading_rad), std::sin(heading_rad));
  Eigen::Matrix3d R_map_body;
  R_map_body.col(2) = up_map.normalized();
  R_map_body.col(0) =
      Eigen::Vector3d(ahead.x(), ahead.y(), -up_map.head<2>().dot(ahead) / up_map.z()).normalized();
  R_map_body.col(1) = R_map_body.col(2).cross(R_map_body.col(0));
  return R_map_body;
}

}  // namespace raceloc
