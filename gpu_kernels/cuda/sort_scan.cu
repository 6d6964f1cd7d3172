#include <cub/device/device_radix_sort.cuh>
#include <cub/device/device_scan.cuh>

#include "cuda/sort_scan.hpp"

namespace raceloc::gpu {

void sortPairs(SortBuffers& b, std::uint32_t n, int bits, cudaStream_t stream) {
  std::size_t bytes = 0;
  const auto sort = [&](void* scratch) {
    checkCuda(cub::DeviceRadixSort::SortPairs(scratch, bytes, b.keys.data(), b.keys_sorted.room(n),
                                              b.order.data(), b.order_sorted.room(n), n, 0, bits, stream),
              "cub::DeviceRadixSort::SortPairs");
  };
  sort(nullptr);
  sort(b.scratch.room(bytes));
}

void numberRuns(SortBuffers& b, std::uint32_t n, cudaStream_t stream) {
  std::size_t bytes = 0;
  const auto scan = [&](void* scratch) {
    checkCuda(cub::DeviceScan::InclusiveSum(scratch, bytes, b.heads.data(), b.numbers.room(n), n, stream),
              "cub::DeviceScan::InclusiveSum");
  };
  scan(nullptr);
  scan(b.scratch.room(bytes));
}

}  // namespace raceloc::gpu
