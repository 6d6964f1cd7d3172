#include "core/types.h"

#include <cmath>

namespace raceloc {

void Cloud::reserve(std::size_t n) {
  x.reserve(n);
  y.reserve(n);
  z.reserve(n);
}

void Cloud::clear() {
  for (auto* values : {&x, &y, &z, &intensity}) values->clear();
}

void Cloud::push(const Eigen::Vector3f& p_m) {
  x.push_back(p_m.x());
  y.push_back(p_m.y());
  z.push_back(p_m.z());
}

void Cloud::push(const Eigen::Vector3f& p_m, float intensity_share) {
  push(p_m);
  intensity.push_back(intensity_share);
}

Eigen::Matrix3d skew(const Eigen::Vector3d& v) {
  Eigen::Matrix3d m;
  m << 0, -v.z(), v.y(), v.z(), 0, -v.x(), -v.y(), v.x(), 0;
  return m;
}

namespace {

/** V of Eq. (174): the translation of exp is V(theta) * rho. */
Eigen::Matrix3d leftJacobian(const Eigen::Vector3d& theta) {
  const double angle = theta.norm();
  const Eigen::Matrix3d W = skew(theta);
  if (angle < 1e-5) return Eigen::Matrix3d::Identity() + 0.5 * W + W * W / 6.0;
  const double a2 = angle * angle;
  return Eigen::Matrix3d::Identity() + (1 - std::cos(angle)) / a2 * W +
         (angle - std::sin(angle)) / (a2 * angle) * W * W;
}

}  // namespace

Pose se3Exp(const Vector6d& xi) {
  const Eigen::Vector3d theta = xi.head<3>();
  const double angle = theta.norm();
  Pose T = Pose::Identity();
  if (angle > 0) T.linear() = Eigen::AngleAxisd(angle, theta / angle).toRotationMatrix();
  T.translation() = leftJacobian(theta) * xi.tail<3>();
  return T;
}

Vector6d se3Log(const Pose& pose) {
  const Eigen::AngleAxisd rotation(pose.linear());
  Vector6d xi;
  xi.head<3>() = rotation.angle() * rotation.axis();
  xi.tail<3>() = leftJacobian(xi.head<3>()).inverse() * pose.translation();
  return xi;
}

Matrix6d adjoint(const Pose& pose) {
  Matrix6d ad = Matrix6d::Zero();
  ad.topLeftCorner<3, 3>() = pose.linear();
  ad.bottomRightCorner<3, 3>() = pose.linear();
  ad.bottomLeftCorner<3, 3>() = skew(pose.translation()) * pose.linear();
  return ad;
}

Matrix6d smallAdjoint(const Vector6d& xi) {
  Matrix6d ad = Matrix6d::Zero();
  ad.topLeftCorner<3, 3>() = skew(xi.head<3>());
  ad.bottomRightCorner<3, 3>() = skew(xi.head<3>());
  ad.bottomLeftCorner<3, 3>() = skew(xi.tail<3>());
  return ad;
}

BodyMotion then(const BodyMotion& first, const BodyMotion& second) {
  const Matrix6d ad = adjoint(second.T_start_end.inverse());
  return {first.duration_s + second.duration_s, first.T_start_end * second.T_start_end,
          ad * first.covariance * ad.transpose() + second.covariance};
}

double wrapAngle(double angle_rad) {
  const double wrapped_rad = std::remainder(angle_rad, 2 * M_PI);
  return wrapped_rad >= M_PI ? -M_PI : wrapped_rad;
}

double yawOf(const Pose& pose) { return std::atan2(pose.linear()(1, 0), pose.linear()(0, 0)); }

Pose poseFromRpy(const Eigen::Vector3d& p_m, double roll_rad, double pitch_rad, double yaw_rad) {
  Pose T = Pose::Identity();
  T.linear() = (Eigen::AngleAxisd(yaw_rad, Eigen::Vector3d::UnitZ()) *
                Eigen::AngleAxisd(pitch_rad, Eigen::Vector3d::UnitY()) *
                Eigen::AngleAxisd(roll_rad, Eigen::Vector3d::UnitX()))
                   .toRotationMatrix();
  T.translation() = p_m;
  return T;
}

Cloud transformed(const Cloud& cloud, const Pose& T_to_from) {
  const Eigen::Isometry3f T = T_to_from.cast<float>();
  Cloud out;
  out.reserve(cloud.size());
  for (std::size_t i = 0; i < cloud.size(); ++i) out.push(T * cloud.point(i));
  out.intensity = cloud.intensity;
  return out;
}

}  // namespace raceloc
