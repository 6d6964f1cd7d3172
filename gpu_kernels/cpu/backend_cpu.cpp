/** \file
 * The CPU: what is not worth vectors, around the loops of cpu/loops.cpp. */
#include <algorithm>
#include <array>
#include <limits>
#include <numeric>
#include <optional>
#include <utility>
#include <vector>

#include "api/nearest_storage.hpp"
#include "api/voxel_table.hpp"
#include "core/backend.hpp"
#include "core/neighbour_grid.hpp"
#include "core/standing.hpp"
#include "core/union_find.hpp"
#include "core/voxel_grid.hpp"
#include "cpu/loops.hpp"
#include "cpu/radix_sort.hpp"
#include "cpu/workers.hpp"

namespace raceloc::gpu {

namespace {

void resize(Covariances& C, std::size_t n) {
  for (auto* v : {&C.xx, &C.xy, &C.xz, &C.yy, &C.yz, &C.zz}) v->resize(n);
  C.neighbours.resize(n);
}

/** Points of a piece of work that has a loop of its own. */
constexpr std::size_t kPiece = 1024;

/** Cells of a piece: a few hundred points. */
constexpr std::size_t kCellPiece = 64;

/** Points of a piece where each searches a tree. */
constexpr std::size_t kNearestPiece = 256;

/** Cells of a piece where only their runs are looked for. */
constexpr std::size_t kRunPiece = 512;

/** Cells of a row of a neighbourhood. */
constexpr std::size_t kCellsOfRow = 3;

/** What the passes work in; the backend keeps it from call to call. */
struct PassBuffers {
  std::vector<std::int32_t> fresh, frozen, nearest;
  std::vector<float> others_m;
  std::vector<std::array<double, kSums>> of_block;
};

/** Parents of one thread. */
struct OwnParents {
  std::uint32_t* parents;
  [[nodiscard]] std::uint32_t get(std::uint32_t i) const { return parents[i]; }
  void set(std::uint32_t i, std::uint32_t ancestor) const { parents[i] = ancestor; }
  std::uint32_t hook(std::uint32_t i, std::uint32_t parent) const {
    return std::exchange(parents[i], parent);
  }
};

class CpuPasses : public PassRunner {
 public:
  CpuPasses(const Loops& loops, Workers& workers, PassBuffers& buffers, const PointsView& source,
            const CovariancesView& covariances, const VoxelMapView& map, double voxel_size_m,
            const MatchOptions& options)
      : x_loops(loops),
        x_workers(workers),
        x_buffers(buffers),
        x_voxel_size_m(voxel_size_m),
        x_options(options) {
    const std::size_t pairs = source.size * static_cast<std::size_t>(options.neighbour_voxels);
    buffers.fresh.resize(pairs);
    buffers.frozen.resize(pairs);
    buffers.of_block.resize((source.size + kPassBlock - 1) / kPassBlock);
    x_job.points = source;
    x_job.covariances = covariances;
    x_job.map = map;
  }

  /** With the nearest of the target's points as pairs. */
  CpuPasses(const Loops& loops, Workers& workers, PassBuffers& buffers, const PointsView& source,
            const CovariancesView& covariances, const NearestTarget::Storage& target, MatchOptions options)
      : CpuPasses(loops, workers, buffers, source, covariances, {nullptr, target.records().data(), 0}, 0,
                  (options.neighbour_voxels = 1, options)) {
    x_tree = target.tree();
    x_job.tree = &x_tree;
    buffers.nearest.resize(source.size + kPadding);
    buffers.others_m.resize(source.size + kPadding);
    x_job.nearest = buffers.nearest.data();
    x_job.others_m = buffers.others_m.data();
  }

  Pass run(const Transform& T_map_source) override {
    x_before = x_job.setup;
    x_job.setup = passSetup(T_map_source, x_voxel_size_m, x_options);
    x_job.fresh = x_buffers.fresh.data();
    x_workers.forPieces(x_job.points.size, kPassBlock, [&](std::size_t first, std::size_t last, int) {
      x_loops.pass(x_job, first, last, x_buffers.of_block[first / kPassBlock].data());
    });
    x_job.before = &x_before;
    Pass pass;
    for (const auto& sums : x_buffers.of_block)
      for (std::size_t k = 0; k < kSums; ++k) pass.sums[k] += sums[k];
    return pass;
  }

  void freeze() override {
    x_buffers.frozen.swap(x_buffers.fresh);
    x_job.frozen = x_buffers.frozen.data();
  }

 private:
  const Loops& x_loops;
  Workers& x_workers;
  PassBuffers& x_buffers;
  double x_voxel_size_m;
  MatchOptions x_options;
  BoxTreeView x_tree{};
  PassSetup x_before{};
  PassJob x_job{};
};

class CpuBackend : public BackendBase {
 public:
  CpuBackend(const Loops& loops, int threads) : x_loops(loops), x_workers(threads) {}

  [[nodiscard]] Backend kind() const override { return Backend::cpu; }
  [[nodiscard]] std::string description() const override {
    return std::string("CPU, ") + x_loops.instructions + ", " + std::to_string(x_workers.threads()) +
           (x_workers.threads() == 1 ? " thread" : " threads");
  }
  std::unique_ptr<MapMirror> mirror() override { return nullptr; }

  Deskewed deskew(const DeskewJob& job, Deskewed into) override {
    moveScan(job);
    joinScan(into);
    return into;
  }

  PreparedScan prepare(const DeskewJob& job, double voxel_size_m, const CovarianceOptions& options,
                       Deskewed* full, PreparedScan into) override {
    moveScan(job);
    if (full != nullptr) joinScan(*full);
    const std::size_t n = job.scan.size;
    for (std::size_t k = 0; k < x_of_piece.size(); ++k)  // without a voxel, behind each piece
      for (auto& axis : x_moved)
        std::fill(&axis[k * kPiece] + x_of_piece[k], &axis[k * kPiece] + std::min(kPiece, n - k * kPiece),
                  std::numeric_limits<float>::quiet_NaN());
    std::size_t dropped = 0;
    into.points = voxelGrid({x_moved[0].data(), x_moved[1].data(), x_moved[2].data(), n}, voxel_size_m,
                            dropped, std::move(into.points));
    into.covariances = covariances(into.points.view(), options, std::move(into.covariances));
    into.on_device = 0;
    return into;
  }

  Points voxelGrid(const PointsView& points, double voxel_size_m, std::size_t& dropped,
                   Points into) override {
    const VoxelBox box = findVoxels(points, voxel_size_m);
    dropped = points.size - box.kept;
    if (box.kept == 0) return {};
    sortVoxels(KeyLayout::of(box.low, box.high), points.size);
    const std::size_t voxels = x_first.size() - 1;
    for (auto* v : {&into.x, &into.y, &into.z}) v->resize(voxels);
    x_workers.forPieces(voxels, kPiece, [&](std::size_t begin, std::size_t end, int) {
      for (std::size_t k = begin; k < end; ++k) {
        CentroidSum sum;
        std::uint32_t n = 0;
        forPointsOf(k, [&](std::uint32_t i) {
          sum.add(points, i);
          ++n;
        });
        const Vec3<float> mean = sum.centroid(n);
        into.x[k] = mean.x, into.y[k] = mean.y, into.z[k] = mean.z;
      }
    });
    return into;
  }

  Covariances covariances(const PointsView& points, const CovarianceOptions& options,
                          Covariances into) override {
    resize(into, points.size);
    if (points.size == 0) return into;
    if (options.neighbourhood == Neighbourhood::nearest) {
      x_tree.build(points);
      const NearestCovarianceJob job{points, x_tree.view(), options, outOf(into)};
      x_workers.forPieces(points.size, kNearestPiece, [&](std::size_t first, std::size_t last, int) {
        x_loops.nearestCovariances(job, first, last);
      });
      return into;
    }
    const std::size_t stride = sortIntoCells(points, options.radius_m) + 2 * kPadding;
    const std::size_t cells = x_first.size() - 1;
    x_scratch.resize(3 * stride * static_cast<std::size_t>(x_workers.threads()));
    const CovarianceJob job{x_sorted[0].data(),
                            x_sorted[1].data(),
                            x_sorted[2].data(),
                            x_order.data(),
                            x_first.data(),
                            x_runs.data(),
                            options,
                            outOf(into)};
    x_workers.forPieces(cells, kCellPiece, [&](std::size_t begin, std::size_t end, int worker) {
      x_loops.covariances(job, static_cast<std::uint32_t>(begin), static_cast<std::uint32_t>(end),
                          &x_scratch[3 * stride * static_cast<std::size_t>(worker)], stride);
    });
    return into;
  }

  StandingCells standingCells(const PointsView& points, const StandingOptions& options,
                              std::vector<std::uint8_t>* is_standing, StandingCells into) override {
    clear(into);
    if (is_standing != nullptr) is_standing->assign(points.size, 0);
    if (points.size == 0) return into;
    const StandingGrid grid = StandingGrid::of(options);
    for (auto& axis : x_voxels) axis.resize(points.size);
    x_workers.forPieces(points.size, kPiece, [&](std::size_t first, std::size_t last, int) {
      for (std::size_t i = first; i < last; ++i) {
        Cell c{};
        if (!grid.cellOf(points.x[i], points.y[i], points.z[i], c)) c.x = kNoCell;
        x_voxels[0][i] = c.x, x_voxels[1][i] = c.y, x_voxels[2][i] = c.z;
      }
    });
    sortVoxels(grid.layout, points.size);
    const std::size_t cells = x_first.size() - 1;
    x_standing.assign(cells, StandingCell(0));
    x_workers.forPieces(cells, kCellPiece, [&](std::size_t begin, std::size_t end, int) {
      for (std::size_t k = begin; k < end; ++k) {
        float lowest_m = FLT_MAX;
        forPointsOf(k, [&](std::uint32_t i) { lowest_m = std::min(lowest_m, points.z[i]); });
        StandingCell cell(lowest_m);
        forPointsOf(k, [&](std::uint32_t i) { cell.add(points, i, options); });
        if (!cell.stands(options)) continue;
        forPointsOf(k, [&](std::uint32_t i) {
          const bool stands = cell.addHigh(points, i, options);
          if (is_standing != nullptr) (*is_standing)[i] = stands ? 1 : 0;
        });
        x_standing[k] = cell;
      }
    });
    for (const StandingCell& cell : x_standing)
      if (cell.standing > 0)
        append(into, cell.sum.centroid(static_cast<std::size_t>(cell.standing)),
               cell.high_sum.centroid(static_cast<std::size_t>(cell.high)), cell.lowest_m, cell.highest_m,
               cell.standing);
    return into;
  }

  std::vector<std::int32_t> clusters(const PointsView& points, float radius_m,
                                     std::vector<std::int32_t> into) override {
    into.resize(points.size);
    if (points.size == 0) return into;
    sortIntoCells(points, radius_m);
    x_parents.resize(points.size);
    std::iota(x_parents.begin(), x_parents.end(), 0U);
    const OwnParents parents{x_parents.data()};
    const PointsView sorted{x_sorted[0].data(), x_sorted[1].data(), x_sorted[2].data(), points.size};
    for (std::size_t cell = 0; cell + 1 < x_first.size(); ++cell)
      for (std::uint32_t k = x_first[cell]; k < x_first[cell + 1]; ++k)
        uniteWithNeighbours(parents, k, sorted, x_order.data(), &x_runs[cell * kRowsAround],
                            radius_m * radius_m);
    for (std::uint32_t i = 0; i < points.size; ++i) into[i] = static_cast<std::int32_t>(rootOf(parents, i));
    return into;
  }

  PassRunner& passes(const PointsView& source, const CovariancesView& covariances, const VoxelTable& table,
                     const MapMirror*, const MatchOptions& options) override {
    return x_passes.emplace(x_loops, x_workers, x_pass_buffers, source, covariances, table.view(),
                            table.voxelSize(), options);
  }

  PassRunner& nearestPasses(const PointsView& source, const CovariancesView& covariances,
                            const NearestTarget::Storage& target, const MatchOptions& options) override {
    return x_passes.emplace(x_loops, x_workers, x_pass_buffers, source, covariances, target, options);
  }

 private:
  /** What is kept of piece k of the scan stands in x_moved and x_order from k * kPiece on, x_of_piece[k] points. */
  void moveScan(const DeskewJob& job) {
    const std::size_t n = job.scan.size;
    for (auto& axis : x_moved) axis.resize(n);
    x_order.resize(n);
    x_of_piece.assign((n + kPiece - 1) / kPiece, 0);
    const DeskewedOut to{x_moved[0].data(), x_moved[1].data(), x_moved[2].data(), x_order.data()};
    x_workers.forPieces(n, kPiece, [&](std::size_t first, std::size_t last, int) {
      x_of_piece[first / kPiece] = x_loops.deskew(job, first, last, to);
    });
  }

  void joinScan(Deskewed& into) const {
    const std::size_t kept = std::accumulate(x_of_piece.begin(), x_of_piece.end(), std::size_t{0});
    const auto join = [&](const auto& pieces, auto& all) {
      all.resize(kept);
      auto to = all.begin();
      for (std::size_t k = 0; k < x_of_piece.size(); ++k)
        to = std::copy_n(pieces.data() + k * kPiece, x_of_piece[k], to);
    };
    join(x_moved[0], into.points.x);
    join(x_moved[1], into.points.y);
    join(x_moved[2], into.points.z);
    join(x_order, into.indices);
  }

  static CovariancesOut outOf(Covariances& C) {
    return {C.xx.data(), C.xy.data(), C.xz.data(),        C.yy.data(),
            C.yz.data(), C.zz.data(), C.neighbours.data()};
  }

  VoxelBox findVoxels(const PointsView& points, double voxel_size_m) {
    for (auto& axis : x_voxels) axis.resize(points.size);
    const VoxelJob job{points, voxel_size_m, x_voxels[0].data(), x_voxels[1].data(), x_voxels[2].data()};
    x_boxes.assign((points.size + kPiece - 1) / kPiece, VoxelBox{});
    x_workers.forPieces(points.size, kPiece, [&](std::size_t first, std::size_t last, int) {
      x_loops.voxels(job, first, last, x_boxes[first / kPiece]);
    });
    VoxelBox all;
    for (const VoxelBox& box : x_boxes) all.add(box);
    return all;
  }

  /** Sorts n points by their voxels in x_voxels, with those behind each other in a scan as one: see forPointsOf(). */
  void sortVoxels(const KeyLayout& layout, std::size_t n) {
    const std::size_t kept = listStretches(n);
    // One bit more: what has no voxel comes last.
    sortBy(layout.bits + 1, x_stretches.size() - 1, kept, [&](std::size_t s) {
      const std::uint32_t i = x_stretches[s];
      return x_voxels[0][i] == kNoCell ? std::uint64_t{1} << layout.bits
                                       : layout.key({x_voxels[0][i], x_voxels[1][i], x_voxels[2][i]});
    });
  }

  /** Of the k-th voxel. */
  template <class Use>
  void forPointsOf(std::size_t k, const Use& use) const {
    for (std::uint32_t s = x_first[k]; s < x_first[k + 1]; ++s) {
      const std::uint32_t last = x_stretches[x_order[s] + 1];
      for (std::uint32_t i = x_stretches[x_order[s]]; i < last; ++i) use(i);
    }
  }

  /** The points by cell in x_sorted, where each cell begins in x_first, its nine runs in x_runs. \return the most
   * candidates of a cell */
  std::size_t sortIntoCells(const PointsView& points, float radius_m) {
    const NeighbourGrid grid = NeighbourGrid::over(points, radius_m);
    sortBy(grid.layout.bits, points.size, points.size,
           [&](std::size_t i) { return grid.layout.key(grid.cell(points.x[i], points.y[i], points.z[i])); });
    for (auto& axis : x_sorted) axis.resize(points.size + kPadding);
    x_workers.forPieces(points.size, kPiece, [&](std::size_t first, std::size_t last, int) {
      for (std::size_t k = first; k < last; ++k) {
        const std::uint32_t i = x_order[k];
        x_sorted[0][k] = points.x[i], x_sorted[1][k] = points.y[i], x_sorted[2][k] = points.z[i];
      }
    });
    return findRuns(grid);
  }

  /** Points that follow each other in a scan are often of one voxel: x_stretches is where each stretch of such
   * points begins (and ends with n), which is less to sort. \return the stretches that have a voxel */
  std::size_t listStretches(std::size_t n) {
    const std::int32_t *x = x_voxels[0].data(), *y = x_voxels[1].data(), *z = x_voxels[2].data();
    const auto isHead = [=](std::size_t i) -> std::uint32_t {
      return (x[i] != x[i - 1]) | (y[i] != y[i - 1]) | (z[i] != z[i - 1]);
    };
    const std::size_t pieces = (n + kPiece - 1) / kPiece;
    x_heads.assign(pieces + 1, 0);
    x_of_piece.assign(pieces, 0);
    x_workers.forPieces(n, kPiece, [&](std::size_t first, std::size_t last, int) {
      std::uint32_t heads = 1, with_voxel = x[first] != kNoCell ? 1 : 0;  // a piece begins a stretch
      for (std::size_t i = first + 1; i < last; ++i) {
        const std::uint32_t head = isHead(i);
        heads += head;
        with_voxel += x[i] != kNoCell ? head : 0;
      }
      x_heads[first / kPiece + 1] = heads;
      x_of_piece[first / kPiece] = with_voxel;
    });
    std::partial_sum(x_heads.begin(), x_heads.end(), x_heads.begin());
    x_stretches.resize(x_heads.back() + 1);
    x_stretches.back() = static_cast<std::uint32_t>(n);
    x_workers.forPieces(n, kPiece, [&](std::size_t first, std::size_t last, int) {
      // Backwards and without a branch: a stretch's place is written by all its points, by its first one last.
      std::uint32_t* to = &x_stretches[x_heads[first / kPiece + 1] - 1];
      for (std::size_t i = last; --i > first;) {
        *to = static_cast<std::uint32_t>(i);
        to -= isHead(i);
      }
      *to = static_cast<std::uint32_t>(first);
    });
    return std::accumulate(x_of_piece.begin(), x_of_piece.end(), std::size_t{0});
  }

  /** Sorts n indices by key, of which the first `kept` count: x_order, and where each run of equal keys begins
   * (x_first, ending with `kept`) with its key (x_keys). */
  template <class KeyOf>
  void sortBy(int bits, std::size_t n, std::size_t kept, const KeyOf& keyOf) {
    const auto with = [&](auto& items, auto& scratch) {
      using Item = typename std::decay_t<decltype(items)>::value_type;
      items.resize(n);
      x_workers.forPieces(n, kPiece, [&](std::size_t first, std::size_t last, int) {
        for (std::size_t i = first; i < last; ++i)
          items[i] = Item::of(keyOf(i), static_cast<std::uint32_t>(i));
      });
      radixSort(items, scratch, bits, x_workers, x_places);
      listRuns(items, kept);
    };
    if (bits <= 32) {
      with(x_narrow[0], x_narrow[1]);
    } else {
      with(x_wide[0], x_wide[1]);
    }
  }

  template <class Items>
  void listRuns(const Items& items, std::size_t kept) {
    const auto isHead = [&](std::size_t k) { return k == 0 || items[k].key != items[k - 1].key; };
    x_heads.assign((kept + kPiece - 1) / kPiece + 1, 0);
    x_workers.forPieces(kept, kPiece, [&](std::size_t first, std::size_t last, int) {
      std::uint32_t heads = 0;
      for (std::size_t k = first; k < last; ++k) heads += isHead(k) ? 1 : 0;
      x_heads[first / kPiece + 1] = heads;
    });
    std::partial_sum(x_heads.begin(), x_heads.end(), x_heads.begin());
    x_order.resize(kept);
    x_keys.resize(x_heads.back());
    x_first.resize(x_heads.back() + 1);
    x_first.back() = static_cast<std::uint32_t>(kept);
    x_workers.forPieces(kept, kPiece, [&](std::size_t first, std::size_t last, int) {
      for (std::size_t k = first; k < last; ++k) x_order[k] = items[k].index;
      std::size_t head = first;  // the run before it is another piece's
      while (head < last && !isHead(head)) ++head;
      std::size_t run = x_heads[first / kPiece + 1];
      for (std::size_t k = last; k-- > head;) {  // backwards, as the stretches
        x_first[run - 1] = static_cast<std::uint32_t>(k);
        x_keys[run - 1] = items[k].key;
        run -= isHead(k) ? 1 : 0;
      }
    });
  }

  /** The nine runs of each cell. \return the most candidates of a cell */
  std::size_t findRuns(const NeighbourGrid& grid) {
    const std::size_t cells = x_keys.size();
    x_keys.insert(x_keys.begin(), kCellsOfRow, kNoKey);
    x_keys.push_back(kNoKey);
    x_runs.resize(cells * kRowsAround);
    x_of_piece.assign((cells + kRunPiece - 1) / kRunPiece, 0);
    x_workers.forPieces(cells, kRunPiece, [&](std::size_t first, std::size_t last, int) {
      x_of_piece[first / kRunPiece] = findRuns(grid, first, last);
    });
    return *std::max_element(x_of_piece.begin(), x_of_piece.end());
  }

  /** Of cells [first, last). From cell to cell the rows only move forward. x_keys begins with kCellsOfRow keys of
   * no cell, and ends with one: a row's cells have consecutive keys, so its run begins at most three cells before
   * it ends. */
  std::size_t findRuns(const NeighbourGrid& grid, std::size_t first, std::size_t last) {
    std::array<std::size_t, kRowsAround> end{};
    for (int row = 0; row < kRowsAround; ++row) {
      const std::uint64_t low = grid.rowKey(x_keys[kCellsOfRow + first], row);
      const auto begin = x_keys.begin() + kCellsOfRow;
      end[static_cast<std::size_t>(row)] =
          static_cast<std::size_t>(std::lower_bound(begin, x_keys.end(), low) - x_keys.begin());
    }
    std::size_t most = 0;
    for (std::size_t cell = first; cell < last; ++cell) {
      const std::uint64_t key = x_keys[kCellsOfRow + cell];
      std::size_t candidates = 0;
      for (int row = 0; row < kRowsAround; ++row) {
        const std::uint64_t low = grid.rowKey(key, row), high = low + kCellsOfRow;
        std::size_t e = end[static_cast<std::size_t>(row)];
        e += x_keys[e] < high ? 1 : 0;  // mostly it is one or two: no branch to mispredict
        e += x_keys[e] < high ? 1 : 0;
        while (x_keys[e] < high) ++e;
        end[static_cast<std::size_t>(row)] = e;
        std::size_t length = 0;
        for (std::size_t back = 1; back <= kCellsOfRow; ++back)
          length += x_keys[e - back] - low < kCellsOfRow ? 1 : 0;
        const Run run{x_first[e - kCellsOfRow - length], x_first[e - kCellsOfRow]};
        x_runs[cell * kRowsAround + static_cast<std::size_t>(row)] = run;
        candidates += run.last - run.first;
      }
      most = std::max(most, candidates);
    }
    return most;
  }

  const Loops& x_loops;
  Workers x_workers;
  PassBuffers x_pass_buffers;
  std::optional<CpuPasses> x_passes;
  // Buffers, kept from call to call.
  std::array<std::vector<std::int32_t>, 3> x_voxels;
  std::vector<VoxelBox> x_boxes;
  std::array<std::vector<NarrowItem>, 2> x_narrow;
  std::array<std::vector<WideItem>, 2> x_wide;
  std::vector<std::uint32_t> x_order, x_first, x_places, x_heads, x_stretches, x_parents;
  std::vector<StandingCell> x_standing;
  std::vector<std::size_t> x_of_piece;
  std::vector<std::uint64_t> x_keys;
  std::array<std::vector<float>, 3> x_sorted, x_moved;
  std::vector<Run> x_runs;
  BoxTree x_tree;
  std::vector<float> x_scratch;
};

}  // namespace

std::unique_ptr<BackendBase> makeCpuBackend(int threads) {
  const auto loops = loopsHere();
  if (loops.empty()) throw DeviceError("CPU: older than x86-64-v2 (SSE 4.2)");
  return makeCpuBackend(threads, *loops.front());
}

std::unique_ptr<BackendBase> makeCpuBackend(int threads, const Loops& loops) {
  return std::make_unique<CpuBackend>(loops, threads);
}

}  // namespace raceloc::gpu
