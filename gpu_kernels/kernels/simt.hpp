/** \file
 * What the kernels use of the machine: their place in the grid, barrier, shuffle, fence and counter. Nothing else
 * in kernels/ names a CUDA builtin; g++ compiles the same kernels for the fibre emulator of the tests. */
#pragma once

#include <cstdint>

#include "core/host_device.hpp"

namespace raceloc::gpu::simt {

inline constexpr int kWarp = 32;

/** Blocks of a launch. */
struct Grid {
  std::uint32_t x = 1, y = 1;
};

}  // namespace raceloc::gpu::simt

#if defined(__CUDACC__)

#define RACELOC_KERNEL(threads) __global__ void __launch_bounds__(threads)
#define RACELOC_DEVICE __device__ __forceinline__
#define RACELOC_SHARED(type, name) __shared__ type name
#define RACELOC_UNROLL _Pragma("unroll")

namespace raceloc::gpu::simt {

RACELOC_DEVICE std::uint32_t thread() { return threadIdx.x; }
RACELOC_DEVICE std::uint32_t threads() { return blockDim.x; }
RACELOC_DEVICE Grid block() { return {blockIdx.x, blockIdx.y}; }
RACELOC_DEVICE Grid blocks() { return {gridDim.x, gridDim.y}; }
RACELOC_DEVICE void barrier() { __syncthreads(); }
template <class T>
RACELOC_DEVICE T fromLaneXor(T value, int mask) {
  return __shfl_xor_sync(0xFFFFFFFFU, value, mask);
}

/** What this thread wrote before is seen by whoever sees what it writes after. */
RACELOC_DEVICE void fence() { __threadfence(); }

/** Adds 1 for all blocks to see; returns the value before. */
RACELOC_DEVICE std::uint32_t increment(std::uint32_t& counter) { return atomicAdd(&counter, 1U); }

/** Reads what another block wrote in this launch: past the first cache, which does not see it. */
template <class T>
RACELOC_DEVICE T fromOtherBlock(const T& value) {
  return __ldcg(&value);
}

/** Puts `value` where `expected` is, for all blocks to see; returns what was there. */
RACELOC_DEVICE std::uint32_t exchangeIf(std::uint32_t& place, std::uint32_t expected, std::uint32_t value) {
  return atomicCAS(&place, expected, value);
}

}  // namespace raceloc::gpu::simt

#else

#include "tests/emu/emulator.hpp"

#endif

namespace raceloc::gpu::simt {

RACELOC_DEVICE std::uint32_t globalThread() { return block().x * threads() + thread(); }
RACELOC_DEVICE std::uint32_t lane() { return thread() % kWarp; }
RACELOC_DEVICE std::uint32_t warp() { return thread() / kWarp; }

/** For all threads of a launch: true in the block that comes here last, which may read what the others wrote before, by
 * fromOtherBlock(). \param counter  0 before the launch and behind it */
RACELOC_DEVICE bool lastBlockHere(std::uint32_t& counter) {
  RACELOC_SHARED(bool, is_last);
  barrier();
  if (thread() == 0) {
    fence();  // the barrier made the block's writes this thread's to publish
    is_last = increment(counter) + 1 == blocks().x * blocks().y;
    if (is_last) counter = 0;
    fence();
  }
  barrier();
  return is_last;
}

}  // namespace raceloc::gpu::simt
