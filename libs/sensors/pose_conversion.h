/** \file
 * Poses at the border to MRPT, and the two ways to write a pose's covariance.
 *
 * Ours is of a right increment xi = (theta, rho), T = T_mean * exp(xi). MRPT's is of the six coordinates
 * (x, y, z, yaw, pitch, roll). To first order in the increment, and exactly in the attitude of the mean,
 *   theta = E(roll, pitch) * (dyaw, dpitch, droll),   rho = R_mean^T * (dx, dy, dz),
 * so each covariance is the other's under a 6x6 Jacobian. First order is enough while the standard deviations
 * of the angles stay below some degrees; the relation is singular at a pitch of +-90 deg, where no car
 * drives. */
#pragma once

#include "core/types.h"

namespace mrpt::poses {
class CPose3D;
}

namespace raceloc {

[[nodiscard]] mrpt::poses::CPose3D toMrpt(const Pose& pose);
[[nodiscard]] Pose fromMrpt(const mrpt::poses::CPose3D& pose);

/** Covariance of (x, y, z, yaw, pitch, roll) from that of the right increment at `T_map_body`. */
[[nodiscard]] Matrix6d covarianceToMrpt(const Pose& T_map_body, const Matrix6d& covariance);
/** Inverse of covarianceToMrpt(). */
[[nodiscard]] Matrix6d covarianceFromMrpt(const Pose& T_map_body, const Matrix6d& covariance_xyz_ypr);

}  // namespace raceloc
