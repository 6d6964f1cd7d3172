/** \file
 * The measurement model y = H x + noise that gate and filter share (H of eq_kalman_basic; reading of the
 * paper: the state is that of the measurement's own time). A source without heading keeps its third row,
 * emptied: H's row is zero, the measurement is 0 and its variance 1, which equals the smaller update exactly.
 */
#pragma once

#include <Eigen/Core>

#include "fusion/fusion_types.h"

namespace raceloc {

/** h(x) = [x y] + R(theta) p_body and theta (`body`), theta + b (`course`) or 0 (`none`), x = [x y theta b]. */
[[nodiscard]] Eigen::Vector3d predictedReading(const PoseFix& fix, const Eigen::Vector4d& x);
/** H = dh/dx, 3x4; without a lever arm the paper's constant H. */
[[nodiscard]] Eigen::Matrix<double, 3, 4> observationMatrix(const PoseFix& fix, double theta_rad);
/** What makes a fix no measurement, in words: a value that is not finite, a covariance that is not symmetric positive
 * definite, a heading without a positive sigma. Null for a sound one. */
[[nodiscard]] const char* defectOf(const PoseFix& fix);
/** y_k = [x y heading] [m, m, rad]. */
[[nodiscard]] Eigen::Vector3d readingOf(const PoseFix& fix);
/** R_k, 3x3 [m^2, rad^2]. */
[[nodiscard]] Eigen::Matrix3d noiseOf(const PoseFix& fix);
/** reading - predicted, its angle wrapped into [-pi, pi). */
[[nodiscard]] Eigen::Vector3d innovation(const Eigen::Vector3d& reading, const Eigen::Vector3d& predicted);
/** d' S^-1 d of a displacement in the plane and its covariance, positive definite. */
[[nodiscard]] double squaredMahalanobis(const Eigen::Vector2d& d, const Eigen::Matrix2d& S);

}  // namespace raceloc
