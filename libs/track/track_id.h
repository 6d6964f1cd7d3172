/** \file
 * Racetrack IDs: where on the loop a pose is, as a number that is the same on every lap. */
#pragma once

#include <optional>
#include <vector>

#include "core/options.h"
#include "core/types.h"
#include "track/planar_cells.h"

namespace raceloc {

/** Section [track_id]. */
struct TrackIdOptions {
  double spacing_m = 5;
  double reach_m = 12;
  double max_turn_deg = 60;
  void describe(OptionList& keys);
};

/** A point of the racing line and the direction of driving there. Its number in the loop is the racetrack ID. */
struct WayPoint {
  Eigen::Vector3d p_map_m;
  double
      heading_rad;  ///< of the chord from the way-point before to the one after; 0 = east, counter-clockwise
};

/** Cuts a closed line into N = round(length / spacing) equal steps along it, N >= 3; number 0 is its first point.
 * \param line_map_m  in the order of driving; the first point is not repeated at the end
 * \throws std::invalid_argument for fewer than 3 points, one that is not finite, or a spacing that is not > 0 */
[[nodiscard]] std::vector<WayPoint> wayPointsAlong(const std::vector<Eigen::Vector3d>& line_map_m,
                                                   double spacing_m);

/** The ID of any pose in O(1): a hash from planar cell to way-points. Source: reading.md section 3.
 *
 * The ID is the number of the nearest way-point (in space: of two roads above each other, each has its own) among
 * those within reach_m in the plane whose heading differs by at most max_turn_deg; of equally near ones, the lowest.
 * So opposite straights and the legs of a hairpin never share an ID, and a pit lane beyond the reach has none. A pit
 * lane within the reach shares the IDs of the straight beside it.
 *
 * Noise: a pose nearer to its way-point than half the distance from that to the next one has its ID for certain. On
 * the line, noise shorter than half a spacing hence moves the ID by at most 1, and not at all where the noise and
 * the distance to the way-point together stay below half a spacing. */
class TrackIds {
 public:
  /** \param way_points  as wayPointsAlong() gives them, or as they were stored
   * \throws std::invalid_argument for none, or for an option out of range */
  TrackIds(std::vector<WayPoint> way_points, const TrackIdOptions& options);

  /** 0 .. N-1; none away from the line, against its direction, or for a pose that is not finite. */
  [[nodiscard]] std::optional<int> idAt(const Pose& T_map_body) const;
  [[nodiscard]] std::optional<int> idAt(const Eigen::Vector3d& p_map_m, double heading_rad) const;
  /** The same where the height is not known: the way-point that is nearest in the plane. */
  [[nodiscard]] std::optional<int> idAt(const Eigen::Vector2d& p_map_m, double heading_rad) const;

  [[nodiscard]] const std::vector<WayPoint>& wayPoints() const { return x_way_points; }
  [[nodiscard]] int count() const { return static_cast<int>(x_way_points.size()); }

 private:
  [[nodiscard]] std::optional<int> nearest(const Eigen::Vector3d& p_map_m, double heading_rad,
                                           bool by_height) const;

  std::vector<WayPoint> x_way_points;
  double x_reach_m, x_max_turn_rad;
  PlanarCells x_cells;
};

}  // namespace raceloc
