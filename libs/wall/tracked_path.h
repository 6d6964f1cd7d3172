/** \file
 * The path that a car is about to drive, when it is told a line. */
#pragma once

#include <Eigen/Core>
#include <optional>
#include <vector>

#include "core/types.h"
#include "wall/wall_path.h"

namespace raceloc {

/** A larger offset from a line is steered against as if it were this one: so a line is approached no steeper than by this over
 * the look-ahead. */
constexpr double kMostOffset_m = 1;

/** Curvature at s_m, linear between the points; beyond an end, that of the end. \param path  at least one point, s_m
 * strictly increasing */
[[nodiscard]] double curvatureAt(const Path& path, double s_m);

/** The point of a path beside a place: on an arc from the nearest point. \param path  at least one point */
[[nodiscard]] PathPoint beside(const Path& path, const Eigen::Vector2d& p_m);

/** What a car drives that tracks a line: from where it is onto the line, no steeper than kMostOffset_m over `ahead_m`.
 * s_m and curvature_per_m are those of the line beside it.
 * \param line     body frame; empty: so is the result
 * \param ahead_m  > 0, at which the tracker looks */
[[nodiscard]] Path trackedPath(const Path& line, double ahead_m);

/** A closed line that the car is told to drive, on a map. */
class ToldLine {
 public:
  /** \param line_map_m  in the order of driving; z is the height of the road, NaN where it is not known: there the road is
   * the plane that the car stands on
   * \throws std::invalid_argument for fewer than three points that differ in the plane */
  explicit ToldLine(const std::vector<Eigen::Vector3d>& line_map_m);

  /** The line as it lies about a car, body frame: points 1 m apart, from a few metres behind on. Empty when the car is
   * more than 10 m, or 60 deg, off each stretch of the line: in a pit lane, say, it is not about to drive that line.
   * \param T_map_body  of a car on its wheels \param ahead_m  >= 0 */
  [[nodiscard]] Path from(const Pose& T_map_body, double ahead_m) const;

 private:
  /** Of the nearest place on a stretch that runs the car's way; none: see from(). */
  [[nodiscard]] std::optional<double> stationOf(const Pose& T_map_body) const;
  [[nodiscard]] Eigen::Vector3d at(double s_m) const;

  std::vector<Eigen::Vector3d> x_line_map_m;
  std::vector<double> x_s_m;  ///< of each point in the plane, and at last the length
};

}  // namespace raceloc
