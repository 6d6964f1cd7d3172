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

DeskewedScan deskew(const Scan& scan, double speed_mps, double yaw_rate_rps, const CropOptions& crop) {
  DeskewedScan out{endOfSweep(scan), {}};
  const double sweep_s = out.stamp_s - scan.stamp_s;

  // The pose changes little from point to point: 256 steps over the sweep are 0.4 ms each, 3 cm at 70 m/s,
  // and a linear step inside each would not be seen.
  constexpr int kSteps = 256;
  std::vector<Eigen::Isometry3f> T_end_lidar(scan.time_s.empty() ? 1 : kSteps + 1);
  for (std::size_t k = 0; k < T_end_lidar.size(); ++k) {
    const double before_end_s = sweep_s * (1 - static_cast<double>(k) / kSteps);
    const Pose T_then_end = arc(speed_mps * before_end_s, yaw_rate_rps * before_end_s);
    T_end_lidar[k] = (T_then_end.inverse() * scan.T_body_lidar).cast<float>();
  }

  out.cloud.reserve(scan.cloud.size());
  const float steps_per_s = sweep_s > 0 ? static_cast<float>(kSteps / sweep_s) : 0.0F;
  const bool with_intensity = !scan.cloud.intensity.empty();
  for (std::size_t i = 0; i < scan.cloud.size(); ++i) {
    const auto k = scan.time_s.empty() ? std::size_t{0}
                                       : static_cast<std::size_t>(std::clamp(
                                             std::lround(scan.time_s[i] * steps_per_s), 0L, long{kSteps}));
    const Eigen::Vector3f p_lidar_m = scan.cloud.point(i);
    const Eigen::Vector3f p_body_m = T_end_lidar[k] * p_lidar_m;
    if (!isInside(p_lidar_m, p_body_m, crop)) continue;
    if (with_intensity)
      out.cloud.push(p_body_m, scan.cloud.intensity[i]);
    else
      out.cloud.push(p_body_m);
  }
  return out;
}

}  // namespace raceloc
