#include "map/cross_section.h"

#include <cmath>

namespace raceloc {

std::vector<SectionPoint> crossSection(const TiledMap& map, const MapWaypoint& at, double half_length_m,
                                       double half_width_m) {
  const Eigen::Vector2d along(std::cos(at.heading_rad), std::sin(at.heading_rad)),
      left(-along.y(), along.x());
  const Eigen::Vector2d reach_m = half_length_m * along.cwiseAbs() + half_width_m * left.cwiseAbs();
  const auto tileOf = [&](double v_m) { return static_cast<int>(std::floor(v_m / map.tileSize())); };
  const Eigen::Vector2d low_m = at.p_map_m.head<2>() - reach_m, high_m = at.p_map_m.head<2>() + reach_m;
  std::vector<SectionPoint> points;
  for (int ix = tileOf(low_m.x()); ix <= tileOf(high_m.x()); ++ix)
    for (int iy = tileOf(low_m.y()); iy <= tileOf(high_m.y()); ++iy) {
      const auto found = map.tiles().find({ix, iy});
      if (found == map.tiles().end()) continue;
      const Cloud& cloud = found->second.cloud;
      const Eigen::Vector2d corner_m =
          tileCorner(found->second, map.tileSize()).head<2>() - at.p_map_m.head<2>();
      for (std::size_t i = 0; i < cloud.size(); ++i) {
        const Eigen::Vector2d d_m = corner_m + Eigen::Vector2d(cloud.x[i], cloud.y[i]);
        const double along_m = along.dot(d_m), left_m = left.dot(d_m);
        if (std::abs(along_m) <= half_length_m && std::abs(left_m) <= half_width_m)
          points.push_back({along_m, left_m, cloud.z[i]});
      }
    }
  return points;
}

}  // namespace raceloc
