/** \file
 * The detector allocates nothing once it is warm. A program of its own: it replaces malloc, which `new` and Eigen call as
 * well. */
#include <gtest/gtest.h>

#include "support/counted_malloc.h"
#include "support/wall_scene.h"
#include "wall/wall_detector.h"

namespace raceloc {
namespace {

TEST(WallAllocation, IsNoneOnceTheLargestScanWasSeen) {
  std::vector<Cloud> scans;
  for (unsigned seed = 1; seed <= 6; ++seed) {
    test::Random rnd(seed);
    Cloud cloud;
    test::addGround(cloud, rnd, 30);
    test::addWall(cloud, rnd, {rnd.uniform(4, 12), 0.02, 0.001}, -20, 40);
    test::addWall(cloud, rnd, {rnd.uniform(-12, -4), 0.02, 0.001}, -20, 40);
    scans.push_back(std::move(cloud));
  }
  gpu::Context cpu(gpu::Backend::cpu);
  WallDetector detector(cpu, {});
  double stamp_s = 0;
  for (const Cloud& scan : scans) (void)detector.detect(scan, stamp_s += 0.1, Pose::Identity());
  [[maybe_unused]] const long before = allocations;
  int walls = 0;
  for (const Cloud& scan : scans) {
    const WallScan seen = detector.detect(scan, stamp_s += 0.1, Pose::Identity());
    walls += (seen.left ? 1 : 0) + (seen.right ? 1 : 0);
  }
#ifndef RACELOC_OTHER_MALLOC
  EXPECT_GT(before, 0) << "malloc is not ours";
  EXPECT_EQ(allocations - before, 0);
#endif
  EXPECT_EQ(walls, 12);
}

}  // namespace
}  // namespace raceloc
