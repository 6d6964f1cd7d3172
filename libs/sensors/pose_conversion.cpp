#include "sensors/pose_conversion.h"

#include <mrpt/poses/CPose3D.h>

#include <Eigen/LU>
#include <cmath>

namespace raceloc {

mrpt::poses::CPose3D toMrpt(const Pose& pose) {
  return mrpt::poses::CPose3D(mrpt::math::CMatrixDouble44(pose.matrix()));
}

Pose fromMrpt(const mrpt::poses::CPose3D& pose) {
  Pose T = Pose::Identity();
  T.linear() = pose.getRotationMatrix().asEigen();
  T.translation() << pose.x(), pose.y(), pose.z();
  return T;
}

namespace {

/** d(theta, rho) / d(x, y, z, yaw, pitch, roll) at T_map_body, for R = Rz(yaw) Ry(pitch) Rx(roll). */
Matrix6d incrementByCoordinates(const Pose& T_map_body) {
  const Eigen::Matrix3d R = T_map_body.linear();
  const double roll_rad = std::atan2(R(2, 1), R(2, 2));
  Matrix6d J = Matrix6d::Zero();
  J.block<3, 3>(3, 0) = R.transpose();
  J.block<3, 1>(0, 3) = R.row(2).transpose();  // yaw turns about the map's z, seen from the body
  J.block<3, 1>(0, 4) << 0, std::cos(roll_rad), -std::sin(roll_rad);
  J.block<3, 1>(0, 5) << 1, 0, 0;
  return J;
}

}  // namespace

Matrix6d covarianceToMrpt(const Pose& T_map_body, const Matrix6d& covariance) {
  const Matrix6d J = incrementByCoordinates(T_map_body).inverse();
  const Matrix6d result = J * covariance * J.transpose();
  return 0.5 * (result + result.transpose());
}

Matrix6d covarianceFromMrpt(const Pose& T_map_body, const Matrix6d& covariance_xyz_ypr) {
  const Matrix6d J = incrementByCoordinates(T_map_body);
  const Matrix6d result = J * covariance_xyz_ypr * J.transpose();
  return 0.5 * (result + result.transpose());
}

}  // namespace raceloc
