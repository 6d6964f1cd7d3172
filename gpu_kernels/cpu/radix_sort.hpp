/** \file
 * Stable sort of (key, index) by the low bits of the key, least significant digit first. */
#pragma once

#include <algorithm>
#include <cstdint>
#include <utility>
#include <vector>

#include "cpu/workers.hpp"

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

/** Items that a worker sorts in less time than it takes to wake another. */
inline constexpr std::size_t kLeastPiece = 8192;

/** Sorts `items` by the lowest `bits` of their keys, in as few rounds as digits of 11 bits need; `scratch` and
 * `places` are overwritten. Each worker has a piece, and writes to places of its own. */
template <class Item>
void radixSort(std::vector<Item>& items, std::vector<Item>& scratch, int bits, Workers& workers,
               std::vector<std::uint32_t>& places) {
  constexpr int most_digit_bits = 11;
  const int rounds = (bits + most_digit_bits - 1) / most_digit_bits;
  if (rounds == 0 || items.empty()) return;
  const int digit_bits = (bits + rounds - 1) / rounds;
  const std::uint32_t digits = 1U << digit_bits;
  const auto threads = static_cast<std::size_t>(workers.threads());
  const std::size_t piece = std::max(kLeastPiece, (items.size() + threads - 1) / threads);
  scratch.resize(items.size());
  for (int round = 0; round < rounds; ++round) {
    const int shift = round * digit_bits;
    const auto digit = [=](const Item& item) {
      return static_cast<std::uint32_t>(item.key >> shift) & (digits - 1);
    };
    places.assign(threads * digits, 0);
    const Item* from = items.data();  // plain pointers: what is stored cannot be a vector's own
    Item* to = scratch.data();
    const auto placesOf = [&](std::size_t first) { return &places[first / piece * digits]; };
    workers.forPieces(items.size(), piece, [&](std::size_t first, std::size_t last, int) {
      std::uint32_t* count = placesOf(first);
      for (std::size_t k = first; k < last; ++k) ++count[digit(from[k])];
    });
    std::uint32_t total = 0;
    for (std::uint32_t d = 0; d < digits; ++d)
      for (std::size_t t = 0; t < threads; ++t) total += std::exchange(places[t * digits + d], total);
    workers.forPieces(items.size(), piece, [&](std::size_t first, std::size_t last, int) {
      std::uint32_t* place = placesOf(first);
      for (std::size_t k = first; k < last; ++k) to[place[digit(from[k])]++] = from[k];
    });
    items.swap(scratch);
  }
}

}  // namespace raceloc::gpu
