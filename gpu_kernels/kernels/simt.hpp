/** \file
 * What the kernels use of the machine: their place in the grid, shuffles and the barrier. Nothing else in
 * kernels/ names a CUDA builtin. */
#pragma once

#include <cstdint>

#define RACELOC_KERNEL(threads) __global__ void __launch_bounds__(threads)

namespace raceloc::gpu::simt {

inline constexpr int kWarp = 32;

__device__ __forceinline__ std::uint32_t globalThread() { return blockIdx.x * blockDim.x + threadIdx.x; }
__device__ __forceinline__ std::uint32_t thread() { return threadIdx.x; }
__device__ __forceinline__ std::uint32_t block() { return blockIdx.x; }
__device__ __forceinline__ std::uint32_t lane() { return threadIdx.x % kWarp; }
__device__ __forceinline__ std::uint32_t warp() { return threadIdx.x / kWarp; }
__device__ __forceinline__ void barrier() { __syncthreads(); }
__device__ __forceinline__ float fromLaneXor(float value, int mask) {
  return __shfl_xor_sync(0xFFFFFFFFU, value, mask);
}

}  // namespace raceloc::gpu::simt
