/** \file
 * The values that every room of the house speaks in. Frames: `map` (ENU metres about a geodetic
 * origin), `body` (centre of the rear axle, x forward, y left, z up), `lidar`, `antenna`.
 * `T_map_body` maps body coordinates into the map frame. SI units and radians. */
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <cmath>
#include <cstddef>
#include <vector>

namespace raceloc {

using Pose = Eigen::Isometry3d;
using Vector6d = Eigen::Matrix<double, 6, 1>;
using Matrix6d = Eigen::Matrix<double, 6, 6>;  ///< tangent order: rotation [rad], then translation [m]

/** Geodetic position on WGS84; as the origin of a map it is what makes the map georeferenced. */
struct GeodeticPoint {
  double latitude_deg;
  double longitude_deg;
  double height_m;  ///< above the ellipsoid
};

/** Points as a structure of arrays, the layout that the kernels read: no copy on the way to them.
 * The frame is the owner's to name. All arrays have one length, but `intensity` may be empty. */
struct Cloud {
  std::vector<float> x;          ///< [m]
  std::vector<float> y;          ///< [m]
  std::vector<float> z;          ///< [m]
  std::vector<float> intensity;  ///< 0..1, or empty

  [[nodiscard]] std::size_t size() const { return x.size(); }
  [[nodiscard]] bool empty() const { return x.empty(); }
  [[nodiscard]] Eigen::Vector3f point(std::size_t i) const { return {x[i], y[i], z[i]}; }

  void reserve(std::size_t n);
  void clear();                                            ///< its memory is kept
  void push(const Eigen::Vector3f& p_m);                   ///< for clouds without intensity
  void push(const Eigen::Vector3f& p_m, float intensity);  ///< for clouds with it
};

/** Motion of the body over an interval, from dead reckoning. */
struct BodyMotion {
  double duration_s = 0;
  Pose T_start_end = Pose::Identity();
  Matrix6d covariance = Matrix6d::Zero();  ///< of the end pose, right increment (rad, m)
};

/** One motion after another: T_start_end, duration and covariance (eq. of propagation: Ad(T^-1) C Ad(T^-1)' +
 * C). */
[[nodiscard]] BodyMotion then(const BodyMotion& first, const BodyMotion& second);

/** \name SE(3) with right increments: T * exp(xi). Source: Sola et al., arXiv:1812.01537, Eq. (25), (172).
 * @{ */
[[nodiscard]] Pose se3Exp(const Vector6d& rotation_translation);  ///< full exponential, translation through V
[[nodiscard]] Vector6d se3Log(const Pose& pose);                  ///< its inverse, rotation angle in [0, pi]
[[nodiscard]] Matrix6d adjoint(const Pose& pose);         ///< T exp(xi) T^-1 = exp(Ad(T) xi), Eq. (175)
[[nodiscard]] Matrix6d smallAdjoint(const Vector6d& xi);  ///< ad(xi), Ad(exp(xi)) = exp(ad(xi))
/** @} */

[[nodiscard]] Eigen::Matrix3d skew(const Eigen::Vector3d& v);  ///< skew(v) w = v x w

constexpr double kDegree = M_PI / 180;             ///< one degree [rad]
constexpr double kGravity_mps2 = 9.80665;          ///< standard gravity
[[nodiscard]] double wrapAngle(double angle_rad);  ///< into [-pi, pi)
[[nodiscard]] double yawOf(const Pose& pose);      ///< [rad], 0 = east, counter-clockwise
[[nodiscard]] Pose poseFromRpy(const Eigen::Vector3d& p_m, double roll_rad, double pitch_rad,
                               double yaw_rad);  ///< R = Rz Ry Rx
[[nodiscard]] Cloud transformed(const Cloud& cloud, const Pose& T_to_from);

}  // namespace raceloc
