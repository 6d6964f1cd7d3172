/** \file
 * The CUDA kernels and their order of launches, on the fibre emulator: they agree with the CPU's loops, whatever
 * order the threads and blocks run in. */
#include <gtest/gtest.h>

#include <functional>

#include "api/deskew_job.hpp"
#include "api/voxel_table.hpp"
#include "core/se3_lm.hpp"
#include "tests/emu/emulated_machine.hpp"
#include "tests/expect_same.h"
#include "tests/scenes.h"

namespace raceloc::gpu::test {
namespace {

using Emulated = DeviceBackend<emu::Machine>;

constexpr int kThreads = 64;
constexpr std::array kSeeds{1, 2, 3};

using Values = std::array<float, kThreads>;

// Kernels with and without defects: each thread reads what the other warp wrote.
RACELOC_KERNEL(kThreads) swapWarps(Values& out) {
  RACELOC_SHARED(Values, shared);
  shared[simt::thread()] = static_cast<float>(simt::thread());
  simt::barrier();
  out[simt::thread()] = shared[simt::thread() ^ simt::kWarp];
}
RACELOC_KERNEL(kThreads) swapWarpsWithoutBarrier(Values& out) {
  RACELOC_SHARED(Values, shared);
  shared[simt::thread()] = static_cast<float>(simt::thread());
  out[simt::thread()] = shared[simt::thread() ^ simt::kWarp];
}
RACELOC_KERNEL(kThreads) barrierOfHalf(Values& out) {
  if (simt::thread() < 48) simt::barrier();
  out[simt::thread()] = 0;
}
RACELOC_KERNEL(kThreads) barrierAtTwoPlaces(Values&) {
  if (simt::thread() < simt::kWarp) {  // NOLINT(bugprone-branch-clone): two places are the defect
    simt::barrier();
  } else {
    simt::barrier();
  }
}
RACELOC_KERNEL(kThreads) shuffleOfHalf(Values& out) {
  if (simt::lane() < 16) out[simt::thread()] = simt::fromLaneXor(1.0F, 1);
}
RACELOC_KERNEL(kThreads) shuffleBesideBarrier(Values& out) {
  if (simt::lane() < 16) out[simt::thread()] = simt::fromLaneXor(1.0F, 1);
  simt::barrier();
}
RACELOC_KERNEL(kThreads) countArrivals(std::uint32_t& counter, std::vector<std::uint32_t>& arrivals) {
  arrivals.push_back(simt::increment(counter));
}

Values swapped(void (*kernel)(Values&), std::uint64_t seed) {
  Values out{};
  emu::launch("swap", {1}, kThreads, seed, [&] { kernel(out); });
  return out;
}

std::string errorOf(void (*kernel)(Values&)) {
  try {
    (void)swapped(kernel, 1);
  } catch (const emu::KernelError& error) {
    return error.what();
  }
  return "none";
}

TEST(Emulator, RunsWhatIsRight) {
  for (std::uint64_t seed = 0; seed < 20; ++seed) {
    const Values out = swapped(swapWarps, seed);
    for (std::size_t i = 0; i < out.size(); ++i) EXPECT_EQ(out[i], static_cast<float>(i ^ simt::kWarp));
  }
  std::uint32_t counter = 0;
  std::vector<std::uint32_t> arrivals, expected;
  emu::launch("count", {3, 4}, 32, 1, [&] { countArrivals(counter, arrivals); });
  for (std::uint32_t i = 0; i < 3 * 4 * 32; ++i) expected.push_back(i);
  EXPECT_EQ(arrivals, expected);
}

TEST(Emulator, ShowsAMissingBarrier) {
  for (std::uint64_t seed = 0; seed < 20; ++seed) {  // in no order has every thread written before any reads
    int poisoned = 0;
    for (const float x : swapped(swapWarpsWithoutBarrier, seed)) poisoned += std::isnan(x) ? 1 : 0;
    EXPECT_GT(poisoned, 0);
  }
}

TEST(Emulator, RefusesDivergence) {
  EXPECT_NE(errorOf(barrierOfHalf).find("only 48 of 64 threads of the block reach the barrier"),
            std::string::npos);
  EXPECT_NE(errorOf(barrierAtTwoPlaces).find("different places"), std::string::npos);
  EXPECT_NE(errorOf(shuffleOfHalf).find("only 16 of 32 threads of the warp"), std::string::npos);
  EXPECT_NE(errorOf(shuffleBesideBarrier).find("emu_test.cpp:"), std::string::npos);
}

TEST(Emulator, PassesOnWhatAKernelThrows) {
  EXPECT_THROW(emu::launch("throws", {1}, kThreads, 1, [] { throw std::out_of_range("here"); }),
               std::out_of_range);
}

std::array<const std::vector<float>*, 6> entries(const Covariances& C) {
  return {&C.xx, &C.xy, &C.xz, &C.yy, &C.yz, &C.zz};
}

TEST(EmulatedBackend, GivesTheDeskewedScanOfTheCpu) {
  Points p = hall(5, 3000);
  push(p, std::nan(""), 0, 0);
  push(p, 0, HUGE_VAL, 0);
  MovingScan m = moving(p);
  m.time_s[7] = std::nanf("");
  const auto cpu = makeCpuBackend(1);
  for (const bool timed : {true, false}) {
    const std::vector<SweepStep> steps = sweepSteps(m.sweep(), timed);
    const DeskewJob job =
        deskewJob(m.scan.view(), timed ? m.time_s.data() : nullptr, m.sweep(), steps, {3, 12, 4, 4, 4});
    const Deskewed expected = cpu->deskew(job);
    EXPECT_GT(expected.points.size(), 1000U);
    for (const int seed : kSeeds) {
      const Deskewed here = Emulated(seed).deskew(job);
      expectSamePoints(here.points, expected.points);
      EXPECT_EQ(here.indices, expected.indices);
    }
  }
  const std::vector<SweepStep> steps = sweepSteps(m.sweep(), false);
  Emulated emulated(1);
  const Crop nowhere{0, 1e-3F, 0, 0, 0};
  EXPECT_EQ(emulated.deskew(deskewJob(m.scan.view(), nullptr, m.sweep(), steps, nowhere)).points.size(), 0U);
  EXPECT_EQ(emulated.deskew(deskewJob({}, nullptr, m.sweep(), steps, {})).points.size(), 0U);
}

TEST(EmulatedBackend, GivesTheVoxelGridOfTheCpu) {
  Points p = hall(1, 800);
  push(p, std::nan(""), 0, 0);
  push(p, 0, HUGE_VAL, 0);
  push(p, 0, 0, -1e9);
  const auto cpu = makeCpuBackend(1);
  for (const int seed : kSeeds) {
    Emulated emulated(seed);
    for (const double size_m : {0.3, 1e-4}) {
      std::size_t dropped = 0, dropped_there = 1;
      const Points here = cpu->voxelGrid(p.view(), size_m, dropped);
      expectSamePoints(emulated.voxelGrid(p.view(), size_m, dropped_there), here);
      EXPECT_EQ(dropped_there, dropped);
    }
    std::size_t dropped = 9;
    EXPECT_EQ(emulated.voxelGrid({}, 1, dropped).size(), 0U);
    EXPECT_EQ(dropped, 0U);
    Points nothing;
    push(nothing, std::nan(""), 0, 0);
    EXPECT_EQ(emulated.voxelGrid(nothing.view(), 1, dropped).size(), 0U);
    EXPECT_EQ(dropped, 1U);
    if (seed == kSeeds.back()) continue;
    const Points uneven =
        unevenVoxels(1);  // runs across warps and blocks, and more points than kBoxBlocks have threads
    expectSamePoints(emulated.voxelGrid(uneven.view(), 1, dropped),
                     cpu->voxelGrid(uneven.view(), 1, dropped));
  }
}

TEST(EmulatedBackend, FindsWhatStandsAsTheCpuDoes) {
  Points p = hall(1, 1500);
  push(p, std::nan(""), 0, 0);
  push(p, 1e9, 0, 0);
  const auto cpu = makeCpuBackend(1);
  std::vector<std::uint8_t> expected_standing, is_standing;
  for (const Points& points : {p, unevenVoxels(2)}) {
    const StandingCells expected = cpu->standingCells(points.view(), {}, &expected_standing);
    EXPECT_GT(expected.size(), 20U);
    for (const int seed : kSeeds) {
      const StandingCells here = Emulated(seed).standingCells(points.view(), {}, &is_standing);
      expectSamePoints(here.face, expected.face);
      expectSamePoints(here.upper, expected.upper);
      EXPECT_EQ(here.lowest_m, expected.lowest_m);
      EXPECT_EQ(here.highest_m, expected.highest_m);
      EXPECT_EQ(here.standing, expected.standing);
      EXPECT_EQ(is_standing, expected_standing);
      if (points.size() > p.size()) break;  // one order is enough of thousands a cell
    }
  }
  EXPECT_EQ(Emulated(1).standingCells({}, {}, nullptr).size(), 0U);
  Points nothing;
  push(nothing, std::nan(""), 0, 0);
  EXPECT_EQ(Emulated(1).standingCells(nothing.view(), {}, &is_standing).size(), 0U);
  EXPECT_EQ(is_standing, std::vector<std::uint8_t>{0});
}

TEST(EmulatedBackend, GivesTheClustersOfTheCpu) {
  const auto cpu = makeCpuBackend(1);
  for (const int seed : kSeeds) {
    Emulated emulated(seed);
    const Points p = randomCloud(static_cast<unsigned>(seed), 900, 4);
    for (const float radius_m :
         {0.2F, 0.5F, 9.0F})  // few, many and all together: up to 900 hooks of one root
      EXPECT_EQ(emulated.clusters(p.view(), radius_m), cpu->clusters(p.view(), radius_m));
    EXPECT_TRUE(emulated.clusters({}, 1).empty());
  }
}

TEST(EmulatedBackend, GivesTheCovariancesOfTheCpu) {
  const Points p = hall(2, 2000);
  const auto cpu = makeCpuBackend(1);
  for (const auto weight :
       {Weight::rbf, Weight::gaussian, Weight::polynomial, Weight::hist, Weight::laplacian}) {
    for (const auto how : {Regularisation::none, Regularisation::min_eig, Regularisation::plane}) {
      CovarianceOptions o;
      o.weight = weight;
      o.regularisation = how;
      const Covariances expected = cpu->covariances(p.view(), o);
      Covariances first;
      for (const int seed : kSeeds) {
        const Covariances C = Emulated(seed).covariances(p.view(), o);
        ASSERT_EQ(C.neighbours, expected.neighbours);
        if (first.size() == 0) first = C;
        for (std::size_t k = 0; k < 6; ++k) {
          EXPECT_EQ(*entries(C)[k], *entries(first)[k]);  // one order of sums, whatever the seed
          for (std::size_t i = 0; i < p.size(); ++i) {
            // Sums of floats in another order: 1e-6; a normal turns by that over its gap, which is > 1e-3.
            EXPECT_NEAR((*entries(C)[k])[i], (*entries(expected)[k])[i],
                        how == Regularisation::plane ? 1e-3 : 1e-5);
          }
        }
      }
    }
  }
}

TEST(EmulatedBackend, PreparesAsInSteps) {
  MovingScan m = moving(hall(6, 1500));
  m.scan.y[9] = HUGE_VALF;
  const std::vector<SweepStep> steps = sweepSteps(m.sweep(), true);
  const DeskewJob job = deskewJob(m.scan.view(), m.time_s.data(), m.sweep(), steps, {3, 12, 4, 4, 4});
  Emulated emulated(1), other(2);
  std::size_t dropped = 0;
  const Deskewed moved_scan = emulated.deskew(job);
  const Points points = emulated.voxelGrid(moved_scan.points.view(), 0.5, dropped);
  const Covariances C = emulated.covariances(points.view(), {});
  for (Emulated* device : {&emulated, &other}) {
    Deskewed full;
    for (Deskewed* wanted : {&full, static_cast<Deskewed*>(nullptr)}) {
      const PreparedScan out = device->prepare(job, 0.5, {}, wanted);
      expectSamePoints(out.points, points);
      for (std::size_t k = 0; k < 6; ++k) EXPECT_EQ(*entries(out.covariances)[k], *entries(C)[k]);
      EXPECT_EQ(out.covariances.neighbours, C.neighbours);
    }
    expectSamePoints(full.points, moved_scan.points);
    EXPECT_EQ(full.indices, moved_scan.indices);
  }
  const auto far = deskewJob(m.scan.view(), m.time_s.data(), m.sweep(), steps, {3, 1e6F, 4, 4, 4});
  const PreparedScan all = emulated.prepare(far, 0.5, {}, nullptr);  // the range has more than 2^32 voxels
  expectSamePoints(all.points, emulated.voxelGrid(emulated.deskew(far).points.view(), 0.5, dropped));
  EXPECT_EQ(all.covariances.neighbours, emulated.covariances(all.points.view(), {}).neighbours);
  const DeskewJob empty = deskewJob({}, nullptr, m.sweep(), steps, {});
  EXPECT_EQ(emulated.prepare(empty, 0.5, {}, nullptr).points.size(), 0U);
}

TEST(EmulatedBackend, CountsNeighboursThatAreFarApart) {
  Points p = hall(2, 100);
  push(p, 1e6, -1e6, 1e6);  // keys of more than 32 bits
  const Covariances expected = makeCpuBackend(1)->covariances(p.view(), {});
  EXPECT_EQ(Emulated(1).covariances(p.view(), {}).neighbours, expected.neighbours);
}

class EmulatedMatch : public ::testing::Test {
 protected:
  EmulatedMatch() { x_table.insert(x_target.view(), x_cpu->covariances(x_target.view(), {}).view(), {}); }

  Match matched(BackendBase& backend, const Transform& guess, const MatchOptions& o) {
    const auto mirror = backend.mirror();
    if (mirror) mirror->upload(x_table);
    return gaussNewton(backend.passes(x_source.view(), x_covariances.view(), x_table, mirror.get(), o), guess,
                       o);
  }

  std::unique_ptr<BackendBase> x_cpu = makeCpuBackend(1);
  Points x_target = hall(3, 8000), x_source = hall(4, 700);  // no multiple of a block
  Covariances x_covariances = x_cpu->covariances(x_source.view(), {});
  VoxelTable x_table{1.0};
  Transform x_guess = pose({0, 0.01, 0.03}, {0.2, 0.1, -0.1});
};

TEST_F(EmulatedMatch, TakesItsOwnCopyOfAPreparedScan) {
  const MovingScan m = moving(hall(6, 1500));
  const std::vector<SweepStep> steps = sweepSteps(m.sweep(), true);
  const DeskewJob job = deskewJob(m.scan.view(), m.time_s.data(), m.sweep(), steps, {});
  Emulated emulated(1);
  const auto mirror = emulated.mirror();
  mirror->upload(x_table);
  PreparedScan scan = emulated.prepare(job, 0.5, {}, nullptr);
  const auto costOf = [&](const PreparedScan& source) {
    return linearization(emulated.passes(source, x_table, mirror.get(), {}).run(x_guess)).cost;
  };
  const double expected =
      linearization(emulated.passes(scan.points.view(), scan.covariances.view(), x_table, mirror.get(), {})
                        .run(x_guess))
          .cost;
  EXPECT_GT(expected, 0);
  EXPECT_EQ(costOf(scan), expected);
  std::vector<float> x(scan.points.size(), 1e9F);
  std::swap(scan.points.x, x);  // as long as the device has them, it does not look at these
  EXPECT_EQ(costOf(scan), expected);
  std::swap(scan.points.x, x);
  for (const auto& other : {std::function<void()>([&] { (void)emulated.covariances(x_source.view(), {}); }),
                            std::function<void()>([&] {
                              std::size_t dropped = 0;
                              (void)emulated.voxelGrid(x_source.view(), 0.5, dropped);
                            }),
                            std::function<void()>([&] { (void)emulated.prepare(job, 1, {}, nullptr); })}) {
    other();
    EXPECT_EQ(costOf(scan), expected);
    scan = emulated.prepare(job, 0.5, {}, nullptr);
  }
}

TEST_F(EmulatedMatch, GivesThePoseOfTheCpu) {
  for (const int around : {1, 7, 27}) {
    MatchOptions o;
    o.neighbour_voxels = around;
    const Match expected = matched(*x_cpu, x_guess, o);
    EXPECT_EQ(expected.stop, Stop::converged);
    Match first;
    for (const int seed : kSeeds) {
      Emulated emulated(seed);
      const Match m = matched(emulated, x_guess, o);
      if (seed == kSeeds.front()) first = m;
      EXPECT_EQ(m.stop, expected.stop);
      EXPECT_EQ(m.iterations, expected.iterations);
      EXPECT_LT(distance_m(m.T_map_source, expected.T_map_source), 1e-6);  // floats in other sums
      EXPECT_LT(angle_rad(m.T_map_source, expected.T_map_source), 1e-6);
      EXPECT_EQ(m.last.inliers, expected.last.inliers);
      EXPECT_EQ(m.T_map_source.R, first.T_map_source.R);
      EXPECT_EQ(m.T_map_source.t, first.T_map_source.t);
      EXPECT_EQ(m.last.H, first.last.H);
    }
  }
}

}  // namespace
}  // namespace raceloc::gpu::test
