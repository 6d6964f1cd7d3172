/** \file
 * Stable sort of (key, index) by the low bits of the key, least significant digit first. */
#pragma once

#include <array>
#include <cstdint>
#include <utility>
#include <vector>

namespace raceloc::gpu {

/** A key of any width with its index. */
struct WideItem {
  std::uint64_t key;
  std::uint32_t index;
  static WideItem of(std::uint64_t key, std::uint32_t index) { return {key, index}; }
};

/** A key of at most 32 bits with its index, in half the memory. */
struct NarrowItem {
  std::uint32_t key, index;
  static NarrowItem of(std::uint64_t key, std::uint32_t index) {
    return {static_cast<std::uint32_t>(key), index};
  }
};

/** Sorts `items` by the lowest `bits` of their keys, in as few rounds as digits of 11 bits need; `scratch` is
 * overwritten. */
template <class Item>
void radixSort(std::vector<Item>& items, std::vector<Item>& scratch, int bits) {
  constexpr int most_digit_bits = 11;
  const int rounds = (bits + most_digit_bits - 1) / most_digit_bits;
  if (rounds == 0) return;
  const int digit_bits = (bits + rounds - 1) / rounds;
  const std::uint32_t mask = (1U << digit_bits) - 1;
  scratch.resize(items.size());
  for (int round = 0; round < rounds; ++round) {
    const int shift = round * digit_bits;
    std::array<std::uint32_t, 1U << most_digit_bits> place{};
    const auto digit = [=](const Item& item) { return static_cast<std::uint32_t>(item.key >> shift) & mask; };
    for (const Item& item : items) ++place[digit(item)];
    std::uint32_t total = 0;
    for (std::uint32_t& p : place) total += std::exchange(p, total);
    for (const Item& item : items) scratch[place[digit(item)]++] = item;
    items.swap(scratch);
  }
}

}  // namespace raceloc::gpu
