/** \file
 * The walls beside the car, seen directly: no map and no position is asked. Source: the paper, "Wall detection for
 * resilient navigation"; what differs from it is said where it does. */
#pragma once

#include <raceloc/gpu/clusters.h>
#include <raceloc/gpu/standing.h>

#include <cmath>
#include <memory>
#include <optional>
#include <vector>

#include "core/options.h"
#include "core/types.h"
#include "track/circuit.h"

namespace raceloc {

/** A wall in the body frame, as a line at the height of the axle above the road beside it:
 * y = beta[0] + beta[1] x + beta[2] x^2 [m], x ahead of the rear axle, y to the left (a wall on the right has beta[0] <
 * 0). Source: paper, eq. (wall_find), with X = [1 x x^2]; robust instead of plain least squares. */
struct Wall {
  Side side;  ///< left or right of the car
  Eigen::Vector3d beta;
  Eigen::Matrix3d covariance;  ///< of beta
  double from_x_m, to_x_m;     ///< between these it was seen
  double length_m;             ///< seen, along it, without its gaps
  double residual_m;           ///< median distance of what was seen from the line
  double height_m;             ///< of what was seen, at most
  double age_s;                ///< since it was seen; 0: in this scan
  /** beta by what lies ahead of the rear axle alone, where much more was seen: at the begin of a turn no parabola fits what is
   * passed and what comes, and the guard asks for what comes. */
  std::optional<Eigen::Vector3d> beta_ahead = std::nullopt;
  bool is_passed = false;  ///< too little of it is ahead of the rear axle to say how it goes on

  [[nodiscard]] double y_m(double x_m) const { return beta[0] + x_m * (beta[1] + x_m * beta[2]); }
  [[nodiscard]] double slope(double x_m) const { return beta[1] + 2 * x_m * beta[2]; }
  /** From the rear axle's centre, along the body's y axis (paper, d_w); > 0. */
  [[nodiscard]] double distance_m() const { return side == Side::left ? beta[0] : -beta[0]; }
  [[nodiscard]] double distanceSigma_m() const { return std::sqrt(covariance(0, 0)); }
  /** Of the wall beside the rear axle against the car's; 0: parallel, > 0: it turns to the left. */
  [[nodiscard]] double heading_rad() const { return std::atan(beta[1]); }
  /** How far a point is on the car's side of the wall, perpendicular to it; < 0: beyond it. */
  [[nodiscard]] double clearance_m(const Eigen::Vector2d& p_body_m) const;
};

/** The wall with its curve ahead for beta; the rest is of the whole. */
[[nodiscard]] Wall ahead(Wall wall);

/** The wall after the body has moved. Its covariance grows by nothing: the motion over a wall's age is known to
 * centimetres. */
[[nodiscard]] Wall moved(const Wall& wall, const Pose& T_last_now, double dt_s);

enum class ScanVerdict {
  good,
  no_points,        ///< none, or none that is finite
  ground_not_below  ///< the LiDAR is not where its file says: upside down, on its side, metres too high
};

/** What one scan says: at once, also that there is no wall. */
struct WallScan {
  double stamp_s;
  ScanVerdict verdict;
  std::optional<Wall> left, right;  ///< none: neither seen now nor within keep_s; age_s > 0: not seen now

  [[nodiscard]] const std::optional<Wall>& on(Side side) const { return side == Side::left ? left : right; }
};

/** The walls that are not passed, by their curves ahead. */
[[nodiscard]] WallScan ahead(WallScan walls);

/** Section [wall]. */
struct WallOptions {
  double cell_m = 0.5;
  double min_spread_m = 0.4;
  double foot_m = 0.15;
  double reach_m = 1.2;
  int min_points = 3;
  double max_range_m = 80;
  double cluster_radius_m = 1.5;
  double min_length_m = 10;
  double max_distance_m = 30;
  double max_gap_m = 20;
  double robust_width_m = 0.1;
  double max_residual_m = 0.15;
  double max_heading_deg = 30;
  double min_radius_m = 15;
  double keep_s = 0.5;
  void describe(OptionList& keys);
  [[nodiscard]] gpu::StandingOptions forKernels() const;
};

class WallFit;

/** Finds the walls scan by scan. Deterministic: the same scans give the same bits, with any number of threads.
 * Allocates nothing once it has seen the largest scan. The context must outlive it. */
class WallDetector {
 public:
  /** \throws InputError if options contradict each other. */
  WallDetector(gpu::Context& context, const WallOptions& options);
  ~WallDetector();

  /** \param cloud       body frame at stamp_s, de-skewed, without the own car (DeskewedScan's); may hold NaN
   * \param T_last_now  motion of the body since the scan before; what is given with the first does not matter
   * \throws std::invalid_argument if stamp_s is not later than the one before. */
  [[nodiscard]] WallScan detect(const Cloud& cloud, double stamp_s, const Pose& T_last_now);

  /** \name How the newest answer came about, for pictures.
   * @{ */
  [[nodiscard]] const gpu::StandingCells& cells() const {
    return x_cells;
  }  ///< what is not ground, body frame
  [[nodiscard]] const std::vector<std::int32_t>& clusters() const { return x_labels; }  ///< one of each cell
                                                                                        /** @} */

 private:
  gpu::Context& x_context;
  WallOptions x_options;
  std::optional<WallScan> x_last;
  gpu::StandingCells x_cells;
  std::vector<std::int32_t> x_labels;
  std::unique_ptr<WallFit> x_fit;
};

}  // namespace raceloc
