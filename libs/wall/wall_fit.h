/** \file
 * One wall out of standing cells: a curve that grows along what lies on it. */
#pragma once

#include <optional>
#include <vector>

#include "wall/wall_detector.h"

namespace raceloc {

/** Fits walls to cells. Keeps its memory. */
class WallFit {
 public:
  explicit WallFit(const WallOptions& options) : x_options(options) {}

  /** The cells of a scan and their clusters, body frame. */
  void take(const gpu::StandingCells& cells, const std::vector<std::int32_t>& clusters);

  /** The wall on one side; none if there is none. Of the long clusters there the nearest that is a wall, rather than the
   * longest (paper, eq. (wall_extract)): a grandstand is longer than the wall before it. */
  [[nodiscard]] std::optional<Wall> find(Side side);

 private:
  struct WallCell {
    Eigen::Vector3f face_m, upper_m;
    float lowest_m, highest_m;
    std::int32_t cluster;
    [[nodiscard]] bool isOn(Side side) const { return (face_m.y() > 0) == (side == Side::left); }
  };
  /** y = b0 + b1 x + b2 x^2 + lean h, h [m] above the axle's height over the wall's foot. A wall that is upright in the
   * world leans in the frame of a car on a bank; in that frame it is this, exactly. */
  struct Curve {
    Eigen::Vector4d b;
    Eigen::Vector3d foot;  ///< its z is foot[0] + foot[1] x + foot[2] x^2
    [[nodiscard]] double off_m(const Eigen::Vector3f& p_m) const;
    /** Whether the cell reaches down to the foot: what is seen in others is the top of the wall and the fence on it. */
    [[nodiscard]] bool hasFoot(const WallCell& cell) const;
  };
  /** Of the cells of a cluster on one side of the car. */
  struct Extent {
    Eigen::Array2f low_m, high_m;
    [[nodiscard]] double length_m() const { return double{(high_m - low_m).matrix().norm()}; }
  };
  struct Window {
    double from_m, to_m;
  };
  /** The wall that a cluster's cells on one side of the car begin; none if they are no smooth wall. Where it goes on
   * behind a gap, or in pieces that are clusters of their own, it is followed along the curve.
   * \param least_x_m  what is farther back is left out */
  [[nodiscard]] std::optional<Wall> from(std::int32_t cluster, Side side, double least_x_m);
  /** The same, with its curve ahead. */
  [[nodiscard]] std::optional<Wall> whole(std::int32_t cluster, Side side);
  [[nodiscard]] std::optional<Curve> seed(std::int32_t cluster, Side side, double least_x_m, Window& window);
  [[nodiscard]] bool refine(Curve& curve, const Window& window, double gate_m);
  void fitFoot(Curve& curve, const Window& window, double gate_m);
  /** Whether the cells between these lie on the curve; none if there are too few to say. */
  [[nodiscard]] std::optional<bool> fits(const Curve& curve, double from_m, double to_m);
  [[nodiscard]] Wall wallOf(const Curve& curve, const Window& window, Side side);
  template <class Use>
  void forCells(const Window& window, const Use& use) const;

  WallOptions x_options;
  std::vector<WallCell> x_cells;     ///< in ascending order of face_m.x()
  std::vector<Extent> x_extents;     ///< by the name of a cluster
  std::vector<std::int32_t> x_long;  ///< clusters
  Eigen::Matrix4d x_information;
  std::vector<double> x_off_m;
  std::vector<float> x_lowest;  ///< by metre of x
};

}  // namespace raceloc
