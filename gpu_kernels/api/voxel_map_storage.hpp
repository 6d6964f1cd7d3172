/** \file
 * What a VoxelMap owns. */
#pragma once

#include <memory>

#include "api/voxel_table.hpp"
#include "core/backend.hpp"

namespace raceloc::gpu {

class VoxelMap::Storage {
 public:
  Storage(double voxel_size_m, std::unique_ptr<MapMirror> mirror) : x_table(voxel_size_m) {
    bringTo(std::move(mirror));
  }

  void bringTo(std::unique_ptr<MapMirror> mirror) {
    x_mirror = std::move(mirror);
    upload();
  }

  [[nodiscard]] const VoxelTable& table() const { return x_table; }
  [[nodiscard]] const MapMirror* mirror() const { return x_mirror.get(); }

  /** Applies a change of the table and brings it to the device, so that reading stays reading. */
  template <class Change>
  std::size_t changed(const Change& change) {
    const std::size_t result = change(x_table);
    upload();
    return result;
  }

 private:
  void upload() {
    if (x_mirror) x_mirror->upload(x_table);
  }

  VoxelTable x_table;
  std::unique_ptr<MapMirror> x_mirror;  ///< null on the CPU
};

}  // namespace raceloc::gpu
