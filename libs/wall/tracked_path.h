/** \file
 * The path that a car is about to drive, when it is told a line. */
#pragma once

#include <Eigen/Core>
#include <optional>
#include <vector>

#include "core/types.h"
#include "wall/wall_path.h"

namespace raceloc {

/** An offset that is steered against: a line is approached no steeper. */
constexpr double kMostOffset_m = 1;

/** Between two points of a path, or that of its ends. \param path  at least one point */
[[nodiscard]] double curvatureAt(const Path& path, double s_m);

/** The point of a path beside a place: on an arc from the nearest point. \param path  at least one */
[[nodiscard]] PathPoint beside(const Path& path, const Eigen::Vector2d& p_m);

/** What a car drives that tracks a line: from where it is onto the line, no steeper than kMostOffset_m over `ahead_m`.
 * \param line     body frame; empty: so is the result
 * \param ahead_m  > 0, at which the tracker looks */
[[nodiscard]] Path driven(const Path& line, double ahead_m);

/** A closed line that the car is told to drive, on a map. */
class ToldLine {
 public:
  /** \param line_m  map frame, in the order of driving, three different points or more; z is the height of the road, NaN
   * where it is not known: there the road is the plane that the car stands on */
  explicit ToldLine(const std::vector<Eigen::Vector3d>& line_m);

  /** The line as it lies about a car, body frame: points 1 m apart, from a few metres behind on. Empty when the car is
   * more than 20 m, or 60 deg, off each stretch of the line. */
  [[nodiscard]] Path from(const Pose& T_map_body, double ahead_m) const;

 private:
  [[nodiscard]] std::optional<double> stationOf(const Pose& T_map_body) const;  ///< of the nearest place
  [[nodiscard]] Eigen::Vector3d at(double s_m) const;

  std::vector<Eigen::Vector3d> x_line_m;
  std::vector<double> x_s_m;  ///< of each point in the plane, and at last the length
};

}  // namespace raceloc
