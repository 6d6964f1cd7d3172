/** \file
 * The index of a voxel as one number. */
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <optional>

namespace raceloc {

/** 21 bits an axis, z above y above x: keys ascend by z, then y, then x.
 * \param index  whole numbers; none if one is not finite, or 2^20 or more from zero */
[[nodiscard]] inline std::optional<std::uint64_t> voxelKey(const Eigen::Vector3d& index) {
  constexpr std::int64_t kReach = 1 << 20;
  if (!(index.array().abs() < kReach).all()) return std::nullopt;  // NaN too: maxCoeff() may overlook one
  const auto bits = [](double at) {
    return static_cast<std::uint64_t>(static_cast<std::int64_t>(at) + kReach);
  };
  return bits(index.z()) << 42U | bits(index.y()) << 21U | bits(index.x());
}

/** The index that has this key. */
[[nodiscard]] inline Eigen::Vector3d voxelIndex(std::uint64_t key) {
  constexpr std::int64_t kReach = 1 << 20, kMask = 2 * kReach - 1;
  const auto at = [key](unsigned shift) {
    return static_cast<double>(static_cast<std::int64_t>(key >> shift) & kMask) - kReach;
  };
  return {at(0), at(21), at(42)};
}

}  // namespace raceloc
