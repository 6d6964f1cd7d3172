#include "cloud/deskew.h"

#include <raceloc/gpu/prepare.h>

#include <algorithm>
#include <cmath>
#include <iterator>
#include <limits>
#include <string>
#include <utility>

#include "cloud/voxel_grid.h"
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

/** What the kernel takes of one scan of a sweep. */
struct ScanMotion {
  std::vector<gpu::Affine> T_end_lidar;
  std::vector<float> since_begin_s;  ///< of the sweep; empty where the scan's own times serve
  float duration_s = 0;

  ScanMotion(const Scan& scan, const Sweep& sweep, const SweepPoses& T_begin_at) {
    const double sweep_s = sweep.end_s - sweep.begin_s;
    const auto begin_s = static_cast<float>(scan.stamp_s - sweep.begin_s);
    const Pose T_end_begin = sweep_s > 0 ? T_begin_at.back().inverse() : Pose::Identity();
    const auto at = [&](const Pose& T_begin_then) {
      gpu::Affine rows{};
      Eigen::Map<Eigen::Matrix<float, 3, 4, Eigen::RowMajor>>(rows.data()) =
          (T_end_begin * T_begin_then * scan.T_body_lidar).matrix().topRows<3>().cast<float>();
      return rows;
    };
    if (!(sweep_s > 0)) {
      T_end_lidar = {at(Pose::Identity())};
      return;
    }
    std::transform(T_begin_at.begin(), T_begin_at.end(), std::back_inserter(T_end_lidar), at);
    duration_s = static_cast<float>(sweep_s);
    if (scan.time_s.empty())
      since_begin_s.assign(scan.cloud.size(), begin_s);
    else if (begin_s > 0)
      std::transform(scan.time_s.begin(), scan.time_s.end(), std::back_inserter(since_begin_s),
                     [begin_s](float time_s) { return begin_s + time_s; });
  }
  [[nodiscard]] gpu::SweepView view() const { return {T_end_lidar.data(), T_end_lidar.size(), duration_s}; }
  [[nodiscard]] const float* times(const Scan& scan) const {
    if (duration_s == 0) return nullptr;
    return since_begin_s.empty() ? scan.time_s.data() : since_begin_s.data();
  }
};

bool hasIntensity(const Scan& scan) { return scan.cloud.empty() || !scan.cloud.intensity.empty(); }

/** Appends what is left of a scan, with the intensities that its points had. */
void append(const gpu::Deskewed& kept, const Scan& scan, bool with_intensity, Cloud& out) {
  const auto extend = [](std::vector<float>& whole, const std::vector<float>& part) {
    whole.insert(whole.end(), part.begin(), part.end());
  };
  extend(out.x, kept.points.x);
  extend(out.y, kept.points.y);
  extend(out.z, kept.points.z);
  if (!with_intensity) return;
  for (const std::uint32_t i : kept.indices) out.intensity.push_back(scan.cloud.intensity[i]);
}

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

DeskewedScan deskew(gpu::Context& context, const Sweep& sweep, const SweepPoses& T_begin_at,
                    const CropOptions& crop) {
  DeskewedScan out{sweep.end_s, {}};
  const bool with_intensity = std::all_of(sweep.scans.begin(), sweep.scans.end(), hasIntensity);
  for (const Scan& scan : sweep.scans) {
    const ScanMotion motion(scan, sweep, T_begin_at);
    append(gpu::deskew(context, viewOf(scan.cloud), motion.times(scan), motion.view(), crop.forKernels()),
           scan, with_intensity, out.cloud);
  }
  return out;
}

CovarianceCloud prepare(gpu::Context& context, const Sweep& sweep, const SweepPoses& T_begin_at,
                        const CropOptions& crop, double voxel_size_m, const CovarianceOptions& covariance,
                        Cloud* full) {
  if (sweep.scans.size() != 1) {
    Cloud cloud = deskew(context, sweep, T_begin_at, crop).cloud;
    CovarianceCloud prepared = withCovariances(context, voxelGrid(context, cloud, voxel_size_m), covariance);
    if (full != nullptr) *full = std::move(cloud);
    return prepared;
  }
  const Scan& scan = sweep.scans.front();
  const ScanMotion motion(scan, sweep, T_begin_at);
  gpu::Deskewed kept;
  auto prepared = gpu::prepare(context, viewOf(scan.cloud), motion.times(scan), motion.view(),
                               crop.forKernels(), static_cast<float>(voxel_size_m), covariance.forKernels(),
                               full == nullptr ? nullptr : &kept);
  if (full != nullptr) {
    *full = {};
    append(kept, scan, !scan.cloud.intensity.empty(), *full);
  }
  return {{std::move(prepared.points.x), std::move(prepared.points.y), std::move(prepared.points.z), {}},
          std::move(prepared.covariances)};
}

}  // namespace raceloc
