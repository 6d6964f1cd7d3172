/** \file
 * Sort and sum on the device: the only two things taken from CUB. */
#include <thrust/iterator/counting_iterator.h>
#include <thrust/iterator/transform_iterator.h>

#include <cub/device/device_radix_sort.cuh>
#include <cub/device/device_scan.cuh>

#include "cuda/machine.hpp"

namespace raceloc::gpu {

namespace {

/** Calls CUB as it wants to be called: once for the bytes of its scratch memory, once to work in them. */
template <class Call>
void withScratch(SortBuffers<CudaMachine>& b, const CudaCall& name, const Call& call) {
  std::size_t bytes = 0;
  checkCuda(call(nullptr, bytes), name);
  checkCuda(call(b.scratch.room(bytes), bytes), name);
}

}  // namespace

template <class Key>
void CudaMachine::sortPairs(SortBuffers<CudaMachine>& b, std::uint32_t n, int bits) {
  auto& keys = b.keys<Key>();
  Key* sorted = keys.sorted.room(n);
  std::uint32_t* order_sorted = b.order_sorted.room(n);
  withScratch(b, "cub::DeviceRadixSort::SortPairs", [&](void* scratch, std::size_t& bytes) {
    return cub::DeviceRadixSort::SortPairs(scratch, bytes, keys.mixed.data(), sorted, b.order.data(),
                                           order_sorted, n, 0, bits, x_stream);
  });
}
template void CudaMachine::sortPairs<std::uint32_t>(SortBuffers<CudaMachine>&, std::uint32_t, int);
template void CudaMachine::sortPairs<std::uint64_t>(SortBuffers<CudaMachine>&, std::uint32_t, int);

template <class Key>
void CudaMachine::numberRuns(SortBuffers<CudaMachine>& b, const SortedKeys<Key>& sorted) {
  const auto begins =
      thrust::make_transform_iterator(thrust::make_counting_iterator(std::uint32_t{0}), sorted);
  std::uint32_t* numbers = b.numbers.room(sorted.size);
  withScratch(b, "cub::DeviceScan::InclusiveSum", [&](void* scratch, std::size_t& bytes) {
    return cub::DeviceScan::InclusiveSum(scratch, bytes, begins, numbers, sorted.size, x_stream);
  });
}
template void CudaMachine::numberRuns(SortBuffers<CudaMachine>&, const SortedKeys<std::uint32_t>&);
template void CudaMachine::numberRuns(SortBuffers<CudaMachine>&, const SortedKeys<std::uint64_t>&);

void CudaMachine::numberFlags(SortBuffers<CudaMachine>& b, std::uint32_t n) {
  std::uint32_t* numbers = b.numbers.room(n);
  withScratch(b, "cub::DeviceScan::InclusiveSum", [&](void* scratch, std::size_t& bytes) {
    return cub::DeviceScan::InclusiveSum(scratch, bytes, b.flags.data(), numbers, n, x_stream);
  });
}

}  // namespace raceloc::gpu
