/** \file
 * LiDAR odometry with the car's own motion as first guess: scan against a local map of voxel Gaussians. */
#pragma once

#include <raceloc/gpu/voxel_map.h>

#include <optional>
#include <utility>

#include "cloud/crop.h"
#include "cloud/deskew.h"
#include "odometry/levelling.h"
#include "odometry/motion_history.h"
#include "registration/align.h"

namespace raceloc {

/** Section [odometry]. */
struct OdometryOptions {
  double scan_voxel_m = 0.5;
  double local_map_radius_m = 120;
  double key_scan_m = 1;
  double first_step_m = 8;
  double covariance_scale = 10;
  double min_sigma_m = 0.01;
  double min_sigma_deg = 0.01;
  void describe(OptionList& keys);
};

/** What one scan gave. */
struct OdometryStep {
  double stamp_s;         ///< end of the sweep
  Pose T_odom_body;       ///< `odom`: the body's frame at the first scan
  BodyMotion since_last;  ///< measured motion since the scan before; zero duration at the first scan
  std::optional<BodyMotion> predicted;  ///< the same by gyro and wheels alone; none while they are silent
  Registration match;  ///< against the local map; at the first scan of a track: identity, nothing matched
  bool trusted;        ///< false: the pose is dead reckoning alone
  bool restarted;      ///< the local map was given up and begun anew with this scan
  bool
      by_wheels;  ///< guess and de-skew by wheel speed; false: by the speed of the last match and the gyro, or by
                  ///< the motion between the last scans
  std::optional<Level> level;  ///< roll and pitch against gravity; none without an accelerometer
  CovarianceCloud scan;        ///< body frame at stamp_s, de-skewed, cropped, thinned
  Cloud full_scan;             ///< body frame at stamp_s, de-skewed and cropped, not thinned
};

class LivOdometry {
 public:
  /** \param gicp  but for covariance_scale, min_sigma_m and min_sigma_deg, which `options` has for the local map */
  LivOdometry(gpu::Context& context, const OdometryOptions& options, const CropOptions& crop,
              const CovarianceOptions& covariance, const GicpOptions& gicp, const LevelOptions& level = {});

  /** The next sweep, which ends later than the one before. `history` must reach to its end to be of use; without it
   * the motion between the last two sweeps goes on. What is matched calibrates it.
   * \return good until the next call, which uses its memory again: so nothing is allocated once the largest sweep was
   *         seen and the local map is full; its clouds may be moved away
   * \throws std::invalid_argument if the end is not later than the last one's. */
  OdometryStep& add(const Sweep& sweep, MotionHistory& history);

 private:
  /** The scan in the local map, from a guess. */
  [[nodiscard]] Registration matched(const CovarianceCloud& scan, const Pose& T_guess, bool predicted) const;
  void extendMap(const OdometryStep& step, bool reckoned);

  gpu::Context& x_context;
  OdometryOptions x_options;
  GicpOptions x_gicp;
  SweepPreparer x_preparer;
  Levelling x_levelling;
  gpu::VoxelMap x_local_map;
  std::optional<double> x_last_stamp_s;
  Pose x_T_odom_body = Pose::Identity();
  BodyMotion x_last_motion;
  std::optional<Eigen::Vector3d> x_last_key_m;  ///< where a scan last went into the local map
  bool x_ever_matched = false;
  int x_lost_in_a_row = 0;
  std::optional<OdometryStep> x_step;  ///< the newest
};

}  // namespace raceloc
