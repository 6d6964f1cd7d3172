#include "odometry/preintegration.h"

namespace raceloc {

namespace {

/** Right Jacobian of the exponential, by its series: exp(xi + d) = exp(xi) exp(J d). A step turns by less than 0.1 rad,
 * and the first term left out is the turn to the fourth over 120. */
Matrix6d rightJacobian(const Vector6d& xi) {
  const Matrix6d ad = smallAdjoint(xi), ad2 = ad * ad;
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
