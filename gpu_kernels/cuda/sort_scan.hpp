/** \file
 * Sort and sum on the device: the only two things taken from CUB. */
#pragma once

#include <cuda_runtime_api.h>

#include <cstdint>

#include "cuda/device_array.hpp"

namespace raceloc::gpu {

/** Keys and indices, each with the second buffer that a radix sort needs. */
struct SortBuffers {
  DeviceArray<std::uint64_t> keys, keys_sorted;
  DeviceArray<std::uint32_t> order, order_sorted;
  DeviceArray<std::uint32_t> heads, numbers;
  DeviceArray<unsigned char> scratch;
};

/** Stable sort of n (key, order) by the lowest `bits` of the keys, into the sorted buffers. */
void sortPairs(SortBuffers& buffers, std::uint32_t n, int bits, cudaStream_t stream);

/** numbers[k] = heads[0] + ... + heads[k]. */
void numberRuns(SortBuffers& buffers, std::uint32_t n, cudaStream_t stream);

}  // namespace raceloc::gpu
