/** \file
 * A point of a sweep into the frame of its end, and whether it is kept. No product is contracted with a sum: a GPU
 * keeps the same points as the CPU, to the bit. */
#pragma once

#include <algorithm>
#include <cfloat>
#include <cmath>
#include <cstdint>

#include "core/linear.hpp"
#include "raceloc/gpu/types.h"

namespace raceloc::gpu {

/** Entries of an affine transform, the rows of [A | t] one after another. */
inline constexpr int kAffine = 12;

/** The transform at a step of the sweep, and by how much it changes until the next one. */
struct alignas(16) SweepStep {
  float at[kAffine], change[kAffine];
};

/** Crop as it is compared. */
struct CropSetup {
  float squared_min_range_m2, squared_max_range_m2;  ///< both finite: what is not finite is out of range
  float own_car_front_m, own_car_rear_m, own_car_half_width_m;
};

struct DeskewJob {
  PointsView scan;
  const float* time_s;  ///< null: all 0
  const SweepStep* steps;
  std::size_t step_count;  ///< >= 1
  float steps_per_s;
  CropSetup crop;
};

/** Where kept points go. */
struct DeskewedOut {
  float *x, *y, *z;
  std::uint32_t* index;  ///< in the scan
};

/** Steps since the begin of the sweep, in [0, step_count - 1]. */
template <class T>
RACELOC_HD T stepsUntil(const T& time_s, float steps_per_s, float last) {
  const T steps = product(time_s, T(steps_per_s));
  const T begun = select(steps > T(0), steps, T(0));  // NaN too
  return select(begun < T(last), begun, T(last));
}

/** Row `r` of a step's transform, `share` of the way to the next one, times (p, 1). */
template <class T>
RACELOC_HD T rowBetween(const SweepStep& step, std::size_t r, const T& share, const Vec3<T>& p) {
  const float *at = step.at + 4 * r, *change = step.change + 4 * r;
  return product(T(at[0]) + product(share, T(change[0])), p.x) +
         product(T(at[1]) + product(share, T(change[1])), p.y) +
         product(T(at[2]) + product(share, T(change[2])), p.z) + (T(at[3]) + product(share, T(change[3])));
}

template <class T>
RACELOC_HD Vec3<T> movedBetween(const SweepStep& step, const T& share, const Vec3<T>& p) {
  return {rowBetween(step, 0, share, p), rowBetween(step, 1, share, p), rowBetween(step, 2, share, p)};
}

/** \param p_end  the point in the frame of the end */
template <class T>
RACELOC_HD auto isKept(const CropSetup& crop, const Vec3<T>& p_lidar, const T& time_s, const Vec3<T>& p_end) {
  const T squared_m2 =
      product(p_lidar.x, p_lidar.x) + product(p_lidar.y, p_lidar.y) + product(p_lidar.z, p_lidar.z);
  const auto in_range =
      (squared_m2 >= T(crop.squared_min_range_m2)) & (squared_m2 <= T(crop.squared_max_range_m2));
  const auto off_the_car = (p_end.x <= T(-crop.own_car_rear_m)) | (p_end.x >= T(crop.own_car_front_m)) |
                           (absolute(p_end.y) >= T(crop.own_car_half_width_m));
  return in_range & off_the_car & (absolute(time_s) <= T(FLT_MAX));
}

/** The i-th point in the frame of the end. \return whether it is kept */
RACELOC_HD bool deskewed(const DeskewJob& job, std::size_t i, Vec3<float>& p_end) {
  const Vec3<float> p{job.scan.x[i], job.scan.y[i], job.scan.z[i]};
  const float time_s = job.time_s == nullptr ? 0.0F : job.time_s[i];
  const float steps = stepsUntil(time_s, job.steps_per_s, static_cast<float>(job.step_count - 1));
  const auto whole = static_cast<std::int32_t>(steps);
  const float share = steps - static_cast<float>(whole);
  p_end = movedBetween(job.steps[whole], share, p);
  return isKept(job.crop, p, time_s, p_end) != 0;
}

/** Along each axis no kept point is farther from the origin than this. */
inline Vec3<double> reach_m(const DeskewJob& job) {
  const double range_m = std::sqrt(static_cast<double>(job.crop.squared_max_range_m2));
  Vec3<double> reach{0, 0, 0};
  for (std::size_t k = 0; k < job.step_count; ++k) {  // an entry between two steps is between theirs
    const auto row = [&](std::size_t r) {
      const float* at = job.steps[k].at + 4 * r;
      return std::hypot(double{at[0]}, double{at[1]}, double{at[2]}) * range_m + std::fabs(double{at[3]});
    };
    reach = {std::max(reach.x, row(0)), std::max(reach.y, row(1)), std::max(reach.z, row(2))};
  }
  constexpr double rounding = 1 + 1e-5;  // of floats
  return rounding * reach;
}

}  // namespace raceloc::gpu
