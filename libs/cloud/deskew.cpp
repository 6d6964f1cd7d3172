#include "cloud/deskew.h"

#include <algorithm>
#include <cmath>
#include <string>

#include "core/errors.h"

namespace raceloc {

Pose arc(double length_m, double turn_rad) {
  const double half = 0.5 * turn_rad;
  const double chord_m = length_m * (std::abs(half) < 1e-6 ? 1.0 : std::sin(half) / half);
  return poseFromRpy({chord_m * std::cos(half), chord_m * std::sin(half), 0}, 0, 0, turn_rad);
}

double endOfSweep(const Scan& scan) {
  if (scan.time_s.empty()) return scan.stamp_s;
  const auto [first, last] = std::minmax_element(scan.time_s.begin(), scan.time_s.end());
  if (!(*first >= -0.001F && *last <= 1))
    throw InputError("scan of " + scan.label + ": point times run from " + std::to_string(*first) + " to " +
                     std::to_string(*last) + " s, but they must be 0 to 1 s after the scan's stamp");
  return scan.stamp_s + *last;
}

SweepPoses steadySweep(const Vector6d& twist, double sweep_s) {
  SweepPoses poses(kSweepSteps + 1);
  for (std::size_t k = 0; k < poses.size(); ++k)
    poses[k] = se3Exp(twist * (sweep_s * static_cast<double>(k) / kSweepSteps));
  return poses;
}

DeskewedScan deskew(const Scan& scan, const SweepPoses& T_begin_at, const CropOptions& crop) {
  DeskewedScan out{endOfSweep(scan), {}};
  const bool timed = !scan.time_s.empty();
  const double sweep_s = out.stamp_s - scan.stamp_s;

  // A point's own transform lies between those of the steps around it, entry by entry.
  using Affine = Eigen::Matrix<float, 3, 4>;
  std::vector<Affine> at(timed ? kSweepSteps + 1 : 1), change(at.size(), Affine::Zero());
  for (std::size_t k = 0; k < at.size(); ++k) {
    const Pose T_end_then = timed ? T_begin_at.back().inverse() * T_begin_at[k] : Pose::Identity();
    at[k] = (T_end_then * scan.T_body_lidar).matrix().topRows<3>().cast<float>();
  }
  for (std::size_t k = 0; k + 1 < at.size(); ++k) change[k] = at[k + 1] - at[k];

  out.cloud.reserve(scan.cloud.size());
  const float steps_per_s = sweep_s > 0 ? static_cast<float>(kSweepSteps / sweep_s) : 0.0F;
  const bool with_intensity = !scan.cloud.intensity.empty();
  for (std::size_t i = 0; i < scan.cloud.size(); ++i) {
    const float step =
        timed ? std::clamp(scan.time_s[i] * steps_per_s, 0.0F, static_cast<float>(kSweepSteps)) : 0.0F;
    const auto k = static_cast<std::size_t>(step);
    const Affine T_end_lidar = at[k] + (step - static_cast<float>(k)) * change[k];
    const Eigen::Vector3f p_lidar_m = scan.cloud.point(i);
    const Eigen::Vector3f p_body_m = T_end_lidar.leftCols<3>() * p_lidar_m + T_end_lidar.col(3);
    if (!isInside(p_lidar_m, p_body_m, crop)) continue;
    if (with_intensity)
      out.cloud.push(p_body_m, scan.cloud.intensity[i]);
    else
      out.cloud.push(p_body_m);
  }
  return out;
}

}  // namespace raceloc
