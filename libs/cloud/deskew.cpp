#include "cloud/deskew.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <string>
#include <utility>

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

namespace {

/** The motion of a sweep, from which the points of each of its scans take what they need. */
struct SweepMotion {
  double begin_s, end_s;
  const SweepPoses& T_begin_at;
};

/** Appends the points of one scan. */
void append(const Scan& scan, const SweepMotion& motion, const CropOptions& crop, bool with_intensity,
            Cloud& out) {
  const double sweep_s = motion.end_s - motion.begin_s;

  // A point's own transform lies between those of the steps around it, entry by entry.
  using Affine = Eigen::Matrix<float, 3, 4>;
  const bool moves = sweep_s > 0;
  std::vector<Affine> at(moves ? kSweepSteps + 1 : 1), change(at.size(), Affine::Zero());
  for (std::size_t k = 0; k < at.size(); ++k) {
    const Pose T_end_then =
        moves ? motion.T_begin_at.back().inverse() * motion.T_begin_at[k] : Pose::Identity();
    at[k] = (T_end_then * scan.T_body_lidar).matrix().topRows<3>().cast<float>();
  }
  for (std::size_t k = 0; k + 1 < at.size(); ++k) change[k] = at[k + 1] - at[k];

  const bool timed = !scan.time_s.empty();
  const auto begin_s = static_cast<float>(scan.stamp_s - motion.begin_s);
  const float steps_per_s = moves ? static_cast<float>(kSweepSteps / sweep_s) : 0.0F;
  for (std::size_t i = 0; i < scan.cloud.size(); ++i) {
    const float time_s = timed ? begin_s + scan.time_s[i] : begin_s;
    const float step = std::clamp(time_s * steps_per_s, 0.0F, static_cast<float>(at.size() - 1));
    const auto k = static_cast<std::size_t>(step);
    const Affine T_end_lidar = at[k] + (step - static_cast<float>(k)) * change[k];
    const Eigen::Vector3f p_lidar_m = scan.cloud.point(i);
    const Eigen::Vector3f p_body_m = T_end_lidar.leftCols<3>() * p_lidar_m + T_end_lidar.col(3);
    if (!isInside(p_lidar_m, p_body_m, crop)) continue;
    if (with_intensity)
      out.push(p_body_m, scan.cloud.intensity[i]);
    else
      out.push(p_body_m);
  }
}

bool hasIntensity(const Scan& scan) { return scan.cloud.empty() || !scan.cloud.intensity.empty(); }

}  // namespace

Sweep sweepOf(std::vector<Scan> scans) {
  Sweep sweep{std::move(scans), std::numeric_limits<double>::infinity(),
              -std::numeric_limits<double>::infinity()};
  for (const Scan& scan : sweep.scans) {
    sweep.begin_s = std::min(sweep.begin_s, scan.stamp_s);
    sweep.end_s = std::max(sweep.end_s, endOfSweep(scan));
  }
  return sweep;
}

DeskewedScan deskew(const Sweep& sweep, const SweepPoses& T_begin_at, const CropOptions& crop) {
  DeskewedScan out{sweep.end_s, {}};
  std::size_t points = 0;
  for (const Scan& scan : sweep.scans) points += scan.cloud.size();
  out.cloud.reserve(points);
  const bool with_intensity = std::all_of(sweep.scans.begin(), sweep.scans.end(), hasIntensity);
  for (const Scan& scan : sweep.scans)
    append(scan, {sweep.begin_s, sweep.end_s, T_begin_at}, crop, with_intensity, out.cloud);
  return out;
}

DeskewedScan deskew(const Scan& scan, const SweepPoses& T_begin_at, const CropOptions& crop) {
  DeskewedScan out{endOfSweep(scan), {}};
  out.cloud.reserve(scan.cloud.size());
  append(scan, {scan.stamp_s, out.stamp_s, T_begin_at}, crop, !scan.cloud.intensity.empty(), out.cloud);
  return out;
}

}  // namespace raceloc
