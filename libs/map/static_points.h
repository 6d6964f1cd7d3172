/** \file
 * What of a survey's points stays where it is: other cars drive, and a map shows none of them. */
#pragma once

#include <cstddef>
#include <cstdint>
#include <unordered_map>
#include <vector>

#include "core/options.h"
#include "core/types.h"

namespace raceloc {

/** Section [static]. */
struct StaticOptions {
  double voxel_m = 0.2;
  double layer_m = 0.1;
  double near_m = 4.0;
  double range_m = 50.0;
  double end_m = 0.5;
  double end_share = 0.25;
  int min_passes = 3;
  double passes_per_hit = 3.0;
  void describe(OptionList& keys);
};

/** Voxels that hold points of key scans, and how many scans hit each of them or see through it, earlier or later. What
 * scans see through more often than they hit it, or anything beside it, has moved away. Voxels are flat, so that a car
 * is told from the road right under it.
 *
 * A scan sees through the voxels of its rays between near_m and range_m, but for
 * - the last part of a ray, where it may graze the surface that it ends on: end_m, or as long as it is within about a
 *   voxel's height of a surface parallel to the car's own plane, but at most end_share of the ray,
 * - voxels that it hits, or hits a horizontal neighbour of: a fence or a tree lets rays pass beside those it returns.
 *
 * Goes over the scans twice: mark() all of them, then look() at the same ones and count() what was seen, each in any
 * order. Memory grows with the space that holds points, not with the scans: 2 bytes a voxel, 24 a block of 4 x 4 x 4.
 * Same scans, same answers. */
class StaticVoxels {
 public:
  explicit StaticVoxels(const StaticOptions& options) : x_options(options) {}

  /** First time over the scans: which voxels hold points. Points that are not finite or farther than 2^22 voxels from
   * the map's origin are nowhere.
   * \throws std::invalid_argument if the pose is not finite, std::logic_error after endMarking(). */
  void mark(const Cloud& scan_body, const Pose& T_map_body);

  /** Between the two times over the scans. */
  void endMarking();

  /** What one scan tells: numbers of voxels that hold points, each once. */
  struct Seen {
    std::vector<std::uint32_t> hit, through;
  };
  /** Second time over the scans. Changes nothing, so several threads may look at once. Of a scan that was not marked,
   * points in voxels that hold none are left out.
   * \param p_body_sensor_m  where the rays begin; of several LiDARs the middle, if none is farther from it than about
   *                         half of near_m
   * \throws std::invalid_argument if the pose or the position is not finite, std::logic_error before endMarking(). */
  [[nodiscard]] Seen look(const Cloud& scan_body, const Pose& T_map_body,
                          const Eigen::Vector3d& p_body_sensor_m) const;
  void count(const Seen& seen);
  /** After the last of them: judges every voxel. */
  void endCounting();

  /** Whether what is there stays: true of places that no scan hit, and of all before endCounting(). What sticks to a
   * voxel that moved, on less evidence of its own, moved with it: the top of a car that is higher than the LiDAR. */
  [[nodiscard]] bool isStatic(const Eigen::Vector3d& p_map_m) const;

  /** The points of a cloud that are, in their order. */
  [[nodiscard]] Cloud staticPart(const Cloud& cloud, const Pose& T_map_cloud) const;

 private:
  using Mask = std::uint64_t;  // a bit for each voxel of a block
  struct Block {
    Mask holds = 0;                 ///< points of some scan
    Mask moved = 0;                 ///< known after endCounting()
    std::uint32_t first_count = 0;  ///< the counts of the voxels it holds lie one after the other
  };
  struct Column {
    std::uint32_t lowest = 0;  ///< block
    std::vector<Block> blocks;
  };
  struct Count {
    std::uint8_t hits = 0, passes = 0;  ///< scans; 255 are 255 or more
  };
  struct Voxel {
    std::uint32_t x, y, z;
  };
  using Columns = std::unordered_map<std::uint64_t, Column>;
  class Window;

  /** In voxels, from a corner far below every map; none has a negative coordinate. */
  [[nodiscard]] Eigen::Array3d inGrid(const Eigen::Vector3d& p_map_m) const;
  [[nodiscard]] static Mask bitOf(const Voxel& voxel);
  [[nodiscard]] static Voxel voxelIn(const Voxel& corner, Mask bit);  ///< of the block with this lowest voxel
  [[nodiscard]] static std::uint32_t numberOf(const Block& block, Mask bit);  ///< of its count
  [[nodiscard]] Count countOf(const Voxel& voxel) const;
  /** Of the voxel and of each of the 26 around it. */
  [[nodiscard]] bool outweighHits(double passes, const Voxel& voxel) const;
  [[nodiscard]] bool isSeenThrough(const Voxel& voxel) const;
  [[nodiscard]] bool hasMoved(const Voxel& voxel) const;
  void lookAlong(Window& window, const Eigen::Array3d& sensor, const Eigen::Array3d& end, double length_m,
                 double end_m) const;

  StaticOptions x_options;
  Columns x_columns;
  bool x_marking = true;
  std::vector<Count> x_counts;
};

}  // namespace raceloc
