#include "map/wall_lines.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <optional>

#include "core/statistics.h"
#include "map/cross_section.h"

namespace raceloc {

namespace {

constexpr double kReach_m = 30;
constexpr double kSectionHalfLength_m = 0.6;  // short, so that a wall at an angle to the line stays thin
constexpr double kThickness_m = 0.3;          // over which a wall stands ...
constexpr double kHeight_m = 0.4;             // ... at least this high
constexpr double kGap_m = 0.4;                // that nothing of it leaves open upward
constexpr double kFoot_m = 0.2;  // above the lowest point a point is the wall's and not the ground's
constexpr std::size_t kFewest =
    3;  // a wall has so many points at its top, and so many tell the height of its foot

using Points = std::vector<SectionPoint>;

/** What stands on the lowest of the points without a gap, lowest first. */
Points stack(Points points) {
  std::sort(points.begin(), points.end(),
            [](const SectionPoint& a, const SectionPoint& b) { return a.z_map_m < b.z_map_m; });
  const auto gap = std::adjacent_find(
      points.begin(), points.end(),
      [](const SectionPoint& a, const SectionPoint& b) { return b.z_map_m - a.z_map_m > kGap_m; });
  if (gap != points.end()) points.erase(gap + 1, points.end());
  return points;
}

/** The wall that stands in a strip of kThickness_m, if one does. `left_m` counts outward here. */
struct Standing {
  double out_m, foot_z_m, height_m;
};
std::optional<Standing> standingIn(const Points& strip) {
  const Points wall = stack(strip);
  if (wall.size() < 2 * kFewest) return std::nullopt;
  double foot_z_m = 0;
  for (std::size_t i = 0; i < kFewest; ++i) foot_z_m += wall[i].z_map_m / kFewest;
  const double height_m = wall[wall.size() - kFewest].z_map_m - foot_z_m;
  if (height_m < kHeight_m) return std::nullopt;
  std::vector<double> out_m;
  for (const SectionPoint& p : wall)
    if (p.z_map_m > foot_z_m + kFoot_m) out_m.push_back(p.left_m);
  return Standing{quantile(std::move(out_m), 0.5), foot_z_m, height_m};
}

/** The nearest wall among points sorted outward. */
std::optional<Standing> nearestWall(const Points& outward) {
  auto first = outward.begin(), last = outward.begin();
  for (; first != outward.end(); ++first) {
    while (last != outward.end() && last->left_m <= first->left_m + kThickness_m) ++last;
    const auto found = standingIn({first, last});
    if (!found) continue;
    // The first strip that holds the wall may hold only the edge of it: centre it on the face.
    Points centred;
    for (auto p = first; p != outward.end() && p->left_m <= found->out_m + kThickness_m / 2; ++p)
      if (p->left_m >= found->out_m - kThickness_m / 2) centred.push_back(*p);
    const auto better = standingIn(centred);
    return better ? better : found;
  }
  return std::nullopt;
}

}  // namespace

std::vector<WallPoint> wallLines(const TiledMap& map, const std::vector<MapWaypoint>& waypoints,
                                 double spacing_m) {
  std::vector<WallPoint> left_walls, right_walls;
  for (std::size_t i = 0; i < waypoints.size(); ++i) {
    const MapWaypoint& at = waypoints[i];
    const Points section = crossSection(map, at, kSectionHalfLength_m, kReach_m);
    const Eigen::Vector2d left(-std::sin(at.heading_rad), std::cos(at.heading_rad));
    for (const WallSide side : {WallSide::left, WallSide::right}) {
      const double sign = side == WallSide::left ? 1 : -1;
      Points outward;
      for (SectionPoint p : section) {
        p.left_m *= sign;
        if (p.left_m > 0) outward.push_back(p);
      }
      std::sort(outward.begin(), outward.end(),
                [](const SectionPoint& a, const SectionPoint& b) { return a.left_m < b.left_m; });
      const auto wall = nearestWall(outward);
      if (!wall) continue;
      const Eigen::Vector2d p_m = at.p_map_m.head<2>() + sign * wall->out_m * left;
      (side == WallSide::left ? left_walls : right_walls)
          .push_back(
              {static_cast<double>(i) * spacing_m, side, {p_m.x(), p_m.y(), wall->foot_z_m}, wall->height_m});
    }
  }
  left_walls.insert(left_walls.end(), right_walls.begin(), right_walls.end());
  return left_walls;
}

}  // namespace raceloc
