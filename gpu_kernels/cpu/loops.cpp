/** \file
 * Compiled once for each instruction set, with GK_ISA as its name: nothing here may be shared between them, so
 * there are no functions of the standard library, and what comes from core/ is always inlined. */
#include "cpu/loops.hpp"

#include "core/weight.hpp"
#include "cpu/box_search.hpp"
#include "cpu/lanes.hpp"

namespace raceloc::gpu::GK_ISA {

namespace {

/** Sum of 16 floats as a tree. */
RACELOC_HD float sumOfLanes(const float* a) {
  using Four = float __attribute__((vector_size(16)));
  Four q[4];
  __builtin_memcpy(q, a, sizeof(q));
  const Four s = (q[0] + q[1]) + (q[2] + q[3]);
  return (s[0] + s[2]) + (s[1] + s[3]);
}

constexpr int kMomentRows = 11;

/** Moments of up to `kBatch` points, each row one sum; finished together, a point a lane. */
class MomentBatch {
 public:
  MomentBatch(const CovarianceOptions& options, const CovariancesOut& out)
      : x_out(out), x_setup(CovarianceSetup::of(options)) {}

  /** Takes a point's moments, still in lanes: 11 rows of 16. */
  void take(const float (&rows)[kMomentRows][kLanes], std::uint32_t to) {
    float sums[kMomentRows];
    for (int r = 0; r < kMomentRows; ++r) sums[r] = sumOfLanes(rows[r]);
    take(sums, to);
  }

  void take(const float (&sums)[kMomentRows], std::uint32_t to) {
    for (int r = 0; r < kMomentRows; ++r) x_rows[r][x_filled] = sums[r];
    x_to[x_filled++] = to;
    if (x_filled == kBatch) finish();
  }

  void finish() {
    const int filled = x_filled;
    for (; x_filled % kLanes != 0; ++x_filled)
      for (int r = 0; r < kMomentRows; ++r) x_rows[r][x_filled] = r == 0 ? 1.0F : 0.0F;
    alignas(64) float C[6][kBatch];
    for (int i = 0; i < x_filled; i += kWidth) {
      const auto row = [&](int r) { return load(&x_rows[r][i]); };
      const Moments<F> m{
          row(0), {row(1), row(2), row(3)}, {row(4), row(5), row(6), row(7), row(8), row(9)}, row(10)};
      const Sym3<F> c = finished(m, x_setup);
      store(&C[0][i], c.xx), store(&C[1][i], c.xy), store(&C[2][i], c.xz);
      store(&C[3][i], c.yy), store(&C[4][i], c.yz), store(&C[5][i], c.zz);
    }
    for (int i = 0; i < filled; ++i) {
      const std::uint32_t to = x_to[i];
      x_out.xx[to] = C[0][i], x_out.xy[to] = C[1][i], x_out.xz[to] = C[2][i];
      x_out.yy[to] = C[3][i], x_out.yz[to] = C[4][i], x_out.zz[to] = C[5][i];
      x_out.neighbours[to] = static_cast<std::int32_t>(x_rows[10][i]);
    }
    x_filled = 0;
  }

 private:
  static constexpr int kBatch = 64;
  alignas(64) float x_rows[kMomentRows][kBatch];
  std::uint32_t x_to[kBatch];
  const CovariancesOut& x_out;
  CovarianceSetup x_setup;
  int x_filled = 0;
};

/** Copies [first, last) and up to kWidth - 1 more. */
RACELOC_HD void copyLanes(const float* from, float* to, std::uint32_t count) {
  for (std::uint32_t i = 0; i < count; i += kWidth) store(to + i, load(from + i));
}

/** The candidates of a cell, gathered once, then a point at a time with the candidates in lanes. */
template <class WeightOf>
RACELOC_HD void covariancesWith(const CovarianceJob& job, std::uint32_t first, std::uint32_t last, float* x,
                                std::size_t stride, const WeightOf& weightOf) {
  constexpr float nowhere_m = 1e9F;  // far outside any radius, and its square is finite
  float *y = x + stride, *z = y + stride;
  const F squared_radius_m2(job.options.radius_m * job.options.radius_m);
  MomentBatch batch(job.options, job.out);
  for (std::uint32_t cell = first; cell < last; ++cell) {
    std::uint32_t count = 0;
    for (int row = 0; row < kRowsAround; ++row) {
      const Run run = job.runs[static_cast<std::size_t>(cell) * kRowsAround + static_cast<std::size_t>(row)];
      const std::uint32_t length = run.last - run.first;
      copyLanes(job.x + run.first, x + count, length);
      copyLanes(job.y + run.first, y + count, length);
      copyLanes(job.z + run.first, z + count, length);
      count += length;
    }
    for (int i = 0; i < kLanes; i += kWidth) {
      store(x + count + i, F(nowhere_m)), store(y + count + i, F(nowhere_m)),
          store(z + count + i, F(nowhere_m));
    }
    for (std::uint32_t k = job.cell_first[cell]; k < job.cell_first[cell + 1]; ++k) {
      const Vec3<F> q{F(job.x[k]), F(job.y[k]), F(job.z[k])};
      alignas(64) float rows[kMomentRows][kLanes];
      for (int part = 0; part < kParts; ++part) {
        Moments<F> m;
        for (std::uint32_t j = static_cast<std::uint32_t>(part * kWidth); j < count; j += kLanes)
          m.add(Vec3<F>{load(x + j), load(y + j), load(z + j)} - q, squared_radius_m2, weightOf);
        const int at = part * kWidth;
        store(&rows[0][at], m.weight);
        store(&rows[1][at], m.first.x), store(&rows[2][at], m.first.y), store(&rows[3][at], m.first.z);
        store(&rows[4][at], m.second.xx), store(&rows[5][at], m.second.xy), store(&rows[6][at], m.second.xz);
        store(&rows[7][at], m.second.yy), store(&rows[8][at], m.second.yz), store(&rows[9][at], m.second.zz);
        store(&rows[10][at], m.neighbours);
      }
      batch.take(rows, job.order[k]);
    }
  }
  batch.finish();
}

void covariances(const CovarianceJob& job, std::uint32_t first, std::uint32_t last, float* scratch,
                 std::size_t scratch_stride) {
  withWeight<F>(job.options, [&](const auto& weightOf) {
    covariancesWith(job, first, last, scratch, scratch_stride, weightOf);
  });
}

void nearestCovariances(const NearestCovarianceJob& job, std::size_t first, std::size_t last) {
  MomentBatch batch(job.options, job.out);
  const PointsView& p = job.points;
  for (std::size_t i = first; i < last; ++i) {
    const Vec3<float> q{p.x[i], p.y[i], p.z[i]};
    Neighbour found[kMostNearest];
    nearestOf(job.tree, q, job.options.nearest, found);
    Moments<float> m;
    for (int k = 0; k < job.options.nearest; ++k) {
      const std::int32_t j = found[k].index;
      if (j == INT32_MAX) break;
      const auto unit = [](float, float) { return 1.0F; };
      m.add({p.x[j] - q.x, p.y[j] - q.y, p.z[j] - q.z}, 1e30F, unit);
    }
    batch.take({m.weight, m.first.x, m.first.y, m.first.z, m.second.xx, m.second.xy, m.second.xz, m.second.yy,
                m.second.yz, m.second.zz, m.neighbours},
               static_cast<std::uint32_t>(i));
  }
  batch.finish();
}

/** Voxel Gaussians of 16 points in lanes. */
struct Gaussians {
  alignas(64) std::int32_t record[kLanes];  ///< -1: none, the rest is then that of kNothing
  alignas(64) float rows[12][kLanes];       ///< a VoxelRecord's words: offset, covariance, cell

  void gather(const VoxelMapView& map) {
    static_assert(sizeof(VoxelRecord) == 12 * sizeof(float));
    for (int lane = 0; lane < kLanes; lane += 4)
      for (int word = 0; word < 12; word += 4) transpose4(map, lane, word);
  }

 private:
  /** Words [word, word + 4) of the records of lanes [lane, lane + 4). */
  RACELOC_HD void transpose4(const VoxelMapView& map, int lane, int word) {
    static constexpr VoxelRecord kNothing{{0, 0, 0}, {1, 0, 0, 1, 0, 1}, {0, 0, 0}};
    using Four = float __attribute__((vector_size(16)));
    Four r[4];
    for (int k = 0; k < 4; ++k) {
      const VoxelRecord* from = record[lane + k] >= 0 ? &map.records[record[lane + k]] : &kNothing;
      __builtin_memcpy(&r[k], reinterpret_cast<const char*>(from) + word * sizeof(float), sizeof(Four));
    }
    const Four low_a = __builtin_shufflevector(r[0], r[1], 0, 4, 1, 5);
    const Four low_b = __builtin_shufflevector(r[2], r[3], 0, 4, 1, 5);
    const Four high_a = __builtin_shufflevector(r[0], r[1], 2, 6, 3, 7);
    const Four high_b = __builtin_shufflevector(r[2], r[3], 2, 6, 3, 7);
    const Four columns[4] = {__builtin_shufflevector(low_a, low_b, 0, 1, 4, 5),
                             __builtin_shufflevector(low_a, low_b, 2, 3, 6, 7),
                             __builtin_shufflevector(high_a, high_b, 0, 1, 4, 5),
                             __builtin_shufflevector(high_a, high_b, 2, 3, 6, 7)};
    for (int k = 0; k < 4; ++k) __builtin_memcpy(&rows[word + k][lane], &columns[k], sizeof(Four));
  }
};

/** Source points in lanes. */
struct Source {
  Vec3<F> p;
  Sym3<F> C;
};

/** The pass's numbers, each in all lanes. */
struct Setup {
  explicit Setup(const PassSetup& s)
      : setup(s),
        R{F(s.R_map_source.xx), F(s.R_map_source.xy), F(s.R_map_source.xz),
          F(s.R_map_source.yx), F(s.R_map_source.yy), F(s.R_map_source.yz),
          F(s.R_map_source.zx), F(s.R_map_source.zy), F(s.R_map_source.zz)},
        t_m{F(s.t_m.x), F(s.t_m.y), F(s.t_m.z)},
        voxel_m(s.voxel_m),
        voxels_per_m(s.voxels_per_m) {}
  const PassSetup& setup;
  Mat3<F> R;
  Vec3<F> t_m;
  F voxel_m, voxels_per_m;

  RACELOC_HD Vec3<F> moved(const Vec3<F>& p) const { return R * p + t_m; }

  RACELOC_HD Whitened<F> pair(const Source& source, const Gaussians& g, int at) const {
    const auto row = [&](int r) { return load(&g.rows[r][at]); };
    const auto centre = [&](int axis, std::int32_t anchor) {
      return (toFloats(bitsOf(row(9 + axis)) - anchor) + F(0.5)) * voxel_m;
    };
    const Vec3<F> mean =
        Vec3<F>{centre(0, setup.anchor.x), centre(1, setup.anchor.y), centre(2, setup.anchor.z)} +
        Vec3<F>{row(0), row(1), row(2)};
    const Sym3<F> C_map{row(3), row(4), row(5), row(6), row(7), row(8)};
    return whitened(transposed(R), source.p, source.C, mean - t_m, C_map);
  }
};

/** A group of 16 points. The scalar twin of this is passPoint(). */
class PassGroup {
 public:
  /** \param before of the pass before, null in the first */
  PassGroup(const PassJob& job, const Setup& setup, const Setup* before, F (*sums)[kSums])
      : x_job(job), x_setup(setup), x_before(before), x_sums(sums) {}

  void run(std::size_t first, int count) {
    x_first = first;
    x_count = count;
    readSource();
    findCells();
    M inlier[kParts];
    for (M& m : inlier) m.v = Ints{};
    for (std::int32_t k = 0; k < x_setup.setup.voxels_around; ++k) {
      if (x_job.tree == nullptr) {
        lookUp(k);
      } else {
        findNearest();
      }
      std::int32_t* fresh = x_job.fresh + static_cast<std::size_t>(k) * x_job.points.size + first;
      M found[kParts];
      F squared[kParts];
      alignas(64) std::int32_t taken[kLanes];
      for (int part = 0; part < kParts; ++part) {
        const int at = part * kWidth;
        const Source source = sourceAt(at);
        const Whitened<F> w = x_setup.pair(source, x_gaussians, at);
        const Ints record = loadInts(&x_gaussians.record[at]);
        const M near = dot(w.e, w.e) <= F(x_setup.setup.squared_max_distance_m2);
        found[part] = w.valid & near & M{record >= 0};
        const Whitened<F> counted = countedIf(found[part], w);
        squared[part] = counted.squared;
        addPair(counted, source.p, x_setup.setup.robust, x_sums[part]);
        inlier[part] = inlier[part] | found[part];
        storeInts(&taken[at], found[part].v ? record : Ints{} - 1);
      }
      for (int lane = 0; lane < count; ++lane) fresh[lane] = taken[lane];
      if (x_job.frozen != nullptr)
        addFrozen(x_job.frozen + static_cast<std::size_t>(k) * x_job.points.size + first, taken, squared);
    }
    for (int part = 0; part < kParts; ++part) x_sums[part][kInliers] += select(inlier[part], F(1), F(0));
  }

 private:
  void readSource() {
    const CovariancesView& C = x_job.covariances;
    const float* rows[9] = {x_job.points.x, x_job.points.y, x_job.points.z, C.xx, C.xy,
                            C.xz,           C.yy,           C.yz,           C.zz};
    for (int r = 0; r < 9; ++r) {
      const float* from = rows[r] + x_first;
      if (x_count == kLanes) {
        for (int at = 0; at < kLanes; at += kWidth) store(&x_source[r][at], load(from + at));
      } else {
        for (int lane = 0; lane < kLanes; ++lane) x_source[r][lane] = lane < x_count ? from[lane] : 0.0F;
      }
    }
  }

  [[nodiscard]] Source sourceAt(int at) const {
    const auto row = [&](int r) { return load(&x_source[r][at]); };
    return {{row(0), row(1), row(2)}, {row(3), row(4), row(5), row(6), row(7), row(8)}};
  }

  /** Voxel of each point; a point that is not finite or far away becomes (0, 0, 0) without a voxel. */
  void findCells() {
    constexpr auto limit = static_cast<float>(2 * kCellLimit);
    for (int at = 0; at < kLanes; at += kWidth) {
      const Vec3<F> p{load(&x_source[0][at]), load(&x_source[1][at]), load(&x_source[2][at])};
      const Vec3<F> q = x_setup.voxels_per_m * x_setup.moved(p);
      const M somewhere =
          (absolute(q.x) < F(limit)) & (absolute(q.y) < F(limit)) & (absolute(q.z) < F(limit));  // not NaN
      const Vec3<F> safe = select(somewhere, q, Vec3<F>{F(0), F(0), F(0)});
      storeInts(&x_cell[0][at],
                somewhere.v ? floorToInts(safe.x) + x_setup.setup.anchor.x : Ints{} + kNowhere);
      storeInts(&x_cell[1][at], floorToInts(safe.y) + x_setup.setup.anchor.y);
      storeInts(&x_cell[2][at], floorToInts(safe.z) + x_setup.setup.anchor.z);
      const F zero(0);
      store(&x_source[0][at], select(somewhere, p.x, zero));
      store(&x_source[1][at], select(somewhere, p.y, zero));
      store(&x_source[2][at], select(somewhere, p.z, zero));
    }
  }

  /** Neighbouring points are often in one voxel: it is then looked up once. */
  void lookUp(std::int32_t k) {
    Cell last{0, 0, 0};
    std::int32_t found = -1;
    for (int lane = 0; lane < kLanes; ++lane) {
      const Cell cell{x_cell[0][lane], x_cell[1][lane], x_cell[2][lane]};
      if (lane >= x_count) {
        found = -1;
      } else if (lane == 0 || cell.x != last.x || cell.y != last.y || cell.z != last.z) {
        found = findRecord(x_job.map, voxelAround(cell, k, x_setup.setup.voxels_around));
      }
      last = cell;
      x_gaussians.record[lane] = found;
    }
    x_gaussians.gather(x_job.map);
  }

  /** A point that has moved by less than what its nearest record is nearer than all others keeps it; only the
   * rest search. \return the lanes that know, without a search, their record: x_gaussians, or that there is none */
  unsigned keepNearest() {
    std::int32_t* nearest = x_job.nearest + x_first;
    float* others_m = x_job.others_m + x_first;
    for (int lane = 0; lane < kLanes; ++lane) x_gaussians.record[lane] = lane < x_count ? nearest[lane] : -1;
    x_gaussians.gather(x_job.map);
    const F squared_reach_m2(x_setup.setup.squared_max_distance_m2);
    // What is compared are distances in floats, each exact to a few units in the last place.
    const F more(1 + 1e-6F), less(1 - 1e-6F);
    unsigned sure = 0;
    for (int part = 0; part < kParts; ++part) {
      const int at = part * kWidth;
      const auto row = [&](int r) { return load(&x_gaussians.rows[r][at]); };
      const Vec3<F> q{load(&x_moved[0][at]), load(&x_moved[1][at]), load(&x_moved[2][at])};
      const Vec3<F> step =
          q - x_before->moved({load(&x_source[0][at]), load(&x_source[1][at]), load(&x_source[2][at])});
      const Vec3<F> d = Vec3<F>{row(0), row(1), row(2)} - q;
      const F squared_m2 = dot(d, d),
              left_m = less * load(others_m + at) - more * squareRoot(dot(step, step));
      const Ints record = loadInts(&x_gaussians.record[at]);
      const M some{record >= 0};
      sure |= lanesOf(more * squareRoot(select(some, squared_m2, squared_reach_m2)) < left_m) << at;
      store(others_m + at, left_m);
      storeInts(&x_gaussians.record[at], squared_m2.v <= squared_reach_m2.v ? record : Ints{} - 1);
    }
    return sure;
  }

  void findNearest() {
    for (int at = 0; at < kLanes; at += kWidth) {
      const Vec3<F> q =
          x_setup.moved({load(&x_source[0][at]), load(&x_source[1][at]), load(&x_source[2][at])});
      store(&x_moved[0][at], q.x), store(&x_moved[1][at], q.y), store(&x_moved[2][at], q.z);
    }
    unsigned searching = (1U << x_count) - 1;
    if (x_before != nullptr) {
      searching &= ~keepNearest();
      if (searching == 0) return;
    } else {
      for (std::int32_t& record : x_gaussians.record) record = -1;
    }
    std::int32_t last = -1;
    for (; searching != 0; searching &= searching - 1) {
      const int lane = __builtin_ctz(searching);
      search(lane, last);
    }
    x_gaussians.gather(x_job.map);
  }

  /** From a point's last pair and that of the point before it: their distances bound the search. */
  void search(int lane, std::int32_t& last) {
    const std::size_t i = x_first + static_cast<std::size_t>(lane);
    const Vec3<float> q{x_moved[0][lane], x_moved[1][lane], x_moved[2][lane]};
    Neighbour best{x_setup.setup.squared_max_distance_m2, INT32_MAX};
    float others_m2 = 0;
    if (x_cell[0][lane] != kNowhere) {
      const auto consider = [&](std::int32_t record) {
        if (record < 0) return;
        const Vec3<float> d = x_job.map.records[record].offset_m - q;
        const Neighbour candidate{dot(d, d), record};
        if (nearer(candidate, best)) best = candidate;
      };
      if (x_before != nullptr) consider(x_job.nearest[i]);
      consider(last);
      best = nearest(*x_job.tree, q, best, others_m2);
    }
    const std::int32_t record = best.index == INT32_MAX ? -1 : best.index;
    if (record >= 0) last = record;
    x_gaussians.record[lane] = x_job.nearest[i] = record;
    x_job.others_m[i] = gpu::squareRoot(others_m2);
  }

  void addFrozen(const std::int32_t* frozen, const std::int32_t* taken, const F* squared) {
    bool same = true;
    for (int lane = 0; lane < x_count; ++lane) same &= frozen[lane] == taken[lane];
    if (!same) {
      for (int lane = 0; lane < kLanes; ++lane) x_gaussians.record[lane] = lane < x_count ? frozen[lane] : -1;
      x_gaussians.gather(x_job.map);
    }
    for (int part = 0; part < kParts; ++part) {
      const int at = part * kWidth;
      const F s = same ? squared[part] : x_setup.pair(sourceAt(at), x_gaussians, at).squared;
      const M counts{loadInts(&x_gaussians.record[at]) >= 0};
      x_sums[part][kFrozenCost] += select(counts, F(0.5) * x_setup.setup.robust.cost(s), F(0));
    }
  }

  static constexpr std::int32_t kNowhere = -4 * kCellLimit;  ///< outside any map
  const PassJob& x_job;
  const Setup& x_setup;
  const Setup* x_before;
  F (*x_sums)[kSums];
  std::size_t x_first = 0;
  int x_count = 0;
  alignas(64) float x_source[9][kLanes];
  alignas(64) float x_moved[3][kLanes];
  alignas(64) std::int32_t x_cell[3][kLanes];
  Gaussians x_gaussians;
};

void pass(const PassJob& job, std::size_t first, std::size_t last, double* sums) {
  F lanes[kParts][kSums] = {};
  const Setup setup(job.setup), before(job.before != nullptr ? *job.before : job.setup);
  PassGroup group(job, setup, job.before != nullptr ? &before : nullptr, lanes);
  for (std::size_t i = first; i < last; i += kLanes)
    group.run(i, static_cast<int>(last - i < kLanes ? last - i : kLanes));
  for (int s = 0; s < kSums; ++s) {
    alignas(64) float row[kLanes];
    float* to = row;
    for (int part = 0; part < kParts; ++part, to += kWidth) store(to, lanes[part][s]);
    sums[s] = static_cast<double>(sumOfLanes(row));
  }
}

/** As cellOf(), four or eight points at once. */
void voxels(const VoxelJob& job, std::size_t first, std::size_t last, VoxelBox& box) {
  constexpr int width = kWidth / 2;
  using Doubles = double __attribute__((vector_size(8 * width)));
  using Halves = float __attribute__((vector_size(4 * width)));
  using Cells = std::int32_t __attribute__((vector_size(4 * width)));
  using Longs = std::int64_t __attribute__((vector_size(8 * width)));
  constexpr double limit = kCellLimit;
  Cells low[3], high[3], kept{};
  for (int axis = 0; axis < 3; ++axis) low[axis] = Cells{} + kCellLimit, high[axis] = Cells{} - kCellLimit;
  const float* from[3] = {job.points.x, job.points.y, job.points.z};
  std::int32_t* to[3] = {job.x, job.y, job.z};
  for (std::size_t i = first; i < last; i += width) {
    const std::size_t count = last - i < width ? last - i : width;
    Longs inside = Longs{} - 1;
    Cells cell[3];
    for (int axis = 0; axis < 3; ++axis) {
      Halves p{};
      if (count == width) {
        __builtin_memcpy(&p, from[axis] + i, sizeof(p));
      } else {
        for (std::size_t k = 0; k < width; ++k) p[k] = k < count ? from[axis][i + k] : __builtin_nanf("");
      }
      const Doubles q = __builtin_convertvector(p, Doubles) / job.voxel_size_m;
      const Longs here = (q >= -limit) & (q < limit);
      inside &= here;
      const Doubles safe = here ? q : Doubles{};
      const Cells whole = __builtin_convertvector(safe, Cells);
      cell[axis] = whole + __builtin_convertvector(safe < __builtin_convertvector(whole, Doubles), Cells);
    }
    const Cells good = __builtin_convertvector(inside, Cells);
    kept -= good;
    for (int axis = 0; axis < 3; ++axis) {
      low[axis] = (good & (cell[axis] < low[axis])) ? cell[axis] : low[axis];
      high[axis] = (good & (cell[axis] > high[axis])) ? cell[axis] : high[axis];
    }
    cell[0] = good ? cell[0] : Cells{} + kNoCell;
    for (int axis = 0; axis < 3; ++axis)
      __builtin_memcpy(to[axis] + i, &cell[axis], count * sizeof(std::int32_t));
  }
  for (int k = 0; k < width; ++k) {
    const auto widen = [&](const Cells* values, Cell& c, bool down) {
      std::int32_t* axes[3] = {&c.x, &c.y, &c.z};
      for (int axis = 0; axis < 3; ++axis) {
        const std::int32_t v = values[axis][k];
        if (down ? v < *axes[axis] : v > *axes[axis]) *axes[axis] = v;
      }
    };
    widen(low, box.low, true);
    widen(high, box.high, false);
    box.kept += static_cast<std::uint32_t>(kept[k]);
  }
}

/** A group of 16 points of a scan. The scalar twin of this is deskewed(). */
class DeskewGroup {
 public:
  explicit DeskewGroup(const DeskewJob& job) : x_job(job) {}

  /** Points from `first` on. \return the lanes that are kept */
  unsigned run(std::size_t first, int count) {
    read(first, count);
    const auto last = static_cast<float>(x_job.step_count - 1);
    unsigned kept = 0;
    for (int at = 0; at < kLanes; at += kWidth) {
      const Vec3<F> p{load(&x_scan[0][at]), load(&x_scan[1][at]), load(&x_scan[2][at])};
      const F time_s = load(&x_scan[3][at]), steps = stepsUntil(time_s, x_job.steps_per_s, last);
      const Vec3<F> q = moved(p, truncated(steps), steps);
      store(&x_moved[0][at], q.x), store(&x_moved[1][at], q.y), store(&x_moved[2][at], q.z);
      kept |= lanesOf(isKept(x_job.crop, p, time_s, q)) << at;
    }
    return kept;
  }

  [[nodiscard]] const float* moved(int axis) const { return x_moved[axis]; }

 private:
  /** Lanes without a point are NaN. */
  void read(std::size_t first, int count) {
    const float* rows[4] = {x_job.scan.x, x_job.scan.y, x_job.scan.z, x_job.time_s};
    for (int r = 0; r < 4; ++r) {
      const float* from = rows[r] == nullptr ? kNoTimes : rows[r] + first;
      if (count == kLanes) {
        for (int at = 0; at < kLanes; at += kWidth) store(&x_scan[r][at], load(from + at));
      } else {
        for (int lane = 0; lane < kLanes; ++lane)
          x_scan[r][lane] = lane < count ? from[lane] : __builtin_nanf("");
      }
    }
  }

  /** Points that follow each other in a scan are mostly of one step: its transform is then that of all lanes. */
  [[nodiscard]] RACELOC_HD Vec3<F> moved(const Vec3<F>& p, Ints whole, const F& steps) const {
    alignas(64) std::int32_t step[kWidth];
    storeInts(step, whole);
    const F share = steps - toFloats(whole);
    Vec3<F> q = p;
    for (unsigned left = (1U << kWidth) - 1; left != 0;) {
      const std::int32_t k = step[__builtin_ctz(left)];
      const M here{whole == k};
      q = select(here, movedBetween(x_job.steps[k], share, p), q);
      left &= ~lanesOf(here);
    }
    return q;
  }

  static constexpr float kNoTimes[kLanes] = {};
  const DeskewJob& x_job;
  alignas(64) float x_scan[4][kLanes];  ///< x, y, z, time
  alignas(64) float x_moved[3][kLanes];
};

std::size_t deskew(const DeskewJob& job, std::size_t first, std::size_t last, const DeskewedOut& to) {
  constexpr unsigned all = (1U << kLanes) - 1;
  DeskewGroup group(job);
  std::size_t out = first;
  for (std::size_t i = first; i < last; i += kLanes) {
    const int count = static_cast<int>(last - i < kLanes ? last - i : kLanes);
    const unsigned kept = group.run(i, count);
    float* axes[3] = {to.x + out, to.y + out, to.z + out};
    if (kept == all) {
      for (int axis = 0; axis < 3; ++axis)
        __builtin_memcpy(axes[axis], group.moved(axis), kLanes * sizeof(float));
      for (unsigned lane = 0; lane < kLanes; ++lane)
        to.index[out + lane] = static_cast<std::uint32_t>(i) + lane;
      out += kLanes;
      continue;
    }
    for (int lane = 0; lane < count; ++lane) {  // a point that is not kept is written over by the next
      for (int axis = 0; axis < 3; ++axis) axes[axis][0] = group.moved(axis)[lane];
      to.index[out] = static_cast<std::uint32_t>(i) + static_cast<unsigned>(lane);
      const unsigned one = kept >> lane & 1U;
      for (float*& axis : axes) axis += one;
      out += one;
    }
  }
  return out - first;
}

}  // namespace

extern const Loops loops;
const Loops loops{GK_ISA_NAME, covariances, nearestCovariances, pass, voxels, deskew};

}  // namespace raceloc::gpu::GK_ISA
