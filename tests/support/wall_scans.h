/** \file
 * Scans of a car that drives a shipped circuit, with the truth about the walls beside it. */
#pragma once

#include <algorithm>
#include <cmath>
#include <optional>
#include <string>
#include <vector>

#include "cloud/deskew.h"
#include "sim/scenery.h"
#include "support/lap.h"

namespace raceloc::test {

/** A wall as it is, in the body frame at the height of the axle. */
struct TrueWall {
  double distance_m;   ///< along the y axis
  double heading_rad;  ///< of the wall there
};

/** Drives a lap and scans now and then: de-skewed with the true motion, cropped, as the pipeline does. */
class ScannedLap {
 public:
  ScannedLap(const std::string& track, const std::string& car, std::uint64_t seed = 1, int cars = 0)
      : x_lap(track, car, seed),
        x_world(sceneryMesh(x_lap.circuit, seed)),
        x_traffic(x_lap.circuit.track, x_lap.line, x_lap.profile, x_lap.file.car, cars, seed) {
    for (const auto& [label, options] : x_lap.file.lidars)
      x_lidars.push_back({label, options.phase_s, LidarModel(options, label, seed)});
  }

  /** Leaves the other LiDARs out. */
  void keep(const std::string& label) {
    x_lidars.erase(std::remove_if(x_lidars.begin(), x_lidars.end(),
                                  [&](const Lidar& lidar) { return lidar.label != label; }),
                   x_lidars.end());
  }

  [[nodiscard]] double lap_s() const { return x_lap.profile.lap_s(); }
  [[nodiscard]] Lap& lap() { return x_lap; }

  /** The sweep that begins at `begin_s` and those that begin until a period later, at their end. \param begin_s  not
   * before the one asked for last */
  [[nodiscard]] DeskewedScan scan(gpu::Context& context, double begin_s) {
    x_lap.driveUntil(begin_s + 0.3);
    std::vector<Scan> scans;
    for (const Lidar& lidar : x_lidars) {
      scans.push_back(lidar.model.sweep(x_lap.motion, x_world, x_traffic, begin_s + lidar.phase_s,
                                        static_cast<std::uint64_t>(begin_s * 10)));
      scans.back().stamp_s -= kStartStamp_s;
    }
    const Sweep sweep = sweepOf(std::move(scans));
    SweepPoses T_begin_at;
    const Pose T_begin_map = x_lap.motion.T_map_body(sweep.begin_s).inverse();
    for (std::size_t k = 0; k < T_begin_at.size(); ++k)
      T_begin_at[k] =
          T_begin_map * x_lap.motion.T_map_body(sweep.begin_s + (sweep.end_s - sweep.begin_s) *
                                                                    static_cast<double>(k) / kSweepSteps);
    return deskew(context, sweep, T_begin_at, {});
  }

  [[nodiscard]] Pose T_map_body(double stamp_s) const { return x_lap.motion.T_map_body(stamp_s); }

  /** The wall's face to a side at the height of the axle; none where there is no barrier within 40 m, or something stands
   * before it. */
  [[nodiscard]] std::optional<TrueWall> wall(double stamp_s, Side side) const {
    const Pose T = T_map_body(stamp_s);
    const Eigen::Vector3d out = T.linear() * Eigen::Vector3d(0, side == Side::left ? 1 : -1, 0);
    Hit hit;
    x_world.cast(T.translation(), &out, 1, 40, &hit);
    const Eigen::Vector3d hit_map_m = T.translation() + hit.range_m * out;
    if (hit.range_m == 0 || !isOnBarrier(hit_map_m, side)) return std::nullopt;
    // Its direction: of the line at one height above the wall's foot.
    const Track& track = x_lap.circuit.track;
    const Track::Place place = *track.locate(hit_map_m);
    const double sign = side == Side::left ? 1 : -1;
    const auto edge_m = [&](double s_m) {
      return side == Side::left ? track.at(s_m).left_m : track.at(s_m).right_m;
    };
    const double beside_m = sign * place.n_m - edge_m(place.s_m);
    const auto at = [&](double ahead_m) {
      const double s_m = place.s_m + ahead_m;
      return Eigen::Vector3d(T.inverse() *
                             track.surface(s_m, sign * (edge_m(s_m) + beside_m)).T_map_surface.translation());
    };
    const Eigen::Vector3d along_m = at(1) - at(-1);
    return TrueWall{hit.range_m, std::atan2(along_m.y(), along_m.x())};
  }

  /** Whether a barrier's face is here. */
  [[nodiscard]] bool isOnBarrier(const Eigen::Vector3d& p_map_m, Side side) const {
    constexpr double kFace_m = 0.2;  // nearer than the wall is thick
    const auto place = x_lap.circuit.track.locate(p_map_m);
    if (!place) return false;
    const RoadFrame road = x_lap.circuit.track.at(place->s_m);
    const double beside_m = side == Side::left ? place->n_m - road.left_m : -place->n_m - road.right_m;
    const double s_m = x_lap.circuit.track.wrapped(place->s_m);
    const auto& barriers = x_lap.circuit.barriers;
    return std::any_of(barriers.begin(), barriers.end(), [&](const Barrier& b) {
      return b.side == side && s_m >= b.from_m && s_m <= b.to_m && std::abs(beside_m - b.offset_m) < kFace_m;
    });
  }

 private:
  struct Lidar {
    std::string label;
    double phase_s;
    LidarModel model;
  };
  Lap x_lap;
  World x_world;
  Traffic x_traffic;
  std::vector<Lidar> x_lidars;
};

}  // namespace raceloc::test
