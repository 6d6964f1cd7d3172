#include "fusion/measurement.h"

#include <Eigen/LU>
#include <cmath>

#include "core/types.h"

namespace raceloc {

Eigen::Vector3d predictedReading(const PoseFix& fix, const Eigen::Vector4d& x) {
  const Eigen::Vector2d p_map_m = x.head<2>() + Eigen::Rotation2Dd(x(2)) * fix.p_body_m;
  double heading_rad = 0;
  if (fix.heading == HeadingKind::body) heading_rad = x(2);
  if (fix.heading == HeadingKind::course) heading_rad = x(2) + x(3);
  return {p_map_m.x(), p_map_m.y(), heading_rad};
}

Eigen::Matrix<double, 3, 4> observationMatrix(const PoseFix& fix, double theta_rad) {
  Eigen::Matrix<double, 3, 4> H = Eigen::Matrix<double, 3, 4>::Zero();
  H(0, 0) = H(1, 1) = 1;
  const Eigen::Vector2d lever_m = Eigen::Rotation2Dd(theta_rad) * fix.p_body_m;
  H(0, 2) = -lever_m.y();
  H(1, 2) = lever_m.x();
  if (fix.heading != HeadingKind::none) H(2, 2) = 1;
  if (fix.heading == HeadingKind::course) H(2, 3) = 1;
  return H;
}

const char* defectOf(const PoseFix& fix) {
  const Eigen::Matrix2d& C = fix.cov_p_m2;
  if (!fix.p_map_m.allFinite()) return "position is not finite";
  if (!fix.p_body_m.allFinite()) return "lever arm is not finite";
  if (!C.allFinite()) return "covariance is not finite";
  if (std::abs(C(0, 1) - C(1, 0)) > 1e-9 * std::abs(C.trace())) return "covariance is not symmetric";
  if (!(C(0, 0) > 0 && C.determinant() > 0)) return "covariance is not positive definite";
  if (fix.heading == HeadingKind::none) return nullptr;
  if (!std::isfinite(fix.heading_rad)) return "heading is not finite";
  if (!(std::isfinite(fix.heading_sigma_rad) && fix.heading_sigma_rad > 0))
    return "heading sigma is not positive";
  return nullptr;
}

Eigen::Vector3d readingOf(const PoseFix& fix) {
  return {fix.p_map_m.x(), fix.p_map_m.y(), fix.heading == HeadingKind::none ? 0.0 : fix.heading_rad};
}

Eigen::Matrix3d noiseOf(const PoseFix& fix) {
  Eigen::Matrix3d R = Eigen::Matrix3d::Zero();
  R.topLeftCorner<2, 2>() = fix.cov_p_m2;
  R(2, 2) = fix.heading == HeadingKind::none ? 1.0 : fix.heading_sigma_rad * fix.heading_sigma_rad;
  return R;
}

Eigen::Vector3d innovation(const Eigen::Vector3d& reading, const Eigen::Vector3d& predicted) {
  Eigen::Vector3d nu = reading - predicted;
  nu(2) = wrapAngle(nu(2));
  return nu;
}

double squaredMahalanobis(const Eigen::Vector2d& d, const Eigen::Matrix2d& S) {
  return S.llt().matrixL().solve(d).squaredNorm();
}

}  // namespace raceloc
