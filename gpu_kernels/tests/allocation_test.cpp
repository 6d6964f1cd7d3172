/** \file
 * A match allocates nothing once the context is warm. A program of its own: it replaces operator new. */
#include <gtest/gtest.h>

#include <atomic>
#include <cstdlib>
#include <new>

#include "raceloc/gpu/covariance.h"
#include "raceloc/gpu/matcher.h"
#include "tests/scenes.h"

namespace {
std::atomic<long> allocations{0};
}

// Out of line: one of a pair taken inline looks to the compiler like memory of malloc given to delete.
[[gnu::noinline]] void* operator new(std::size_t bytes) {
  ++allocations;
  if (void* memory = std::malloc(bytes)) return memory;
  throw std::bad_alloc();
}
[[gnu::noinline]] void operator delete(void* memory) noexcept { std::free(memory); }
[[gnu::noinline]] void operator delete(void* memory, std::size_t) noexcept { std::free(memory); }

namespace raceloc::gpu::test {
namespace {

TEST(Allocation, AMatchNeedsNoneOnceWarm) {
  Context cpu(Backend::cpu);
  const Points target = hall(1, 8000), source = hall(2, 3000);
  const Covariances C = covariances(cpu, source.view(), {}), D = covariances(cpu, target.view(), {});
  VoxelMap map(cpu, 1.0);
  map.insert(target.view(), D.view(), {});
  const NearestTarget points(target.view(), D.view());
  const Transform guess = pose({0, 0.01, 0.03}, {0.2, 0.1, -0.1});
  for (const int around : {27, 7, 1}) {
    MatchOptions o;
    o.neighbour_voxels = around;
    (void)match(cpu, source.view(), C.view(), map, guess, o);
    (void)match(cpu, source.view(), C.view(), points, guess, o);
    const long before = allocations;
    const Match m = match(cpu, source.view(), C.view(), map, guess, o);
    const Match n = match(cpu, source.view(), C.view(), points, guess, o);
    EXPECT_EQ(allocations - before, 0);
    EXPECT_EQ(m.stop, Stop::converged);
    EXPECT_EQ(n.stop, Stop::converged);
  }
}

}  // namespace
}  // namespace raceloc::gpu::test
