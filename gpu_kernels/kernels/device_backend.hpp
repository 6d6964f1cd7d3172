/** \file
 * The backend of a machine that runs the kernels: which one when, on which arrays. CUDA and the emulator of the
 * tests share it. A Machine has
 *   Array<T>: room(n), data(); upload(machine, from, n); download(machine, n, from), by the next wait() at host()
 *   launch(name, blocks, threads, kernel, arguments...), wait(), select(), device(), description()
 *   sortPairs(SortBuffers&, n, bits), numberRuns(SortBuffers&, n)
 * The host keeps the master of every voxel map. */
#pragma once

#include <algorithm>
#include <array>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "api/voxel_table.hpp"
#include "core/backend.hpp"
#include "core/weight.hpp"
#include "kernels/covariance.kernel.hpp"
#include "kernels/deskew.kernel.hpp"
#include "kernels/sort_buffers.hpp"
#include "kernels/sorted_runs.kernel.hpp"
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
    x_view = {x_slots.upload(x_machine, table.slots().data(), table.slots().size()),
              x_records.upload(x_machine, table.records().data(), table.records().size()), table.shift()};
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
    fetch(simt::kWarp, there);
    for (std::uint32_t i = 0; i < simt::kWarp; ++i) {
      if (there.host()[i] != 3 * i + 1)
        throw DeviceError("test launch: a wrong answer from " + x_machine.description());
    }
  }

  [[nodiscard]] Backend kind() const override { return Backend::cuda; }
  [[nodiscard]] std::string description() const override { return x_machine.description(); }
  std::unique_ptr<MapMirror> mirror() override { return std::make_unique<DeviceMirror<Machine>>(x_machine); }

  Deskewed deskew(const DeskewJob& job) override {
    const auto n = static_cast<std::uint32_t>(job.scan.size);
    if (n == 0) return {};
    x_machine.select();
    DeskewJob here = job;
    here.scan = x_points.upload(x_machine, job.scan);
    here.steps = x_steps.upload(x_machine, job.steps, job.step_count);
    if (job.time_s != nullptr) here.time_s = x_times.upload(x_machine, job.time_s, n);
    const auto moved = x_sorted.room(n);
    x_machine.launch("deskewPoints", {blocksFor(n, kDeskewThreads)}, kDeskewThreads, deskewPoints, here,
                     moved[0], moved[1], moved[2], x_sort.heads.room(n));
    x_machine.numberRuns(x_sort, n);
    const auto to = x_points.room(n);  // the scan has served
    x_machine.launch("compact", {blocksFor(n, kDeskewThreads)}, kDeskewThreads, compact,
                     PointsView{moved[0], moved[1], moved[2], n}, x_sort.heads.data(), x_sort.numbers.data(),
                     DeskewedOut{to[0], to[1], to[2], x_sort.order.room(n)});
    const std::uint32_t kept = lastNumber(n);
    fetch(kept, x_points.x, x_points.y, x_points.z, x_sort.order);
    const auto taken = [kept](const auto& array) { return std::vector(array.host(), array.host() + kept); };
    return {{taken(x_points.x), taken(x_points.y), taken(x_points.z)}, taken(x_sort.order)};
  }

  Points voxelGrid(const PointsView& points, double voxel_size_m, std::size_t& dropped) override {
    const VoxelExtent extent = voxelExtent(points, voxel_size_m);
    const auto n = static_cast<std::uint32_t>(points.size), kept = static_cast<std::uint32_t>(extent.kept);
    dropped = points.size - extent.kept;
    if (kept == 0) return {};
    x_machine.select();
    const PointsView p = x_points.upload(x_machine, points);
    x_machine.launch("voxelKeys", {blocksFor(n, kRunThreads)}, kRunThreads, voxelKeys, p, extent.layout,
                     voxel_size_m, x_sort.keys.room(n), x_sort.order.room(n));
    x_machine.sortPairs(x_sort, n, extent.layout.bits + 1);  // one bit more: dropped points come last
    const std::uint32_t voxels = numberedRuns(kept);
    const auto to = x_sorted.room(voxels);
    x_machine.launch("centroids", {blocksFor(kept, kRunThreads)}, kRunThreads, centroids, p,
                     x_sort.keys_sorted.data(), x_sort.order_sorted.data(), x_sort.numbers.data(), kept,
                     to[0], to[1], to[2]);
    fetch(voxels, x_sorted.x, x_sorted.y, x_sorted.z);
    const auto taken = [voxels](const auto& array) {
      return std::vector(array.host(), array.host() + voxels);
    };
    return {taken(x_sorted.x), taken(x_sorted.y), taken(x_sorted.z)};
  }

  Covariances covariances(const PointsView& points, const CovarianceOptions& options) override {
    const auto n = static_cast<std::uint32_t>(points.size);
    if (n == 0) return {};
    x_machine.select();
    const NeighbourGrid grid = NeighbourGrid::over(points, options.radius_m);
    const PointsView p = x_points.upload(x_machine, points);
    x_machine.launch("cellKeys", {blocksFor(n, kRunThreads)}, kRunThreads, cellKeys, p, grid,
                     x_sort.keys.room(n), x_sort.order.room(n));
    x_machine.sortPairs(x_sort, n, grid.layout.bits);
    const std::uint32_t cells = numberedRuns(n);
    const auto sorted = x_sorted.room(n);
    x_machine.launch("listCells", {blocksFor(n, kRunThreads)}, kRunThreads, listCells, p,
                     x_sort.keys_sorted.data(), x_sort.order_sorted.data(), x_sort.numbers.data(),
                     x_cell_keys.room(cells), x_cell_first.room(cells), sorted[0], sorted[1], sorted[2]);
    const std::size_t rows = static_cast<std::size_t>(cells) * kRowsAround;
    x_machine.launch("findRuns", {blocksFor(rows, kRunThreads)}, kRunThreads, findRuns, grid,
                     x_cell_keys.data(), x_cell_first.data(), cells, n, x_runs.room(rows));
    CovarianceBuffers& C = x_covariances;
    withWeight<float>(options, [&](const auto& weightOf) {
      x_machine.launch("covarianceOfPoints", {blocksFor(n, kCovarianceThreads)}, kCovarianceThreads,
                       covarianceOfPoints<std::decay_t<decltype(weightOf)>>,
                       PointsView{sorted[0], sorted[1], sorted[2], n}, x_sort.order_sorted.data(),
                       x_sort.numbers.data(), x_runs.data(), CovarianceSetup::of(options), weightOf,
                       C.room(n));
    });
    fetch(n, C.xx, C.xy, C.xz, C.yy, C.yz, C.zz, C.neighbours);
    const auto taken = [n](const auto& array) { return std::vector(array.host(), array.host() + n); };
    return {taken(C.xx), taken(C.xy), taken(C.xz),        taken(C.yy),
            taken(C.yz), taken(C.zz), taken(C.neighbours)};
  }

  PassRunner& passes(const PointsView& source, const CovariancesView& covariances, const VoxelTable& table,
                     const MapMirror* mirror, const MatchOptions& options) override {
    const auto* here = dynamic_cast<const DeviceMirror<Machine>*>(mirror);
    if (here == nullptr || here->device() != x_machine.device())
      throw std::invalid_argument("the voxel map was made by the context of another device");
    x_machine.select();
    return x_passes.emplace(*this, source, covariances, table, *here, options);
  }

 private:
  template <class T>
  using Array = typename Machine::template Array<T>;

  struct PointBuffers {
    Array<float> x, y, z;

    PointsView upload(Machine& machine, const PointsView& p) {
      return {x.upload(machine, p.x, p.size), y.upload(machine, p.y, p.size), z.upload(machine, p.z, p.size),
              p.size};
    }
    std::array<float*, 3> room(std::size_t n) { return {x.room(n), y.room(n), z.room(n)}; }
  };

  struct CovarianceBuffers {
    Array<float> xx, xy, xz, yy, yz, zz;
    Array<std::int32_t> neighbours;

    CovariancesView upload(Machine& m, const CovariancesView& C) {
      const std::size_t n = C.size;
      return {xx.upload(m, C.xx, n),
              xy.upload(m, C.xy, n),
              xz.upload(m, C.xz, n),
              yy.upload(m, C.yy, n),
              yz.upload(m, C.yz, n),
              zz.upload(m, C.zz, n),
              n};
    }
    CovariancesOut room(std::size_t n) {
      return {xx.room(n), xy.room(n), xz.room(n), yy.room(n), yz.room(n), zz.room(n), neighbours.room(n)};
    }
  };

  class Passes : public PassRunner {
   public:
    Passes(DeviceBackend& on, const PointsView& source, const CovariancesView& covariances,
           const VoxelTable& table, const DeviceMirror<Machine>& mirror, const MatchOptions& options)
        : x_on(on), x_voxel_size_m(table.voxelSize()), x_options(options) {
      const std::size_t pairs = source.size * static_cast<std::size_t>(options.neighbour_voxels);
      x_input.points = on.x_points.upload(on.x_machine, source);
      x_input.covariances = on.x_covariances.upload(on.x_machine, covariances);
      x_input.map = mirror.view();
      x_input.fresh = on.x_pairs[0].room(pairs);
      x_spare = on.x_pairs[1].room(pairs);
      x_blocks = blocksFor(source.size, kPassThreads);
      on.x_partials.room(static_cast<std::size_t>(x_blocks) * kSums);
      on.x_sums.room(kSums);
    }

    Pass run(const Transform& T_map_source) override {
      Pass pass;
      if (x_blocks == 0) return pass;
      Machine& machine = x_on.x_machine;
      machine.select();
      x_input.setup = passSetup(T_map_source, x_voxel_size_m, x_options);
      machine.launch("vgicpPass", {x_blocks}, kPassThreads, vgicpPass, x_input, x_on.x_partials.data());
      machine.launch("addPartials", {1}, simt::kWarp, addPartials, x_on.x_partials.data(), x_blocks,
                     x_on.x_sums.data());
      x_on.fetch(kSums, x_on.x_sums);
      std::copy(x_on.x_sums.host(), x_on.x_sums.host() + kSums, pass.sums.begin());
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

  /** Numbers the runs of the first n sorted keys; returns how many there are. */
  std::uint32_t numberedRuns(std::uint32_t n) {
    x_machine.launch("markHeads", {blocksFor(n, kRunThreads)}, kRunThreads, markHeads,
                     x_sort.keys_sorted.data(), n, x_sort.heads.room(n));
    x_machine.numberRuns(x_sort, n);
    return lastNumber(n);
  }

  std::uint32_t lastNumber(std::uint32_t n) {
    x_sort.numbers.download(x_machine, 1, n - 1);
    x_machine.wait();
    return *x_sort.numbers.host();
  }

  /** The first n elements of each array are then at its host(). */
  template <class... Arrays>
  void fetch(std::size_t n, Arrays&... arrays) {
    (arrays.download(x_machine, n), ...);
    x_machine.wait();
  }

  Machine x_machine;
  PointBuffers x_points, x_sorted;
  Array<float> x_times;
  Array<SweepStep> x_steps;
  CovarianceBuffers x_covariances;
  SortBuffers<Machine> x_sort;
  Array<std::uint64_t> x_cell_keys;
  Array<std::uint32_t> x_cell_first;
  Array<Run> x_runs;
  std::array<Array<std::int32_t>, 2> x_pairs;
  Array<double> x_partials, x_sums;
  std::optional<Passes> x_passes;
};

}  // namespace raceloc::gpu
