/** \file
 * Sort and sum on the device: the only two things taken from CUB. */
#include <cub/device/device_radix_sort.cuh>
#include <cub/device/device_scan.cuh>

#include "cuda/machine.hpp"

namespace raceloc::gpu {

void CudaMachine::sortPairs(SortBuffers<CudaMachine>& b, std::uint32_t n, int bits) {
  std::size_t bytes = 0;
  const auto sort = [&](void* scratch) {
    checkCuda(cub::DeviceRadixSort::SortPairs(scratch, bytes, b.keys.data(), b.keys_sorted.room(n),
                                              b.order.data(), b.order_sorted.room(n), n, 0, bits, x_stream),
              "cub::DeviceRadixSort::SortPairs");
  };
  sort(nullptr);
  sort(b.scratch.room(bytes));
}

void CudaMachine::numberRuns(SortBuffers<CudaMachine>& b, std::uint32_t n) {
  std::size_t bytes = 0;
  const auto scan = [&](void* scratch) {
    checkCuda(cub::DeviceScan::InclusiveSum(scratch, bytes, b.heads.data(), b.numbers.room(n), n, x_stream),
              "cub::DeviceScan::InclusiveSum");
  };
  scan(nullptr);
  scan(b.scratch.room(bytes));
}

}  // namespace raceloc::gpu
