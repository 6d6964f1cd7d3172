/** \file
 * Stable sort of (key, index) by the low bits of the key, least significant digit first. */
#pragma once

#include <array>
#include <cstdint>
#include <utility>
#include <vector>

namespace raceloc::gpu {

struct KeyedIndex {
  std::uint64_t key;
  std::uint32_t index;
};

/** Sorts `items` by the lowest `bits` of their keys; `scratch` is overwritten. */
inline void radixSort(std::vector<KeyedIndex>& items, std::vector<KeyedIndex>& scratch, int bits) {
  constexpr int digit_bits = 11;
  constexpr std::uint64_t digit_mask = (1U << digit_bits) - 1;
  scratch.resize(items.size());
  for (int shift = 0; shift < bits; shift += digit_bits) {
    std::array<std::size_t, digit_mask + 1> place{};
    for (const KeyedIndex& item : items) ++place[(item.key >> shift) & digit_mask];
    std::size_t total = 0;
    for (std::size_t& p : place) total += std::exchange(p, total);
    for (const KeyedIndex& item : items) scratch[place[(item.key >> shift) & digit_mask]++] = item;
    items.swap(scratch);
  }
}

}  // namespace raceloc::gpu
