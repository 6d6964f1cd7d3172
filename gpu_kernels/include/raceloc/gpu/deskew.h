/** \file
 * De-skewing and cropping of a raw scan, in one pass. */
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "raceloc/gpu/context.h"
#include "raceloc/gpu/types.h"

namespace raceloc::gpu {

/** p -> A p + t, the rows of [A | t] one after another. */
using Affine = std::array<float, 12>;

/** Where the sensor was during a sweep, at equal steps from its begin (time 0) to its end; somebody else owns it. */
struct SweepView {
  const Affine*
      T_end_lidar;   ///< each moves a point seen then into the frame of the end, the last one at the end
  std::size_t size;  ///< >= 1
  float duration_s;  ///< finite, >= 0
};

/** What is kept of a scan: distances from the sensor in [min_range_m, max_range_m], and nothing in the box of the own
 * car, which is in the frame of the end, of any height. Compared in floats, distances as squares: a distance up to
 * 1e-7 of itself from a limit is on either side. */
struct Crop {
  float min_range_m = 3.0F;           ///< >= 0
  float max_range_m = 100.0F;         ///< > 0
  float own_car_front_m = 4.5F;       ///< >= 0, ahead of the origin
  float own_car_rear_m = 1.5F;        ///< >= 0, behind it
  float own_car_half_width_m = 1.2F;  ///< >= 0, to each side
};

struct Deskewed {
  Points points;                       ///< in the frame of the end, in the order of the scan
  std::vector<std::uint32_t> indices;  ///< where in the scan each was
};

/** Moves every point into the frame of the end by the transform of its own time, which lies between those of the steps
 * around it, entry by entry. Times outside the sweep count as its begin or end; without times, and in a sweep of 0 s,
 * all points are taken as of the end. Dropped is what `crop` says, and any point of which a coordinate or the time is
 * not finite. The same bits on every device.
 * \param time_s  of each point since the begin of the sweep; null if they are not known
 * \param into    what is no longer needed: its memory is used again
 * \throws std::invalid_argument if a transform is not finite or an argument out of range */
[[nodiscard]] Deskewed deskew(Context& context, const PointsView& scan_lidar, const float* time_s,
                              const SweepView& sweep, const Crop& crop, Deskewed into = {});

}  // namespace raceloc::gpu
