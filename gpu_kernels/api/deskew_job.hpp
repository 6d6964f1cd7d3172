/** \file
 * Arguments of deskew(), checked and as the backends take them. */
#pragma once

#include <vector>

#include "core/deskew.hpp"
#include "raceloc/gpu/deskew.h"

namespace raceloc::gpu {

/** One step a transform; the last alone without times and in a sweep of 0 s.
 * \param into  what is no longer needed: its memory is used again
 * \throws std::invalid_argument as deskew() does */
[[nodiscard]] std::vector<SweepStep> sweepSteps(const SweepView& sweep, bool timed,
                                                std::vector<SweepStep> into = {});

/** \param steps  of sweepSteps(); the job refers to them \throws std::invalid_argument as deskew() does */
[[nodiscard]] DeskewJob deskewJob(const PointsView& scan_lidar, const float* time_s, const SweepView& sweep,
                                  const std::vector<SweepStep>& steps, const Crop& crop);

}  // namespace raceloc::gpu
