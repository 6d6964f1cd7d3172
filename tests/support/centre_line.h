#pragma once

#include <vector>

#include "track/track.h"

namespace raceloc::test {

/** The centre line of a track by points about `step_m` apart. */
inline std::vector<Eigen::Vector3d> centreLine(const Track& track, double step_m) {
  const int points = static_cast<int>(track.length_m() / step_m);
  std::vector<Eigen::Vector3d> line;
  line.reserve(static_cast<std::size_t>(points));
  for (int k = 0; k < points; ++k)
    line.emplace_back(track.at(track.length_m() * k / points).T_map_road.translation());
  return line;
}

}  // namespace raceloc::test
