/** \file
 * Stands in for cuda/ in a build without nvcc. */
#include "core/backend.hpp"

namespace raceloc::gpu {

std::unique_ptr<BackendBase> makeCudaBackend(int) { throw DeviceError("not built with CUDA"); }

}  // namespace raceloc::gpu
