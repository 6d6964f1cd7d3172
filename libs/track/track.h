/** \file
 * The road of a circuit as a closed ribbon about its centre line. */
#pragma once

#include <cstdint>
#include <optional>
#include <unordered_map>
#include <vector>

#include "core/types.h"
#include "track/periodic_spline.h"

namespace raceloc {

/** A cross-section of the road. */
struct TrackPoint {
  Eigen::Vector3d p_map_m;  ///< on the centre line
  double bank_rad;          ///< positive: the right edge is the higher one, as in a left turn of an oval
  double right_m, left_m;   ///< from the centre line to the edges, along the banked surface; positive
};

/** The centre line at one station, with the road's own frame: x along it, y to the left in the surface, z out
 * of it. */
struct RoadFrame {
  Pose T_map_road;
  /** How the frame turns per metre of the centre line, in its own axes [1/m]; z is the curvature in the surface
   * (positive: to the left), -y the curvature out of it. */
  Eigen::Vector3d turn_per_m;
  double bank_rad, right_m, left_m;
};

/** A place in the surface beside the centre line. */
struct SurfacePoint {
  Pose T_map_surface;  ///< x along lines of equal offset, y to the left, z out of the surface
  double stretch;      ///< metres travelled at this offset per metre of the centre line
  RoadFrame centre;    ///< the centre line beside it
};

/** \p s_m is the arc length of the centre line from the start line, in the direction of driving; \p n_m the
 * offset to the left of it along the banked surface. Outside of the edges the surface goes on as it is at the
 * edge. */
class Track {
 public:
  /** \param points  in the order of driving, closed (the first is not repeated), 0.2 to 20 m apart
   * \throws std::invalid_argument for fewer than 8 points or such gaps. */
  explicit Track(const std::vector<TrackPoint>& points);

  [[nodiscard]] double length_m() const { return x_road.period(); }
  [[nodiscard]] double wrapped(double s_m) const;  ///< into [0, length)
  [[nodiscard]] RoadFrame at(double s_m) const;
  [[nodiscard]] SurfacePoint surface(double s_m, double n_m) const;

  struct Place {
    double s_m, n_m;
    double height_m;  ///< above the surface, along the z axis of the centre line beside it
  };
  /** The place on the track nearest to a point; none if the centre line is farther than `within_m` (at most
   * 200 m). */
  [[nodiscard]] std::optional<Place> locate(const Eigen::Vector3d& p_map_m, double within_m = 60) const;

 private:
  static constexpr double kCell_m = 20;
  PeriodicSpline<6> x_road;                                           ///< x y z bank right left
  std::unordered_map<std::uint64_t, std::vector<double>> x_stations;  ///< s [m] every 5 m, by planar cell
};

}  // namespace raceloc
