/** \file
 * A sweep takes 0.1 s: at 70 m/s its first point is measured 7 m away from its last. */
#pragma once

#include <array>
#include <vector>

#include "cloud/covariances.h"
#include "cloud/crop.h"
#include "core/samples.h"
#include "core/types.h"

namespace raceloc {

/** Planar motion at constant speed and yaw rate, as a pose: the chord of the arc. */
[[nodiscard]] Pose arc(double length_m, double turn_rad);

/** What is matched at once: a scan, or those of several LiDARs that end close together. */
struct Sweep {
  std::vector<Scan> scans;  ///< one or more, of different labels
  double begin_s, end_s;    ///< earliest begin, latest end
};

/** What a sweep becomes: points in the body frame at one instant. */
struct DeskewedScan {
  double stamp_s;  ///< the instant: end of the sweep, or the scan's stamp if its points have no times
  Cloud cloud;     ///< body frame at stamp_s, cropped; with intensities if all scans have them
};

/** End of the sweep: stamp plus the latest point time. \throws InputError naming the label if a point time is outside
 * [0, 1] s: such times are not seconds since the stamp. */
[[nodiscard]] double endOfSweep(const Scan& scan);

/** \param scans one or more \throws InputError as endOfSweep() does. */
[[nodiscard]] Sweep sweepOf(std::vector<Scan> scans);

/** Steps of a sweep's motion, taken as straight within a step. At 10 Hz: 3 ms each for one LiDAR, 5 ms for three in
 * turn, up to 13 ms with a late one. */
inline constexpr int kSweepSteps = 32;

/** Poses of the body at equal steps over a sweep, in the frame that it has at the begin: kSweepSteps + 1, the first
 * is the identity. */
using SweepPoses = std::array<Pose, kSweepSteps + 1>;

/** Of a body that keeps its twist (rotation [rad/s], translation [m/s], in its own axes). */
[[nodiscard]] SweepPoses steadySweep(const Vector6d& twist, double sweep_s);

/** Moves every point of every scan into the body frame at the end of the sweep, in six degrees of freedom, by its
 * LiDAR's place on the car and the motion at its own time: p_end = T_end_t * T_body_lidar * p_lidar(t). The end is
 * the latest of all scans: the newest instant at which the motion is known, so that a pose is not older than it must
 * be. A scan without point times is of one instant, its stamp, and alone it is taken as it is (already compensated by
 * its source). Points outside `crop` are dropped. */
[[nodiscard]] DeskewedScan deskew(gpu::Context& context, const Sweep& sweep, const SweepPoses& T_begin_at,
                                  const CropOptions& crop);

/** What de-skewing works in; memory kept from sweep to sweep. */
struct DeskewBuffers {
  std::vector<float> since_begin_s;
  gpu::Deskewed kept;
};

/** Makes the sweeps of a drive ready for a match: de-skewed, cropped, one point a voxel, with covariances; body frame
 * at their end. The scan of one LiDAR stays on the device from step to step. Allocates nothing once it has seen the
 * largest sweep, if it is given the memory of what it made before. */
class SweepPreparer {
 public:
  SweepPreparer(gpu::Context& context, const CropOptions& crop, double voxel_size_m,
                const CovarianceOptions& covariance)
      : x_context(context), x_crop(crop), x_voxel_size_m(voxel_size_m), x_covariance(covariance) {}

  /** \param full  may be null; else it takes what deskew() gives
   * \param into  what is no longer needed: its memory is used again, as that of `full` */
  [[nodiscard]] CovarianceCloud prepare(const Sweep& sweep, const SweepPoses& T_begin_at,
                                        Cloud* full = nullptr, CovarianceCloud into = {});

 private:
  gpu::Context& x_context;
  CropOptions x_crop;
  double x_voxel_size_m;
  CovarianceOptions x_covariance;
  DeskewBuffers x_buffers;
  Cloud x_merged;  ///< of several LiDARs, where nobody takes it
};

}  // namespace raceloc
