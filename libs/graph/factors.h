/** \file
 * Residuals of the pose graph, for Ceres' automatic derivatives. A pose is two blocks: quaternion (Eigen's
 * order x y z w) and translation. */
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>

#include "core/types.h"

namespace raceloc {

/** Twice the vector part of q, signed so that q and -q agree: the rotation vector for small angles. */
template <class T>
Eigen::Matrix<T, 3, 1> smallRotation(const Eigen::Quaternion<T>& q) {
  return (q.w() < T(0) ? T(-2) : T(2)) * q.vec();
}

/** Odometry between key poses i and j: rotation and translation of T_ij^-1 * T_i^-1 * T_j, whitened. */
struct BetweenFactor {
  Pose T_i_j;
  Matrix6d whitening;  ///< upper Cholesky factor of the information (rotation, translation)

  template <class T>
  bool operator()(const T* q_i, const T* p_i, const T* q_j, const T* p_j, T* residual) const {
    const Eigen::Map<const Eigen::Quaternion<T>> Q_i(q_i), Q_j(q_j);
    const Eigen::Map<const Eigen::Matrix<T, 3, 1>> P_i(p_i), P_j(p_j);
    const Eigen::Quaternion<T> measured(Eigen::Quaterniond(T_i_j.linear()).cast<T>());
    const Eigen::Quaternion<T> turned = Q_i.conjugate() * Q_j;
    Eigen::Matrix<T, 6, 1> error;
    error.template head<3>() = smallRotation<T>(measured.conjugate() * turned);
    error.template tail<3>() =
        measured.conjugate() * (Q_i.conjugate() * (P_j - P_i) - T_i_j.translation().cast<T>());
    Eigen::Map<Eigen::Matrix<T, 6, 1>> r(residual);
    r = whitening.cast<T>() * error;
    return true;
  }
};

/** Antenna position: p + R r - z, whitened. */
struct GpsFactor {
  Eigen::Vector3d z_map_m, p_body_antenna_m;
  Eigen::Matrix3d whitening;

  template <class T>
  bool operator()(const T* q, const T* p, T* residual) const {
    const Eigen::Map<const Eigen::Quaternion<T>> Q(q);
    const Eigen::Map<const Eigen::Matrix<T, 3, 1>> P(p);
    Eigen::Map<Eigen::Matrix<T, 3, 1>> r(residual);
    r = whitening.cast<T>() * (P + Q * p_body_antenna_m.cast<T>() - z_map_m.cast<T>());
    return true;
  }
};

/** Attitude: rotation vector of R_ins' R, whitened. */
struct AttitudeFactor {
  Eigen::Quaterniond q_map_body;
  Eigen::Matrix3d whitening;

  template <class T>
  bool operator()(const T* q, T* residual) const {
    const Eigen::Map<const Eigen::Quaternion<T>> Q(q);
    Eigen::Map<Eigen::Matrix<T, 3, 1>> r(residual);
    r = whitening.cast<T>() * smallRotation<T>(q_map_body.cast<T>().conjugate() * Q);
    return true;
  }
};

/** Roll and pitch near zero: the body's z axis near the map's. */
struct LevelFactor {
  double sigma_rad;

  template <class T>
  bool operator()(const T* q, T* residual) const {
    const Eigen::Map<const Eigen::Quaternion<T>> Q(q);
    const Eigen::Matrix<T, 3, 1> up = Q * Eigen::Matrix<T, 3, 1>(T(0), T(0), T(1));
    residual[0] = up.x() / T(sigma_rad);
    residual[1] = up.y() / T(sigma_rad);
    return true;
  }
};

}  // namespace raceloc
