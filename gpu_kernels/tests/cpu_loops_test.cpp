/** \file
 * One input, one answer: whatever the instruction set and the number of threads. */
#include "api/deskew_job.hpp"
#include "api/nearest_storage.hpp"
#include "api/voxel_table.hpp"
#include "core/se3_lm.hpp"
#include "cpu/loops.hpp"
#include "gtest/gtest.h"
#include "tests/scenes.h"

namespace raceloc::gpu::test {
namespace {

/** A hall with what may be met in a scan: a dense place, one far away, and points that are none. */
Points scan(unsigned seed) {
  Points p = hall(seed, 20000);
  for (int i = 0; i < 700; ++i) push(p, 3 + 1e-4 * i, 2, 1);
  push(p, 4000, -3000, 20);
  return p;
}

Points withBadPoints(Points p) {
  push(p, std::nan(""), 0, 0);
  push(p, 0, HUGE_VAL, 0);
  push(p, 0, 0, -1e9);
  return p;
}

void expectSame(const Covariances& a, const Covariances& b) {
  EXPECT_EQ(a.xx, b.xx);
  EXPECT_EQ(a.xy, b.xy);
  EXPECT_EQ(a.xz, b.xz);
  EXPECT_EQ(a.yy, b.yy);
  EXPECT_EQ(a.yz, b.yz);
  EXPECT_EQ(a.zz, b.zz);
  EXPECT_EQ(a.neighbours, b.neighbours);
}

/** What all others are held against. */
std::unique_ptr<BackendBase> referenceBackend() { return makeCpuBackend(1, *loopsHere().front()); }

/** Calls `check(backend)` with each kind that this machine runs. */
template <class Check>
void forAllBackends(const Check& check) {
  for (const Loops* set : loopsHere())
    for (const int threads : {1, 2, 5}) {
      SCOPED_TRACE(std::string(set->instructions) + ", threads: " + std::to_string(threads));
      check(*makeCpuBackend(threads, *set));
    }
}

TEST(CpuLoops, GiveTheSameDeskewedScan) {
  const MovingScan m = moving(withBadPoints(scan(9)));
  const std::vector<SweepStep> steps = sweepSteps(m.sweep(), true);
  const DeskewJob job = deskewJob(m.scan.view(), m.time_s.data(), m.sweep(), steps, {});
  const Deskewed here = referenceBackend()->deskew(job);
  EXPECT_GT(here.points.size(), 10000U);
  forAllBackends([&](BackendBase& other) {
    const Deskewed there = other.deskew(job);
    EXPECT_EQ(here.indices, there.indices);
    EXPECT_EQ(here.points.x, there.points.x);
    EXPECT_EQ(here.points.y, there.points.y);
    EXPECT_EQ(here.points.z, there.points.z);
  });
}

TEST(CpuLoops, GiveTheSameVoxelGrid) {
  const Points p = withBadPoints(scan(1));
  const auto reference = referenceBackend();
  for (const double size_m : {0.1, 1.0, 1e-4}) {  // the last has keys of more than 32 bits
    std::size_t dropped = 0;
    const Points here = reference->voxelGrid(p.view(), size_m, dropped);
    forAllBackends([&](BackendBase& other) {
      std::size_t dropped_there = 1;
      const Points there = other.voxelGrid(p.view(), size_m, dropped_there);
      EXPECT_EQ(dropped, dropped_there);
      EXPECT_EQ(here.x, there.x);
      EXPECT_EQ(here.y, there.y);
      EXPECT_EQ(here.z, there.z);
    });
  }
}

TEST(CpuLoops, GiveTheSameCovariances) {
  const Points p = scan(2);
  const auto reference = referenceBackend();
  for (const Weight weight : kWeights) {
    CovarianceOptions o;
    o.weight = weight;
    o.radius_m = 0.6F;
    o.polynomial_degree = 3;
    const Covariances here = reference->covariances(p.view(), o);
    forAllBackends([&](BackendBase& other) { expectSame(here, other.covariances(p.view(), o)); });
  }
}

/** A pass keeps the pairs that cannot have changed since the pass before, and searches the rest. */
TEST(CpuLoops, FindTheNearestWhateverThePassBefore) {
  const Points target = scan(6), source = withBadPoints(hall(7, 7001));
  const Covariances C = randomCovariances(5, source.size());
  const NearestTarget nearest(target.view(), randomCovariances(8, target.size()).view());
  MatchOptions o;
  o.max_distance_m = 0.3;
  std::vector<Transform> path{pose({0, 0.01, 0.03}, {0.2, 0.1, -0.1})};
  // Back and forth, still, a hair, far away from everything and back.
  for (const double step_m : {0.3, -0.1, 0.02, 0.0, 1e-3, 1e-6, -0.004, 900.0, -900.0, 0.01})
    path.push_back(path.back() *
                   pose({0, 0, step_m < 1 ? 0.1 * step_m : 0}, {step_m, -step_m / 2, step_m / 3}));
  Transform broken;
  broken.t[0] = std::nan("");
  path.insert(path.begin() + 4, broken);
  const auto reference = referenceBackend();
  std::vector<Pass> fresh;
  double pairs = 0;
  for (const Transform& T : path) {
    fresh.push_back(reference->nearestPasses(source.view(), C.view(), nearest.storage(), o).run(T));
    pairs += fresh.back().sums[kPairs];
  }
  EXPECT_GT(pairs, 10000);
  forAllBackends([&](BackendBase& other) {
    PassRunner& on_the_way = other.nearestPasses(source.view(), C.view(), nearest.storage(), o);
    for (std::size_t i = 0; i < path.size(); ++i) EXPECT_EQ(on_the_way.run(path[i]).sums, fresh[i].sums);
  });
}

TEST(CpuLoops, GiveTheSamePose) {
  const Points target = scan(3), source = withBadPoints(hall(4, 7001));  // no multiple of a group or block
  const auto reference = referenceBackend();
  const Covariances C = randomCovariances(5, source.size());
  VoxelTable table(1.0);
  table.insert(target.view(), reference->covariances(target.view(), {}).view(), {});
  for (const int around : {1, 7, 27}) {
    MatchOptions o;
    o.neighbour_voxels = around;
    const Transform guess = pose({0, 0.01, 0.03}, {0.2, 0.1, -0.1});
    const Match here = gaussNewton(reference->passes(source.view(), C.view(), table, nullptr, o), guess, o);
    EXPECT_GT(here.iterations, 2);
    forAllBackends([&](BackendBase& other) {
      const Match there = gaussNewton(other.passes(source.view(), C.view(), table, nullptr, o), guess, o);
      EXPECT_EQ(here.iterations, there.iterations);
      EXPECT_EQ(here.T_map_source.R, there.T_map_source.R);
      EXPECT_EQ(here.T_map_source.t, there.T_map_source.t);
      EXPECT_EQ(here.last.H, there.last.H);
      EXPECT_EQ(here.last.cost, there.last.cost);
    });
  }
}

}  // namespace
}  // namespace raceloc::gpu::test
