/** \file
 * Euclidean clustering. */
#pragma once

#include <cstdint>
#include <vector>

#include "raceloc/gpu/context.h"
#include "raceloc/gpu/types.h"

namespace raceloc::gpu {

/** Points that can be reached from each other in steps of at most `radius_m` are of one cluster (in float; squares of
 * distances are compared). \param points  finite
 * \param into  what is no longer needed: its memory is used again
 * \return of each point the smallest index of its cluster: the same on every device
 * \throws std::invalid_argument if radius_m is not > 0 or a point is not finite. */
[[nodiscard]] std::vector<std::int32_t> clusters(Context& context, const PointsView& points, float radius_m,
                                                 std::vector<std::int32_t> into = {});

}  // namespace raceloc::gpu
