/** \file
 * The road and the walls beside a pose, from what a map knows along its racing line. */
#pragma once

#include <Eigen/Core>
#include <optional>
#include <vector>

#include "core/options.h"
#include "map/map_content.h"
#include "track/track_id.h"

namespace raceloc {

/** Section [track_surface]. */
struct TrackSurfaceOptions {
  double reach_m = 12;
  double max_turn_deg = 60;
  void describe(OptionList& keys);
};

/** The road under a place, as a plane. */
struct RoadPlane {
  double height_m;   ///< of the ground, map frame
  double grade_rad;  ///< along the racing line's direction; positive: the road climbs
  double bank_rad;   ///< across it; positive: the right side is the higher one, as in a left turn of an oval
  Eigen::Vector3d up_map;  ///< normal of the plane, a unit vector
};

/** Where a place is on the track. */
struct TrackPlace {
  double station_m;         ///< of the racing line, 0 .. its length
  double lateral_m;         ///< to the left of the line, horizontally and square to it
  double line_heading_rad;  ///< of the line beside it, 0 = east, counter-clockwise
  std::optional<RoadPlane> road;
  /** From the place to the foot of the wall on that side, horizontally and square to the line (on a bank b it is 1/cos
   * b times as far along the road); negative: the place is beyond the wall. */
  std::optional<double> gap_left_m, gap_right_m;
};

/** Road, line and walls as smooth functions of the station, taken from the way-points and what a map has at each.
 *
 * The cross-sections of two neighbouring way-points, square to their headings, enclose a piece of track; a place's
 * share u of the way between them is that of its distances from both. In between the line, its height and the tangent
 * of the bank are cubic Hermite in u, heading and walls linear: all are continuous along the lap and across the start,
 * and so is the plane. Beside the line the road is straight: z(u, n) = h(u) - tan(bank(u)) n, with n to the left. */
class TrackSurface {
 public:
  /** Reads content's way-points, road and walls; keeps no reference. A content without way-points has no place.
   * \throws std::invalid_argument for an option out of range, or a road or wall whose station is not a way-point's */
  TrackSurface(const MapContent& content, const TrackSurfaceOptions& options);

  /** One look-up of the racetrack hash; allocates nothing.
   * \param p_map_m      of the point of interest: of the body for the attitude, of the car's side for a gap
   * \param heading_rad  of the car: tells the legs of a hairpin apart
   * \param height_m     of the car in the map: tells a bridge from the road under it; none: the nearest in the plane
   * \return none if the map has no racing line, or the place is farther than reach_m from its way-points, turned away
   *         from it by more than max_turn_deg, at or beyond the centre of a bend, or not finite. `road` is there where both
   *         neighbouring way-points have a road, a gap where both have that wall. */
  [[nodiscard]] std::optional<TrackPlace> at(const Eigen::Vector2d& p_map_m, double heading_rad,
                                             std::optional<double> height_m = std::nullopt) const;

  [[nodiscard]] double length_m() const { return x_spacing_m * static_cast<double>(x_sections.size()); }

 private:
  /** A value along the line and its slope per metre. */
  struct Knot {
    double value, slope_per_m;
  };
  /** What is at one way-point. */
  struct Section {
    Eigen::Vector2d p_map_m, along, left;
    double heading_rad;
    std::optional<Knot> height_m, tan_bank;           ///< both or none
    std::optional<double> left_wall_m, right_wall_m;  ///< outward from the line
  };
  /** \throws std::invalid_argument */
  [[nodiscard]] Section& sectionAt(double station_m);
  [[nodiscard]] std::size_t next(std::size_t i) const { return i + 1 < x_sections.size() ? i + 1 : 0; }
  [[nodiscard]] std::size_t previous(std::size_t i) const { return (i > 0 ? i : x_sections.size()) - 1; }
  static double hermite(const Knot& from, const Knot& to, double length_m, double u);
  static double hermiteSlope(const Knot& from, const Knot& to, double length_m, double u);

  double x_spacing_m;
  std::vector<Section> x_sections;
  std::optional<TrackIds> x_ids;
};

/** Attitude of a car that stands on a road and heads that way.
 * \param up_map  normal of the road, not horizontal
 * \return R_map_body: z is up_map, x is in the road above the heading, so yaw is heading_rad and roll and pitch are the
 *         road's */
[[nodiscard]] Eigen::Matrix3d standingOn(const Eigen::Vector3d& up_map, double heading_rad);

}  // namespace raceloc
