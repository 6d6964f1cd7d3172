/** \file
 * Cells of a regular grid (voxels, neighbour cells) and their keys. */
#pragma once

#include <cstdint>

#include "core/host_device.hpp"

namespace raceloc::gpu {

/** Indices lie in [-2^20, 2^20): 21 bits each, so that a key holds three. */
inline constexpr std::int32_t kCellLimit = 1 << 20;

struct Cell {
  std::int32_t x, y, z;
};

RACELOC_HD bool inRange(const Cell& c) {
  return c.x >= -kCellLimit && c.x < kCellLimit && c.y >= -kCellLimit && c.y < kCellLimit &&
         c.z >= -kCellLimit && c.z < kCellLimit;
}

/** floor(x) of a number that an int32 can hold. */
template <class T>
RACELOC_HD std::int32_t floorToInt(T x) {
  const auto whole = static_cast<std::int32_t>(x);
  return whole - (x < static_cast<T>(whole) ? 1 : 0);
}

/** The cell of a point, index floor(p / size) on each axis. \return false if it is not finite or out of
 * range. */
RACELOC_HD bool cellOf(double x, double y, double z, double size_m, Cell& cell) {
  constexpr double limit = kCellLimit;
  const double cx = x / size_m, cy = y / size_m, cz = z / size_m;
  if (!(cx >= -limit && cx < limit && cy >= -limit && cy < limit && cz >= -limit && cz < limit)) return false;
  cell = {floorToInt(cx), floorToInt(cy), floorToInt(cz)};
  return true;
}

/** Key of a cell among all: ascending keys are ascending (z, y, x). */
RACELOC_HD std::uint64_t packedKey(const Cell& c) {
  return (static_cast<std::uint64_t>(c.z + kCellLimit) << 42) |
         (static_cast<std::uint64_t>(c.y + kCellLimit) << 21) | static_cast<std::uint64_t>(c.x + kCellLimit);
}

/** No cell has this key. */
inline constexpr std::uint64_t kNoKey = ~std::uint64_t{0};

/** Keys of the cells of one box, in as few bits as it needs (a sort reads no others); order as packedKey().
 */
struct KeyLayout {
  Cell low{0, 0, 0};
  std::int32_t shift_y = 0, shift_z = 0, bits = 0;

  [[nodiscard]] RACELOC_HD std::uint64_t key(const Cell& c) const {
    return (static_cast<std::uint64_t>(c.z - low.z) << shift_z) |
           (static_cast<std::uint64_t>(c.y - low.y) << shift_y) | static_cast<std::uint64_t>(c.x - low.x);
  }

  /** The box from low to high, both inside. */
  static KeyLayout of(const Cell& low, const Cell& high) {
    const auto bitsFor = [](std::int32_t largest) {
      std::int32_t bits = 0;
      while ((largest >> bits) > 0) ++bits;
      return bits;
    };
    KeyLayout layout;
    layout.low = low;
    layout.shift_y = bitsFor(high.x - low.x);
    layout.shift_z = layout.shift_y + bitsFor(high.y - low.y);
    layout.bits = layout.shift_z + bitsFor(high.z - low.z);
    return layout;
  }
};

}  // namespace raceloc::gpu
