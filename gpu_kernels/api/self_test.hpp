/** \file
 * Whether a device computes what the CPU does. CUDA programs have been seen to fail in silence: with a wrong pose, a
 * NaN, or the guess handed back. */
#pragma once

#include <string>

#include "core/backend.hpp"

namespace raceloc::gpu {

/** Takes a built-in pair of scans through de-skewing, voxel grid, covariances, map and match on both, some milliseconds.
 * \return what differs, in one line; empty if nothing does. Errors of the device's driver are such a line too. */
[[nodiscard]] std::string selfTest(BackendBase& device);

}  // namespace raceloc::gpu
