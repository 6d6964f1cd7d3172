/** \file
 * The bodies of core/ in plain loops: one thread, the compiler's own vectors. */
#if defined(__SSE2__)
#include <pmmintrin.h>
#include <xmmintrin.h>
#endif

#include <utility>

#include "api/voxel_table.hpp"
#include "core/backend.hpp"
#include "core/neighbour_grid.hpp"
#include "core/voxel_grid.hpp"
#include "core/weight.hpp"
#include "cpu/radix_sort.hpp"

namespace raceloc::gpu {

namespace {

/** Denormal floats count as 0 within a scope: the last Jacobi products are denormal, and slow. */
class FlushDenormals {
#if defined(__SSE2__)
 public:
  FlushDenormals() : x_before(_mm_getcsr()) {
    _mm_setcsr(x_before | _MM_FLUSH_ZERO_ON | _MM_DENORMALS_ZERO_ON);
  }
  ~FlushDenormals() { _mm_setcsr(x_before); }
  FlushDenormals(const FlushDenormals&) = delete;
  FlushDenormals& operator=(const FlushDenormals&) = delete;

 private:
  unsigned x_before;
#else
 public:
  FlushDenormals() {}
#endif
};

Sym3<float> at(const CovariancesView& C, std::size_t i) {
  return {C.xx[i], C.xy[i], C.xz[i], C.yy[i], C.yz[i], C.zz[i]};
}

void resize(Points& p, std::size_t n) {
  for (auto* v : {&p.x, &p.y, &p.z}) v->resize(n);
}

void resize(Covariances& C, std::size_t n) {
  for (auto* v : {&C.xx, &C.xy, &C.xz, &C.yy, &C.yz, &C.zz}) v->resize(n);
  C.neighbours.resize(n);
}

void set(Covariances& out, std::size_t i, const Sym3<float>& C, std::int32_t neighbours) {
  out.xx[i] = C.xx, out.xy[i] = C.xy, out.xz[i] = C.xz;
  out.yy[i] = C.yy, out.yz[i] = C.yz, out.zz[i] = C.zz;
  out.neighbours[i] = neighbours;
}

class CpuPasses : public PassRunner {
 public:
  CpuPasses(const PointsView& source, const CovariancesView& covariances, const VoxelTable& table,
            const MatchOptions& options)
      : x_source(source),
        x_covariances(covariances),
        x_table(table),
        x_options(options),
        x_fresh(source.size * static_cast<std::size_t>(options.neighbour_voxels)) {}

  Pass run(const Transform& T_map_source, bool with_distance) override {
    return with_distance ? runAs<true>(T_map_source) : runAs<false>(T_map_source);
  }

  void freeze() override {
    x_frozen.resize(x_fresh.size());
    x_frozen.swap(x_fresh);
  }

 private:
  /** Floats over a block of points, doubles over the blocks: as exact as double, as quick as float. */
  template <bool WithDistance>
  Pass runAs(const Transform& T_map_source) {
    constexpr std::size_t block = 128;
    const FlushDenormals flush;
    const PassSetup setup = passSetup(T_map_source, x_table.voxelSize(), x_options);
    const VoxelMapView map = x_table.view();
    Pass pass;
    for (std::size_t first = 0; first < x_source.size; first += block) {
      std::array<float, kSums> sums{};
      for (std::size_t i = first; i < std::min(first + block, x_source.size); ++i) {
        passPoint<WithDistance>(setup, map, {x_source.x[i], x_source.y[i], x_source.z[i]},
                                at(x_covariances, i), x_source.size,
                                x_frozen.empty() ? nullptr : &x_frozen[i], &x_fresh[i], sums.data());
      }
      for (std::size_t k = 0; k < kSums; ++k) pass.sums[k] += static_cast<double>(sums[k]);
    }
    return pass;
  }

  PointsView x_source;
  CovariancesView x_covariances;
  const VoxelTable& x_table;
  MatchOptions x_options;
  std::vector<std::int32_t> x_fresh, x_frozen;
};

class CpuBackend : public BackendBase {
 public:
  [[nodiscard]] Backend kind() const override { return Backend::cpu; }
  [[nodiscard]] std::string description() const override { return "CPU, one thread"; }
  std::unique_ptr<MapMirror> mirror() override { return nullptr; }

  Points voxelGrid(const PointsView& points, double voxel_size_m, std::size_t& dropped) override {
    const VoxelExtent extent = voxelExtent(points, voxel_size_m);
    dropped = points.size - extent.kept;
    x_items.clear();
    for (std::size_t i = 0; i < points.size; ++i) {
      const std::uint64_t key = voxelKey(extent.layout, voxel_size_m, points.x[i], points.y[i], points.z[i]);
      if ((key >> extent.layout.bits) == 0) x_items.push_back({key, static_cast<std::uint32_t>(i)});
    }
    sortItems(extent.layout.bits);
    Points out;
    for (std::size_t first = 0, last = 0; first < x_items.size(); first = last) {
      while (last < x_items.size() && x_items[last].key == x_items[first].key) ++last;
      const Vec3<float> mean = centroid(points, x_order.data(), first, last);
      out.x.push_back(mean.x);
      out.y.push_back(mean.y);
      out.z.push_back(mean.z);
    }
    return out;
  }

  Covariances covariances(const PointsView& points, const CovarianceOptions& options) override {
    const FlushDenormals flush;
    const NeighbourGrid grid = NeighbourGrid::over(points, options.radius_m);
    x_items.clear();
    for (std::size_t i = 0; i < points.size; ++i) {
      const Cell cell = grid.cell(points.x[i], points.y[i], points.z[i]);
      x_items.push_back({grid.layout.key(cell), static_cast<std::uint32_t>(i)});
    }
    sortItems(grid.layout.bits);
    resize(x_sorted, points.size);
    for (std::size_t k = 0; k < points.size; ++k) {
      const std::uint32_t i = x_order[k];
      x_sorted.x[k] = points.x[i], x_sorted.y[k] = points.y[i], x_sorted.z[k] = points.z[i];
    }
    Covariances out;
    resize(out, points.size);
    withWeight<float>(options, [&](const auto& weightOf) { covariancesWith(grid, options, weightOf, out); });
    return out;
  }

  std::unique_ptr<PassRunner> passes(const PointsView& source, const CovariancesView& covariances,
                                     const VoxelTable& table, const MapMirror*,
                                     const MatchOptions& options) override {
    return std::make_unique<CpuPasses>(source, covariances, table, options);
  }

 private:
  void sortItems(int bits) {
    radixSort(x_items, x_scratch, bits);
    x_order.resize(x_items.size());
    for (std::size_t k = 0; k < x_items.size(); ++k) x_order[k] = x_items[k].index;
  }

  /** Walks the cells in order; the nine rows around a cell only ever move forward, so nothing is searched. */
  template <class WeightOf>
  void covariancesWith(const NeighbourGrid& grid, const CovarianceOptions& options, const WeightOf& weightOf,
                       Covariances& out) const {
    const CovarianceSetup setup = CovarianceSetup::of(options);
    const PointsView sorted = x_sorted.view();
    const std::size_t n = x_items.size();
    Run runs[kRowsAround] = {};
    for (std::size_t first = 0, last = 0; first < n; first = last) {
      const std::uint64_t key = x_items[first].key;
      while (last < n && x_items[last].key == key) ++last;
      for (int row = 0; row < kRowsAround; ++row) {
        Run& run = runs[row];
        const std::uint64_t low = grid.rowKey(key, row), high = low + 2;
        while (run.first < n && x_items[run.first].key < low) ++run.first;
        run.last = std::max(run.last, run.first);
        while (run.last < n && x_items[run.last].key <= high) ++run.last;
      }
      for (std::size_t k = first; k < last; ++k) {
        const Vec3<float> q{sorted.x[k], sorted.y[k], sorted.z[k]};
        std::int32_t neighbours = 0;
        const Sym3<float> C = covarianceAt(q, sorted, runs, setup, weightOf, neighbours);
        set(out, x_order[k], C, neighbours);
      }
    }
  }

  std::vector<KeyedIndex> x_items, x_scratch;  // buffers, kept from call to call
  std::vector<std::uint32_t> x_order;
  Points x_sorted;
};

}  // namespace

std::unique_ptr<BackendBase> makeCpuBackend() { return std::make_unique<CpuBackend>(); }

}  // namespace raceloc::gpu
