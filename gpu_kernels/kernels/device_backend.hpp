/** \file
 * The backend of a machine that runs the kernels: which one when, on which arrays. CUDA and the emulator of the
 * tests share it. A Machine has
 *   Array<T>: room(n), data(); upload(machine, rows, n); download(machine, n, from), by the next wait() at host()
 *   HostArray<T>: room(n), where kernels write and the host reads after a wait
 *   launch(name, blocks, threads, kernel, arguments...), select(), device(), description()
 *   wait() for all of it; mark() a place, and waitForMark() for all before it
 *   sortPairs<Key>(SortBuffers&, n, bits), numberRuns(SortBuffers&, SortedKeys), numberFlags(SortBuffers&, n)
 * The host keeps the master of every voxel map. */
#pragma once

#include <algorithm>
#include <array>
#include <atomic>
#include <optional>
#include <string>
#include <utility>

#include "api/voxel_table.hpp"
#include "core/backend.hpp"
#include "core/weight.hpp"
#include "kernels/clusters.kernel.hpp"
#include "kernels/covariance.kernel.hpp"
#include "kernels/deskew.kernel.hpp"
#include "kernels/rows.hpp"
#include "kernels/sort_buffers.hpp"
#include "kernels/sorted_runs.kernel.hpp"
#include "kernels/standing.kernel.hpp"
#include "kernels/vgicp.kernel.hpp"

namespace raceloc::gpu {

RACELOC_KERNEL(simt::kWarp)
testLaunch(std::uint32_t* answer) { answer[simt::lane()] = 3 * simt::lane() + 1; }

inline std::uint32_t blocksFor(std::size_t n, int threads) {
  return static_cast<std::uint32_t>((n + static_cast<std::size_t>(threads) - 1) /
                                    static_cast<std::size_t>(threads));
}

template <class Machine>
class DeviceMirror : public MapMirror {
 public:
  explicit DeviceMirror(const Machine& like) : x_machine(like.device()) {}

  void upload(const VoxelTable& table) override {
    x_machine.select();
    x_view = {x_slots.upload(x_machine, {table.slots().data()}, table.slots().size()),
              x_records.upload(x_machine, {table.records().data()}, table.records().size()), table.shift()};
    x_machine.wait();
  }

  [[nodiscard]] const VoxelMapView& view() const { return x_view; }
  [[nodiscard]] int device() const { return x_machine.device(); }

 private:
  Machine x_machine;  // its own: the map may outlive the context, and another thread may change it
  typename Machine::template Array<VoxelSlot> x_slots;
  typename Machine::template Array<VoxelRecord> x_records;
  VoxelMapView x_view{};
};

template <class Machine>
class DeviceBackend : public BackendBase {
 public:
  explicit DeviceBackend(int device) : x_machine(device) {
    x_machine.select();
    Array<std::uint32_t> there;
    x_machine.launch("testLaunch", {1}, simt::kWarp, testLaunch, there.room(simt::kWarp));
    there.download(x_machine, simt::kWarp);
    x_machine.wait();
    for (std::uint32_t i = 0; i < simt::kWarp; ++i) {
      if (there.host()[i] != 3 * i + 1)
        throw DeviceError("test launch: a wrong answer from " + x_machine.description());
    }
    const std::uint32_t none = 0;
    x_blocks_done.upload(x_machine, {&none}, 1);
  }

  [[nodiscard]] Backend kind() const override { return Backend::cuda; }
  [[nodiscard]] std::string description() const override { return x_machine.description(); }
  std::unique_ptr<MapMirror> mirror() override { return std::make_unique<DeviceMirror<Machine>>(x_machine); }

  Deskewed deskew(const DeskewJob& job, Deskewed into = {}) override {
    if (job.scan.size == 0) return {};
    x_machine.select();
    return compacted(moved(job), std::move(into));
  }

  Points voxelGrid(const PointsView& points, double voxel_size_m, std::size_t& dropped,
                   Points into = {}) override {
    x_machine.select();
    const PointsView p = upload(points);
    const VoxelBox box = boxOf(p, voxel_size_m);
    dropped = points.size - box.kept;
    if (box.kept == 0) return {};
    const std::uint32_t n = thinned(p, voxel_size_m, KeyLayout::of(box.low, box.high));
    x_thinned.download(x_machine, kPointRows * n);
    x_machine.wait();
    takePoints(x_thinned, n, into);
    return into;
  }

  Covariances covariances(const PointsView& points, const CovarianceOptions& options,
                          Covariances into = {}) override {
    if (points.size == 0) return {};
    x_machine.select();
    startCovariances(upload(points), NeighbourGrid::over(points, options.radius_m), options);
    takeCovariances(points.size, into);
    return into;
  }

  PreparedScan prepare(const DeskewJob& job, double voxel_size_m, const CovarianceOptions& options,
                       Deskewed* full, PreparedScan into = {}) override {
    x_machine.select();
    const PointsView scan = moved(job);
    if (full != nullptr) *full = compacted(scan, std::move(*full));
    if (scan.size == 0) return {};
    Vec3<double> high_m = reach_m(job), low_m = -1.0 * high_m;
    std::optional<KeyLayout> layout = narrowLayout(low_m, high_m, voxel_size_m);
    if (!layout) {
      const VoxelBox box = boxOf(scan, voxel_size_m);
      if (box.kept == 0) return {};
      layout = KeyLayout::of(box.low, box.high);
      low_m = voxel_size_m * Vec3<double>{box.low.x - 1.0, box.low.y - 1.0, box.low.z - 1.0};
      high_m = voxel_size_m * Vec3<double>{box.high.x + 2.0, box.high.y + 2.0, box.high.z + 2.0};
    }
    const std::uint32_t n = thinned(scan, voxel_size_m, *layout);
    if (n == 0) return {};
    x_thinned.download(x_machine, kPointRows * n);
    x_machine.mark();
    startCovariances(pointRows(x_thinned.data(), n).view(n),
                     NeighbourGrid::over(low_m, high_m, options.radius_m), options);
    x_machine.waitForMark();
    takePoints(x_thinned, n, into.points);
    takeCovariances(n, into.covariances);
    into.on_device = x_prepared = nextPrepared();
    return into;
  }

  StandingCells standingCells(const PointsView& points, const StandingOptions& options,
                              std::vector<std::uint8_t>* is_standing, StandingCells into = {}) override {
    const auto n = static_cast<std::uint32_t>(points.size);
    clear(into);
    if (is_standing != nullptr) is_standing->assign(n, 0);
    if (n == 0) return into;
    x_machine.select();
    const PointsView p = upload(points);
    const StandingGrid grid = StandingGrid::of(options);
    std::uint32_t* runs = x_count.room(1);
    withKey(grid.layout, [&](auto key) {
      using Key = decltype(key);
      x_machine.launch("standingKeys", {blocksFor(n, kStandingThreads)}, kStandingThreads, standingKeys<Key>,
                       p, grid, x_sort.template keys<Key>().mixed.room(n), x_sort.order.room(n),
                       x_is_standing.room(n));
      listRunsOf<Key>(grid.layout, n, runs);
    });
    x_machine.wait();
    const std::uint32_t cells = *runs;
    if (cells == 0) return into;
    x_machine.launch(
        "standingOfCells",
        {std::min(kStandingBlocks, blocksFor(std::size_t{simt::kWarp} * cells, kStandingThreads))},
        kStandingThreads, standingOfCells, p, options, x_sort.order_sorted.data(), x_first.data(), cells,
        x_cells.room(kStandingRows * cells), x_standing.room(cells), x_is_standing.data());
    x_cells.download(x_machine, kStandingRows * cells);
    x_standing.download(x_machine, cells);
    if (is_standing != nullptr) x_is_standing.download(x_machine, n);
    x_machine.wait();
    for (std::uint32_t c = 0; c < cells; ++c) {
      const auto row = [&](std::uint32_t r) { return x_cells.host()[r * std::size_t{cells} + c]; };
      if (x_standing.host()[c] > 0)
        append(into, {row(0), row(1), row(2)}, {row(3), row(4), row(5)}, row(6), row(7),
               x_standing.host()[c]);
    }
    if (is_standing != nullptr) takeRow(x_is_standing.host(), n, *is_standing);
    return into;
  }

  std::vector<std::int32_t> clusters(const PointsView& points, float radius_m,
                                     std::vector<std::int32_t> into = {}) override {
    into.clear();
    if (points.size == 0) return into;
    x_machine.select();
    const auto n = static_cast<std::uint32_t>(points.size);
    const PointsView sorted = sortIntoCells(upload(points), NeighbourGrid::over(points, radius_m));
    const std::uint32_t blocks = blocksFor(n, kClusterThreads);
    std::uint32_t* parents = x_parents.room(n);
    x_machine.launch("plantTrees", {blocks}, kClusterThreads, plantTrees, n, parents);
    x_machine.launch("joinTrees", {blocks}, kClusterThreads, joinTrees, sorted, x_sort.order_sorted.data(),
                     x_sort.numbers.data(), x_runs.data(), radius_m * radius_m, parents);
    x_machine.launch("labelTrees", {blocks}, kClusterThreads, labelTrees, n, parents, x_labels.room(n));
    x_labels.download(x_machine, n);
    x_machine.wait();
    takeRow(x_labels.host(), n, into);
    return into;
  }

  PassRunner& passes(const PointsView& source, const CovariancesView& covariances, const VoxelTable& table,
                     const MapMirror* mirror, const MatchOptions& options) override {
    x_machine.select();
    const CovariancesView& C = covariances;
    const float* rows = x_source_covariances.upload(x_machine, {C.xx, C.xy, C.xz, C.yy, C.yz, C.zz}, C.size);
    return x_passes.emplace(*this, upload(source), covarianceRows(rows, C.size), table, mirrorHere(mirror),
                            options);
  }

  PassRunner& passes(const PreparedScan& source, const VoxelTable& table, const MapMirror* mirror,
                     const MatchOptions& options) override {
    if (source.on_device == 0 || source.on_device != x_prepared)
      return passes(source.points.view(), source.covariances.view(), table, mirror, options);
    x_machine.select();
    const std::size_t n = source.points.size();
    const float *points = x_thinned.data(), *covariances = x_covariances.data();
    return x_passes.emplace(*this, pointRows(points, n), covarianceRows(covariances, n), table,
                            mirrorHere(mirror), options);
  }

 private:
  template <class T>
  using Array = typename Machine::template Array<T>;
  template <class T>
  using HostArray = typename Machine::template HostArray<T>;

  class Passes : public PassRunner {
   public:
    /** \param source, covariances  on the device */
    Passes(DeviceBackend& on, const PointsView& source, const CovariancesView& covariances,
           const VoxelTable& table, const DeviceMirror<Machine>& mirror, const MatchOptions& options)
        : x_on(on), x_voxel_size_m(table.voxelSize()), x_options(options) {
      const std::size_t pairs = source.size * static_cast<std::size_t>(options.neighbour_voxels);
      x_input.points = source;
      x_input.covariances = covariances;
      x_input.map = mirror.view();
      x_input.fresh = on.x_pairs[0].room(pairs);
      x_spare = on.x_pairs[1].room(pairs);
      x_blocks = blocksFor(source.size, kPassThreads);
      on.x_partials.room(static_cast<std::size_t>(x_blocks) * kSums);
    }

    Pass run(const Transform& T_map_source) override {
      Pass pass;
      if (x_blocks == 0) return pass;
      Machine& machine = x_on.x_machine;
      machine.select();
      x_input.setup = passSetup(T_map_source, x_voxel_size_m, x_options);
      double* sums = x_on.x_sums.room(kSums);
      machine.launch("vgicpPass", {x_blocks}, kPassThreads, vgicpPass, x_input, x_on.x_partials.data(),
                     x_on.x_blocks_done.data(), sums);
      machine.wait();
      std::copy(sums, sums + kSums, pass.sums.begin());
      return pass;
    }

    void freeze() override {
      x_input.frozen = x_input.fresh;
      std::swap(x_input.fresh, x_spare);
    }

   private:
    DeviceBackend& x_on;
    double x_voxel_size_m;
    MatchOptions x_options;
    PassInput x_input{};
    std::int32_t* x_spare = nullptr;
    std::uint32_t x_blocks = 0;
  };

  const DeviceMirror<Machine>& mirrorHere(const MapMirror* mirror) const {
    const auto* here = dynamic_cast<const DeviceMirror<Machine>*>(mirror);
    if (here == nullptr || here->device() != x_machine.device())
      throw std::invalid_argument("the voxel map was made by the context of another device");
    return *here;
  }

  /** Another one each time, whatever the backend. */
  static std::uint64_t nextPrepared() {
    static std::atomic<std::uint64_t> last{0};
    return ++last;
  }

  PointsView upload(const PointsView& p) {
    return pointRows(x_points.upload(x_machine, {p.x, p.y, p.z}, p.size), p.size);
  }

  /** The scan in x_moved, NaN where a point is dropped; x_sort.flags says which are kept. */
  PointsView moved(const DeskewJob& job) {
    const auto n = static_cast<std::uint32_t>(job.scan.size);
    const PointsOut to = pointRows(x_moved.room(kPointRows * n), n);
    if (n == 0) return to.view(0);
    DeskewJob here = job;
    here.scan = upload(job.scan);
    here.steps = x_steps.upload(x_machine, {job.steps}, job.step_count);
    if (job.time_s != nullptr) here.time_s = x_times.upload(x_machine, {job.time_s}, n);
    x_machine.launch("deskewPoints", {blocksFor(n, kDeskewThreads)}, kDeskewThreads, deskewPoints, here, to,
                     x_sort.flags.room(n));
    return to.view(n);
  }

  /** Of what moved() left behind. */
  Deskewed compacted(const PointsView& scan, Deskewed into) {
    const auto n = static_cast<std::uint32_t>(scan.size);
    if (n == 0) return {};
    x_machine.numberFlags(x_sort, n);
    x_sort.numbers.download(x_machine, 1, n - 1);
    x_machine.wait();
    const std::uint32_t kept = *x_sort.numbers.host();
    const PointsOut to = pointRows(x_kept.room(kPointRows * kept), kept);
    x_machine.launch("compact", {blocksFor(n, kDeskewThreads)}, kDeskewThreads, compact, scan,
                     x_sort.flags.data(), x_sort.numbers.data(),
                     DeskewedOut{to.x, to.y, to.z, x_sort.order.room(kept)});
    x_sort.order.download(x_machine, kept);
    x_kept.download(x_machine, kPointRows * kept);
    x_machine.wait();
    takePoints(x_kept, kept, into.points);
    takeRow(x_sort.order.host(), kept, into.indices);
    return into;
  }

  /** Keys of 32 bits, if they are wide enough for the voxels of a box. */
  static std::optional<KeyLayout> narrowLayout(const Vec3<double>& low_m, const Vec3<double>& high_m,
                                               double voxel_size_m) {
    Cell low{}, high{};
    if (!cellOf(low_m.x, low_m.y, low_m.z, voxel_size_m, low) ||
        !cellOf(high_m.x, high_m.y, high_m.z, voxel_size_m, high))
      return std::nullopt;
    const KeyLayout layout = KeyLayout::of(low, high);
    if (!fits<std::uint32_t>(layout)) return std::nullopt;
    return layout;
  }

  /** One point a voxel in x_thinned; the last of them may still be on their way. \return how many \param p  on the
   * device, at least one point \param layout  of a box with all their voxels */
  std::uint32_t thinned(const PointsView& p, double voxel_size_m, const KeyLayout& layout) {
    const auto n = static_cast<std::uint32_t>(p.size);
    std::uint32_t* voxels = x_count.room(1);
    x_prepared = 0;
    withKey(layout, [&](auto key) {
      using Key = decltype(key);
      x_machine.launch("voxelKeys", {blocksFor(n, kRunThreads)}, kRunThreads, voxelKeys<Key>, p, layout,
                       voxel_size_m, x_sort.template keys<Key>().mixed.room(n), x_sort.order.room(n));
      listRunsOf<Key>(layout, n, voxels);
    });
    x_machine.mark();
    x_machine.launch("centroids",
                     {std::min(kCentroidBlocks, blocksFor(std::size_t{simt::kWarp} * n, kRunThreads))},
                     kRunThreads, centroids, p, x_sort.order_sorted.data(), x_first.data(),
                     x_sort.numbers.data() + (n - 1), x_thinned.room(kPointRows * n));
    x_machine.waitForMark();
    return *voxels;
  }

  /** Of n keys and their order: x_sort.order_sorted, and where each run begins in x_first. \param runs  their number, on
   * the host */
  template <class Key>
  void listRunsOf(const KeyLayout& layout, std::uint32_t n, std::uint32_t* runs) {
    const SortedKeys<Key> sorted =
        sortedKeys<Key>(layout, n, layout.bits + 1);  // one bit more: dropped points come last
    x_machine.launch("listRuns", {blocksFor(n, kRunThreads)}, kRunThreads, listRuns<Key>, sorted,
                     x_sort.numbers.data(), x_first.room(n + 1), runs);
  }

  /** The points by cell, and the nine runs of each cell in x_runs; x_sort.numbers and order_sorted say which cell, and
   * which point it was. \param p  on the device, at least one point \param grid  over them */
  PointsView sortIntoCells(const PointsView& p, const NeighbourGrid& grid) {
    const auto n = static_cast<std::uint32_t>(p.size);
    const PointsOut sorted_points = pointRows(x_sorted.room(kPointRows * n), n);
    withKey(grid.layout, [&](auto key) {
      using Key = decltype(key);
      x_machine.launch("cellKeys", {blocksFor(n, kRunThreads)}, kRunThreads, cellKeys<Key>, p, grid,
                       x_sort.template keys<Key>().mixed.room(n), x_sort.order.room(n));
      const SortedKeys<Key> sorted = sortedKeys<Key>(grid.layout, n, grid.layout.bits);
      Key* cell_keys = x_sort.template keys<Key>().mixed.room(n);
      x_machine.launch("listCells", {blocksFor(n, kRunThreads)}, kRunThreads, listCells<Key>, p, sorted,
                       x_sort.order_sorted.data(), x_sort.numbers.data(), cell_keys, x_first.room(n),
                       sorted_points);
      const std::size_t rows = std::size_t{n} * kRowsAround;  // at most
      x_machine.launch("findRuns", {blocksFor(rows, kRunThreads)}, kRunThreads, findRuns<Key>, grid,
                       cell_keys, x_first.data(), x_sort.numbers.data() + (n - 1), n, x_runs.room(rows));
    });
    return sorted_points.view(n);
  }

  /** Launches what leaves covariances in x_covariances and x_neighbours. \param p  on the device, at least one point
   * \param grid  over them */
  void startCovariances(const PointsView& p, const NeighbourGrid& grid, const CovarianceOptions& options) {
    const auto n = static_cast<std::uint32_t>(p.size);
    x_prepared = 0;
    const PointsView sorted_points = sortIntoCells(p, grid);
    const CovariancesOut out =
        covarianceRows(x_covariances.room(kCovarianceRows * n), n, x_neighbours.room(n));
    withWeight<float>(options, [&](const auto& weightOf) {
      x_machine.launch("covarianceOfPoints", {blocksFor(std::size_t{kThreadsAPoint} * n, kCovarianceThreads)},
                       kCovarianceThreads, covarianceOfPoints<std::decay_t<decltype(weightOf)>>,
                       sorted_points, x_sort.order_sorted.data(), x_sort.numbers.data(), x_runs.data(),
                       CovarianceSetup::of(options), weightOf, out);
    });
    x_covariances.download(x_machine, kCovarianceRows * n);
    x_neighbours.download(x_machine, n);
  }

  /** What startCovariances() left behind. */
  void takeCovariances(std::size_t n, Covariances& into) {
    x_machine.wait();
    const float* row = x_covariances.host();
    for (auto* entries : {&into.xx, &into.xy, &into.xz, &into.yy, &into.yz, &into.zz}) {
      takeRow(row, n, *entries);
      row += n;
    }
    takeRow(x_neighbours.host(), n, into.neighbours);
  }

  static void takePoints(const Array<float>& downloaded, std::size_t n, Points& into) {
    const float* row = downloaded.host();
    for (auto* axis : {&into.x, &into.y, &into.z}) {
      takeRow(row, n, *axis);
      row += n;
    }
  }

  VoxelBox boxOf(const PointsView& p, double voxel_size_m) {
    const std::uint32_t blocks = std::min(kBoxBlocks, blocksFor(p.size, kRunThreads));
    const std::size_t warps = std::size_t{blocks} * (kRunThreads / simt::kWarp);
    VoxelBox all;
    if (blocks == 0) return all;
    VoxelBox* boxes = x_boxes.room(warps);
    x_machine.launch("voxelBoxes", {blocks}, kRunThreads, voxelBoxes, p, voxel_size_m, boxes);
    x_machine.wait();
    for (std::size_t w = 0; w < warps; ++w) all.add(boxes[w]);
    return all;
  }

  /** Sorts n keys by their lowest bits and numbers their runs. */
  template <class Key>
  SortedKeys<Key> sortedKeys(const KeyLayout& layout, std::uint32_t n, int bits) {
    x_machine.template sortPairs<Key>(x_sort, n, bits);
    const SortedKeys<Key> sorted{x_sort.template keys<Key>().sorted.data(), n,
                                 static_cast<Key>(Key{1} << layout.bits)};
    x_machine.numberRuns(x_sort, sorted);
    return sorted;
  }

  Machine x_machine;
  Array<float> x_points, x_times;  ///< the caller's
  Array<float> x_moved, x_kept;    ///< the scan at the end of its sweep; what is kept of it
  Array<float> x_thinned;          ///< one point a voxel
  Array<float> x_sorted;           ///< by cell
  Array<float> x_covariances, x_source_covariances;
  std::uint64_t x_prepared = 0;  ///< whose points and covariances x_thinned and x_covariances are
  Array<SweepStep> x_steps;
  SortBuffers<Machine> x_sort;
  HostArray<VoxelBox> x_boxes;
  HostArray<std::uint32_t> x_count;
  Array<std::uint32_t> x_first;  ///< of each run
  Array<Run> x_runs;
  Array<std::int32_t> x_neighbours;
  Array<float> x_cells;  ///< in which something stands
  Array<std::int32_t> x_standing, x_labels;
  Array<unsigned char> x_is_standing;
  Array<std::uint32_t> x_parents;
  std::array<Array<std::int32_t>, 2> x_pairs;
  Array<double> x_partials;
  Array<std::uint32_t> x_blocks_done;  ///< one counter, 0 between launches
  HostArray<double> x_sums;
  std::optional<Passes> x_passes;
};

}  // namespace raceloc::gpu
