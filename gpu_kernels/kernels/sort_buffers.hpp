/** \file
 * What a sort and a sum over its runs work in. */
#pragma once

#include <cstdint>
#include <limits>
#include <type_traits>

#include "core/cell.hpp"

namespace raceloc::gpu {

/** Whether the keys of a layout and the one behind them do. */
template <class Key>
bool fits(const KeyLayout& layout) {
  return layout.bits < std::numeric_limits<Key>::digits;
}

/** Calls `use` with a key of 32 bits where that is enough: half the bytes to sort. */
template <class Use>
auto withKey(const KeyLayout& layout, const Use& use) {
  return fits<std::uint32_t>(layout) ? use(std::uint32_t{}) : use(std::uint64_t{});
}

/** Sorted keys; those of points that are dropped are not below `end`, and so behind all others. */
template <class Key>
struct SortedKeys {
  const Key* keys;
  std::uint32_t size;
  Key end;

  [[nodiscard]] RACELOC_HD bool isKept(std::uint32_t k) const { return k < size && keys[k] < end; }

  /** 1 where a run of equal keys begins: the inclusive sum numbers the runs from 1. */
  RACELOC_HD std::uint32_t operator()(std::uint32_t k) const {
    return isKept(k) && (k == 0 || keys[k] != keys[k - 1]) ? 1 : 0;
  }
};

/** Keys and indices, each with the second buffer that a radix sort needs. */
template <class Machine>
struct SortBuffers {
  template <class T>
  using Array = typename Machine::template Array<T>;
  template <class Key>
  struct Keys {
    Array<Key> mixed, sorted;
  };

  template <class Key>
  Keys<Key>& keys() {
    if constexpr (std::is_same_v<Key, std::uint32_t>) {
      return narrow;
    } else {
      return wide;
    }
  }

  Keys<std::uint32_t> narrow;
  Keys<std::uint64_t> wide;
  Array<std::uint32_t> order, order_sorted;
  Array<std::uint32_t> flags, numbers;
  Array<unsigned char> scratch;
};

}  // namespace raceloc::gpu
