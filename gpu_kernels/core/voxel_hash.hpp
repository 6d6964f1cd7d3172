/** \file
 * Lookup in the voxel map: open addressing over packed keys, at most half full. */
#pragma once

#include <cstdint>

#include "core/cell.hpp"
#include "core/linear.hpp"

namespace raceloc::gpu {

struct alignas(16) VoxelSlot {
  std::uint64_t key = kNoKey;
  std::int32_t record = -1;
};

/** One voxel's Gaussian. The mean is an offset from the voxel's centre: as exact far from the origin as near
 * it. */
struct alignas(16) VoxelRecord {
  Vec3<float> offset_m;
  Sym3<float> covariance_m2;
  Cell cell;
};

/** The finished map as a device reads it. */
struct VoxelMapView {
  const VoxelSlot* slots;  ///< 2^(64 - shift)
  const VoxelRecord* records;
  std::int32_t shift;
};

/** First slot to try: the upper bits of a multiplicative hash. */
RACELOC_HD std::uint64_t homeSlot(std::uint64_t key, std::int32_t shift) {
  return ((key ^ (key >> 29)) * 0x9E3779B97F4A7C15ULL) >> shift;  // 2^64 / golden ratio
}

/** Record of a voxel, -1 if it is not in the map. Ends: half of the slots are empty. */
RACELOC_HD std::int32_t findRecord(const VoxelMapView& map, const Cell& cell) {
  if (!inRange(cell)) return -1;
  const std::uint64_t key = packedKey(cell);
  const std::uint64_t mask = (std::uint64_t{1} << (64 - map.shift)) - 1;
  for (std::uint64_t i = homeSlot(key, map.shift);; i = (i + 1) & mask) {
    const VoxelSlot slot = map.slots[i];
    if (slot.key == key) return slot.record;
    if (slot.key == kNoKey) return -1;
  }
}

}  // namespace raceloc::gpu
