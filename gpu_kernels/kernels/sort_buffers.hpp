/** \file
 * What a sort and a sum over its runs work in. */
#pragma once

#include <cstdint>

namespace raceloc::gpu {

/** Keys and indices, each with the second buffer that a radix sort needs. */
template <class Machine>
struct SortBuffers {
  typename Machine::template Array<std::uint64_t> keys, keys_sorted;
  typename Machine::template Array<std::uint32_t> order, order_sorted;
  typename Machine::template Array<std::uint32_t> heads, numbers;
  typename Machine::template Array<unsigned char> scratch;
};

}  // namespace raceloc::gpu
