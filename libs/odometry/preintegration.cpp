#include "odometry/preintegration.h"

namespace raceloc {

namespace {

/** Of the tangent: ad(xi) eta is the rate of exp(xi) eta exp(-xi). */
Matrix6d adOf(const Vector6d& xi) {
  const auto skew = [](const Eigen::Vector3d& v) {
    Eigen::Matrix3d S;
    S << 0, -v.z(), v.y(), v.z(), 0, -v.x(), -v.y(), v.x(), 0;
    return S;
  };
  Matrix6d ad = Matrix6d::Zero();
  ad.topLeftCorner<3, 3>() = ad.bottomRightCorner<3, 3>() = skew(xi.head<3>());
  ad.bottomLeftCorner<3, 3>() = skew(xi.tail<3>());
  return ad;
}

/** Right Jacobian of the exponential, by its series: exp(xi + d) = exp(xi) exp(J d). A step turns by less than 0.1 rad,
 * and the first term left out is the turn to the fourth over 120. */
Matrix6d rightJacobian(const Vector6d& xi) {
  const Matrix6d ad = adOf(xi), ad2 = ad * ad;
  return Matrix6d::Identity() - ad / 2 + ad2 / 6 - ad2 * ad / 24;
}

}  // namespace

void Preintegration::append(const BodyRates& rates, double step_s) {
  const Vector6d xi = rates.twist * step_s;
  const Pose T_step = se3Exp(xi);
  const Matrix6d back = adjoint(T_step.inverse()), J = rightJacobian(xi);
  duration_s += step_s;
  T_start_end = T_start_end * T_step;
  covariance =
      back * covariance * back.transpose() + J * (rates.noise_density * step_s).asDiagonal() * J.transpose();
  J_calibration = back * J_calibration + J * rates.J_calibration * step_s;
}

}  // namespace raceloc
