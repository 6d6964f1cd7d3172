/** \file
 * A sweep takes 0.1 s: at 70 m/s its first point is measured 7 m away from its last. */
#pragma once

#include <vector>

#include "cloud/crop.h"
#include "core/samples.h"
#include "core/types.h"

namespace raceloc {

/** Planar motion at constant speed and yaw rate, as a pose: the chord of the arc. */
[[nodiscard]] Pose arc(double length_m, double turn_rad);

/** What a scan becomes: points in the body frame at one instant. */
struct DeskewedScan {
  double stamp_s;  ///< the instant: end of the sweep, or the scan's stamp if its points have no times
  Cloud cloud;     ///< body frame at stamp_s, cropped
};

/** End of the sweep: stamp plus the latest point time. \throws InputError naming the label if a point time is outside
 * [0, 1] s: such times are not seconds since the stamp. */
[[nodiscard]] double endOfSweep(const Scan& scan);

/** Steps of a sweep's motion: 3 ms each, and the motion within a step is taken as straight. */
inline constexpr int kSweepSteps = 32;

/** Poses of the body at equal steps over a sweep, in the frame that it has at the begin: kSweepSteps + 1, the first is the
 * identity. */
using SweepPoses = std::vector<Pose>;

/** Of a body that keeps its twist (rotation [rad/s], translation [m/s], in its own axes). */
[[nodiscard]] SweepPoses steadySweep(const Vector6d& twist, double sweep_s);

/** Moves every point into the body frame at the end of the sweep, in six degrees of freedom, by the motion at its own
 * time: p_end = T_end_t * T_body_lidar * p_lidar(t). A scan without point times is taken as it is (already
 * compensated by its source). Points outside `crop` are dropped. \throws InputError as endOfSweep() does. */
[[nodiscard]] DeskewedScan deskew(const Scan& scan, const SweepPoses& T_begin_at, const CropOptions& crop);

}  // namespace raceloc
