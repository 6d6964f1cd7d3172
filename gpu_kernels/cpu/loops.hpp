/** \file
 * The inner loops of the CPU backend. cpu/loops.cpp is compiled once for each instruction set; which one runs
 * is chosen when the program starts. All of them give the same bits. */
#pragma once

#include <cstdint>
#include <vector>

#include "core/deskew.hpp"
#include "core/factor.hpp"
#include "core/neighbour_grid.hpp"
#include "core/voxel_grid.hpp"
#include "cpu/box_tree.hpp"
#include "raceloc/gpu/covariance.h"
#include "raceloc/gpu/types.h"

namespace raceloc::gpu {

/** Arrays that loops read may be read this many elements beyond their end. */
inline constexpr std::size_t kPadding = 16;

/** Covariances of points sorted by cell. */
struct CovarianceJob {
  const float *x, *y, *z;      ///< sorted, padded
  const std::uint32_t* order;  ///< place of a sorted point in the caller's cloud
  const std::uint32_t*
      cell_first;   ///< first point of each cell, and behind the last cell the number of points
  const Run* runs;  ///< kRowsAround a cell
  CovarianceOptions options;
  CovariancesOut out;
};

/** Covariances of k nearest neighbours, all of weight 1. */
struct NearestCovarianceJob {
  PointsView points;
  BoxTreeView tree;  ///< over the same points
  CovarianceOptions options;
  CovariancesOut out;
};

/** A pass over source points. */
struct PassJob {
  PointsView points;
  CovariancesView covariances;
  VoxelMapView map;
  const BoxTreeView*
      tree;  ///< null: a point's pairs are voxels; else the nearest of the map's records, which
             ///< are those of the tree's points
  PassSetup setup;
  const PassSetup* before;  ///< of the pass before, null in the first; of no use without a tree
  std::int32_t* nearest;    ///< with a tree: record of each point at the pass before, -1 without one; padded
  float* others_m;          ///< with a tree: no other record was nearer than this; padded
  const std::int32_t* frozen;  ///< may be null
  std::int32_t* fresh;         ///< pair k of point i at k * points.size + i
};

/** Points of a block of a pass: its sums are floats, the sums over blocks are doubles. */
inline constexpr std::size_t kPassBlock = 256;

/** Index of no voxel. */
inline constexpr std::int32_t kNoCell = INT32_MIN;

/** Voxels of points. */
struct VoxelJob {
  PointsView points;
  double voxel_size_m;
  std::int32_t *x, *y, *z;  ///< x is kNoCell where a point has no voxel
};

struct Loops {
  const char* instructions;  ///< for the log
  /** The points of cells [first, last). \param scratch three times the most candidates of a cell + 2 kPadding
   */
  void (*covariances)(const CovarianceJob&, std::uint32_t first, std::uint32_t last, float* scratch,
                      std::size_t scratch_stride);
  /** Points [first, last). */
  void (*nearestCovariances)(const NearestCovarianceJob&, std::size_t first, std::size_t last);
  /** The sums of points [first, last), at most kPassBlock, first a multiple of it. */
  void (*pass)(const PassJob&, std::size_t first, std::size_t last, double* sums);
  void (*voxels)(const VoxelJob&, std::size_t first, std::size_t last, VoxelBox& box);
  /** What is kept of points [first, last) goes to `to` from `first` on. \return how many */
  std::size_t (*deskew)(const DeskewJob&, std::size_t first, std::size_t last, const DeskewedOut& to);
};

/** The loops that this machine can run, the fastest first. */
[[nodiscard]] std::vector<const Loops*> loopsHere();

}  // namespace raceloc::gpu
