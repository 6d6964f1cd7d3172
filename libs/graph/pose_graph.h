/** \file
 * A pose graph as data: poses, and factors that say what was measured about them.
 * Every factor has a residual r, whitened (unit covariance), and its Jacobians with respect to right increments
 * xi = (rotation [rad], translation [m]), T <- T exp(xi); the graph's cost is half the sum of rho(r' r).
 * Source of the derivatives: Sola et al., arXiv:1812.01537, Eq. (141)-(145) (SO(3)), (172) (SE(3)). */
#pragma once

#include <cstddef>
#include <limits>
#include <optional>
#include <variant>
#include <vector>

#include "core/types.h"

namespace raceloc {

/** rho(s) of a squared whitened residual s, with rho(s) = s near zero.
 * Source: Triggs et al., Bundle adjustment, 2000, section 3; Huber and Cauchy as there. */
struct RobustLoss {
  enum class Kind { none, huber, cauchy };
  Kind kind = Kind::none;
  double width = 1;  ///< where it begins to bend, in sigmas, > 0

  [[nodiscard]] double cost(double squared) const;    ///< rho(s)
  [[nodiscard]] double weight(double squared) const;  ///< rho'(s), in (0, 1]
};

/** W with W' W = C^-1, upper triangular. \throws std::invalid_argument unless C is positive definite. */
[[nodiscard]] Matrix6d whiteningOf(const Matrix6d& covariance);
[[nodiscard]] Eigen::Matrix3d whiteningOf(const Eigen::Matrix3d& covariance);

/** The whole pose: r = W (Log(R_0' R), R_0' (p - p_0)). */
struct PriorFactor {
  std::size_t i;
  Pose T_map_body;
  Matrix6d whitening;  ///< of (rotation [rad], translation [m]) in the frame of the measured pose
  RobustLoss loss;
};

/** Pose of j seen from i, odometry or a loop: r = W (Log(R_E), p_E) with E = T_i_j^-1 T_i^-1 T_j. */
struct BetweenFactor {
  std::size_t i, j;  ///< not the same pose
  Pose T_i_j;
  Matrix6d whitening;  ///< of (rotation [rad], translation [m]), in the frame of the measured j
  RobustLoss loss;
};

/** Position of an antenna: r = W (p + R l - z). */
struct PositionFactor {
  std::size_t i;
  Eigen::Vector3d z_map_antenna_m, p_body_antenna_m;
  Eigen::Matrix3d whitening;  ///< in the map frame
  RobustLoss loss;
};

/** Attitude: r = W Log(R_0' R). */
struct AttitudeFactor {
  std::size_t i;
  Eigen::Matrix3d R_map_body;
  Eigen::Matrix3d whitening;  ///< of a right increment
  RobustLoss loss;
};

/** Roll and pitch: r = x and y of what is up in the body, turned into the map, over sigma. */
struct LevelFactor {
  std::size_t i;
  Eigen::Vector3d up_body;  ///< unit vector
  double sigma_rad;
  RobustLoss loss;
};

using Factor = std::variant<PriorFactor, BetweenFactor, PositionFactor, AttitudeFactor, LevelFactor>;

struct PoseGraph {
  std::vector<Pose> T_map_body;     ///< the estimate, one a key
  std::vector<Factor> factors;      ///< their keys are indices into `T_map_body`
  std::optional<std::size_t> held;  ///< this pose does not move: for graphs that nothing ties to the map
};

constexpr std::size_t kNoPose = std::numeric_limits<std::size_t>::max();

/** What a factor says of one estimate. Factors with fewer than six rows leave zeros below. */
struct Residual {
  Vector6d r;      ///< scaled by the root of the loss's weight
  double squared;  ///< r' r before the loss
  double cost;     ///< rho(r' r)
};

/** A factor at one estimate: r and J scaled by the root of the loss's weight, so that J' J and J' r are what
 * it adds to the normal equations (iteratively re-weighted least squares). */
struct LinearFactor : Residual {
  std::size_t i, j;   ///< j is kNoPose for a factor of one pose, and J_j then zero
  Matrix6d J_i, J_j;  ///< with zeros below, as r
};

[[nodiscard]] std::size_t firstKey(const Factor& factor);
[[nodiscard]] std::size_t secondKey(const Factor& factor);  ///< kNoPose if it has one
/** \throws std::out_of_range if a key is no pose's */
[[nodiscard]] Residual residualOf(const Factor& factor, const std::vector<Pose>& T_map_body);
/** Residual and Jacobians; those of `held` are zero. \throws std::out_of_range if a key is no pose's. */
[[nodiscard]] LinearFactor linearise(const Factor& factor, const std::vector<Pose>& T_map_body,
                                     std::optional<std::size_t> held = std::nullopt);
/** Half the sum of rho(r' r) over all factors. */
[[nodiscard]] double costOf(const PoseGraph& graph);
/** Sum of r' r over all factors, without losses: the chi-square that g2o and GTSAM print. */
[[nodiscard]] double chiSquareOf(const PoseGraph& graph);

}  // namespace raceloc
