/** \file
 * Random numbers by counter: number `index` of a stream is a function of (seed, stream, index) alone, so that
 * the same seed gives the same numbers in any order and on any number of threads. */
#pragma once

#include <cmath>
#include <cstdint>
#include <string_view>

namespace raceloc {

/** Mixes 64 bits so that each depends on all. Source: Stafford's variant 13 of the MurmurHash3 finaliser, as in
 * SplitMix64 (Steele et al., OOPSLA 2014). */
[[nodiscard]] constexpr std::uint64_t mixedBits(std::uint64_t x) {
  x = (x ^ (x >> 30)) * 0xbf58476d1ce4e5b9ULL;
  x = (x ^ (x >> 27)) * 0x94d049bb133111ebULL;
  return x ^ (x >> 31);
}

class Noise {
 public:
  /** One stream per seed and name, e.g. ("gps_left/position"). */
  Noise(std::uint64_t seed, std::string_view name) : x_key(mixedBits(seed + kStep)) {
    for (const char c : name) x_key = mixedBits(x_key + kStep + static_cast<unsigned char>(c));
  }
  /** In [0, 1). */
  [[nodiscard]] double uniform(std::uint64_t index) const {
    return static_cast<double>(mixedBits(x_key + kStep * (index + 1)) >> 11) * 0x1p-53;
  }
  /** Of mean 0 and standard deviation 1, by Box and Muller from the two uniforms 2 `index` and 2 `index` + 1. */
  [[nodiscard]] double normal(std::uint64_t index) const {
    const double radius = std::sqrt(-2 * std::log1p(-uniform(2 * index)));
    return radius * std::cos(2 * M_PI * uniform(2 * index + 1));
  }

 private:
  static constexpr std::uint64_t kStep = 0x9e3779b97f4a7c15ULL;  // the golden ratio: odd, all bits mixed
  std::uint64_t x_key;
};

}  // namespace raceloc
