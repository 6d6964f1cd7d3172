#include "raceloc/gpu/voxel_grid.h"

#include <limits>

#include "tests/on_each_device.h"
#include "tests/reference.h"

namespace raceloc::gpu::test {
namespace {

class VoxelGrid : public OnEachDevice {};
INSTANTIATE_TEST_SUITE_P(Devices, VoxelGrid, ::testing::Values(Backend::cpu, Backend::cuda), deviceName);

TEST_P(VoxelGrid, IsTheCentroidOfEachVoxelInOrder) {
  for (const float size_m : {0.1F, 0.25F, 3.0F}) {
    const Points p = randomCloud(7, 4000, 5);
    std::map<VoxelIndex, std::pair<Vector, int>> voxels;
    for (std::size_t i = 0; i < p.size(); ++i) {
      auto& [sum, n] = voxels[voxelOf(at(p, i), static_cast<double>(size_m))];
      for (std::size_t k = 0; k < 3; ++k) sum[k] += at(p, i)[k];
      ++n;
    }
    std::size_t dropped = 99;
    const Points out = voxelGrid(context(), p.view(), size_m, &dropped);
    EXPECT_EQ(dropped, 0U);
    ASSERT_EQ(out.size(), voxels.size());
    std::size_t i = 0;
    for (const auto& [index, voxel] : voxels) {
      for (std::size_t k = 0; k < 3; ++k)
        EXPECT_NEAR(at(out, i)[k], voxel.first[k] / voxel.second, 1e-6);  // rounding to float at 5 m
      ++i;
    }
  }
}

TEST_P(VoxelGrid, LeavesCentroidsAlone) {  // one point a voxel already: the same bits again
  const Points once = voxelGrid(context(), randomCloud(1, 3000, 4).view(), 0.5F);
  const Points twice = voxelGrid(context(), once.view(), 0.5F);
  EXPECT_EQ(once.x, twice.x);
  EXPECT_EQ(once.y, twice.y);
  EXPECT_EQ(once.z, twice.z);
}

TEST_P(VoxelGrid, GivesTheBitsOfTheCpu) {
  Context cpu(Backend::cpu);
  const Points p = randomCloud(3, 100'000, 30), here = voxelGrid(context(), p.view(), 0.7F),
               there = voxelGrid(cpu, p.view(), 0.7F);
  EXPECT_EQ(here.x, there.x);
  EXPECT_EQ(here.y, there.y);
  EXPECT_EQ(here.z, there.z);
}

TEST_P(VoxelGrid, TakesVoxelsOfFewAndOfThousands) {
  Context cpu(Backend::cpu);
  const Points p = unevenVoxels(1), here = voxelGrid(context(), p.view(), 1),
               there = voxelGrid(cpu, p.view(), 1);
  ASSERT_EQ(here.size(), 10U);
  EXPECT_EQ(here.x, there.x);
  EXPECT_EQ(here.y, there.y);
  EXPECT_EQ(here.z, there.z);
}

TEST_P(VoxelGrid, IsExactToTheLastPlaceWhereSumsAreNot) {
  Points p;
  std::mt19937 engine(2);
  std::uniform_real_distribution<double> exponent(-30, 0);  // from 1 nm: some get lost beside others
  for (int i = 0; i < 5000; ++i) {
    const double x = std::exp2(exponent(engine));
    push(p, x, 0.5 * x, 0.25 * x);
  }
  const Points once = voxelGrid(context(), p.view(), 1), again = voxelGrid(context(), p.view(), 1);
  ASSERT_EQ(once.size(), 1U);
  long double sum = 0;
  for (const float x : p.x) sum += static_cast<long double>(x);
  EXPECT_FLOAT_EQ(once.x[0], static_cast<float>(sum / 5000));
  EXPECT_EQ(once.x, again.x);
  EXPECT_EQ(once.y, again.y);
  EXPECT_EQ(once.z, again.z);
}

TEST_P(VoxelGrid, DropsAndCountsWhatHasNoVoxel) {
  Points p;
  push(p, 1, 2, 3);
  p.x.insert(p.x.end(), {kNan, 0, 0, kInf, 3e5F, -3e5F});
  p.y.insert(p.y.end(), {0, kNan, -kInf, 0, 0, 0});
  p.z.insert(p.z.end(), {0, 0, 0, kNan, 0, 0});
  push(p, 200000, 0, 0);  // 800000 voxels of 0.25 m: inside 2^20
  std::size_t dropped = 0;
  const Points out = voxelGrid(context(), p.view(), 0.25F, &dropped);
  EXPECT_EQ(dropped, 6U);
  ASSERT_EQ(out.size(), 2U);
  EXPECT_EQ(out.x[0], 200000.0F);  // z 0 comes before z 3
  EXPECT_EQ(out.x[1], 1.0F);
}

TEST_P(VoxelGrid, TakesTheSmallestClouds) {
  std::size_t dropped = 99;
  EXPECT_EQ(voxelGrid(context(), Points{}.view(), 1, &dropped).size(), 0U);
  EXPECT_EQ(dropped, 0U);
  Points nothing;
  push(nothing, std::nan(""), 0, 0);
  EXPECT_EQ(voxelGrid(context(), nothing.view(), 1, &dropped).size(), 0U);
  EXPECT_EQ(dropped, 1U);
  Points same;
  for (int i = 0; i < 1000; ++i) push(same, -0.3, 0.1, 7.7);
  const Points out = voxelGrid(context(), same.view(), 1);
  ASSERT_EQ(out.size(), 1U);
  EXPECT_EQ(out.x[0], -0.3F);
  EXPECT_EQ(out.z[0], 7.7F);
}

TEST_P(VoxelGrid, RefusesASizeThatIsNone) {
  const Points p = randomCloud(1, 10, 1);
  for (const float size_m : {0.0F, -1.0F, kNan, kInf})
    EXPECT_THROW((void)voxelGrid(context(), p.view(), size_m), std::invalid_argument) << size_m;
}

}  // namespace
}  // namespace raceloc::gpu::test
