#include "cloud/deskew.h"

#include <raceloc/gpu/prepare.h>

#include <algorithm>
#include <cmath>
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
  SweepPoses poses;
  for (std::size_t k = 0; k < poses.size(); ++k)
    poses[k] = se3Exp(twist * (sweep_s * static_cast<double>(k) / kSweepSteps));
  return poses;
}

namespace {

/** What the kernel takes of one scan of a sweep. */
class ScanMotion {
 public:
  /** \param since_begin_s  the times since the sweep's begin, where the scan's own do not serve; must outlive this */
  ScanMotion(const Scan& scan, const Sweep& sweep, const SweepPoses& T_begin_at,
             std::vector<float>& since_begin_s) {
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
      x_T_end_lidar[0] = at(Pose::Identity());
      return;
    }
    std::transform(T_begin_at.begin(), T_begin_at.end(), x_T_end_lidar.begin(), at);
    x_view = {x_T_end_lidar.data(), x_T_end_lidar.size(), static_cast<float>(sweep_s)};
    since_begin_s = scan.time_s;
    if (scan.time_s.empty())
      since_begin_s.assign(scan.cloud.size(), begin_s);
    else
      for (float& time_s : since_begin_s) time_s += begin_s;
    x_times_s = since_begin_s.data();
  }
  ScanMotion(const ScanMotion&) = delete;  // the view is of itself
  ScanMotion& operator=(const ScanMotion&) = delete;

  [[nodiscard]] const gpu::SweepView& view() const { return x_view; }
  [[nodiscard]] const float* times_s() const { return x_times_s; }

 private:
  std::array<gpu::Affine, kSweepSteps + 1> x_T_end_lidar;
  gpu::SweepView x_view{x_T_end_lidar.data(), 1, 0};
  const float* x_times_s = nullptr;
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

/** What deskew() does, in memory that is kept. */
void deskewInto(Cloud& out, gpu::Context& context, const Sweep& sweep, const SweepPoses& T_begin_at,
                const CropOptions& crop, DeskewBuffers& buffers) {
  out.clear();
  const bool with_intensity = std::all_of(sweep.scans.begin(), sweep.scans.end(), hasIntensity);
  for (const Scan& scan : sweep.scans) {
    const ScanMotion motion(scan, sweep, T_begin_at, buffers.since_begin_s);
    buffers.kept = gpu::deskew(context, viewOf(scan.cloud), motion.times_s(), motion.view(),
                               crop.forKernels(), std::move(buffers.kept));
    append(buffers.kept, scan, with_intensity, out);
  }
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
  DeskewBuffers buffers;
  deskewInto(out.cloud, context, sweep, T_begin_at, crop, buffers);
  return out;
}

CovarianceCloud SweepPreparer::prepare(const Sweep& sweep, const SweepPoses& T_begin_at, Cloud* full,
                                       CovarianceCloud into) {
  if (sweep.scans.size() != 1) {
    Cloud& merged = full == nullptr ? x_merged : *full;
    deskewInto(merged, x_context, sweep, T_begin_at, x_crop, x_buffers);
    return withCovariances(x_context, voxelGrid(x_context, merged, x_voxel_size_m, std::move(into.cloud)),
                           x_covariance, std::move(into.covariances));
  }
  const Scan& scan = sweep.scans.front();
  const ScanMotion motion(scan, sweep, T_begin_at, x_buffers.since_begin_s);
  auto prepared = gpu::prepare(x_context, viewOf(scan.cloud), motion.times_s(), motion.view(),
                               x_crop.forKernels(), static_cast<float>(x_voxel_size_m),
                               x_covariance.forKernels(), full == nullptr ? nullptr : &x_buffers.kept,
                               {{std::move(into.cloud.x), std::move(into.cloud.y), std::move(into.cloud.z)},
                                std::move(into.covariances)});
  if (full != nullptr) {
    full->clear();
    append(x_buffers.kept, scan, !scan.cloud.intensity.empty(), *full);
  }
  return {{std::move(prepared.points.x), std::move(prepared.points.y), std::move(prepared.points.z), {}},
          std::move(prepared.covariances)};
}

}  // namespace raceloc
