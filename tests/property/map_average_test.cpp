#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <limits>
#include <map>

#include "map/voxel_average.h"
#include "support/forall.h"

namespace raceloc {
namespace {

using test::forAll;
using test::Random;

Cloud randomCloud(Random& rnd, int points, double size_m) {
  Cloud cloud;
  for (int i = 0; i < points; ++i) cloud.push(rnd.vectorWithin(size_m).cast<float>());
  return cloud;
}

Cloud averageOf(const Cloud& cloud, double voxel_m) {
  VoxelAverage average(voxel_m);
  average.add(cloud);
  return average.cloud();
}

void expectSameBits(const Cloud& a, const Cloud& b) {
  EXPECT_EQ(a.x, b.x);
  EXPECT_EQ(a.y, b.y);
  EXPECT_EQ(a.z, b.z);
  EXPECT_TRUE(a.intensity.empty() && b.intensity.empty());
}

TEST(VoxelAverageProperty, IsTheMeanOfEachVoxelBlockByBlock) {
  forAll(50, [](Random& rnd) {
    const double voxel_m = rnd.oneOf({0.2, 0.25, 1.0, 7.3});
    const Cloud cloud = randomCloud(rnd, 3000, rnd.oneOf({1.0, 4.0, 100.0}));
    struct Mean {
      Eigen::Vector3d sum_m = Eigen::Vector3d::Zero();
      int points = 0;
    };
    std::map<std::array<double, 6>, Mean> means;  // z, y, x of the block of four, then of the voxel
    for (std::size_t i = 0; i < cloud.size(); ++i) {
      const Eigen::Vector3d p = cloud.point(i).cast<double>();
      const Eigen::Array3d v = (p / voxel_m).array().floor(), block = (v / 4).floor();
      Mean& mean = means[{block.z(), block.y(), block.x(), v.z(), v.y(), v.x()}];
      mean.sum_m += p;
      ++mean.points;
    }
    VoxelAverage average(voxel_m);
    average.add(cloud);
    const Cloud averaged = average.cloud();
    ASSERT_EQ(averaged.size(), means.size());
    std::size_t i = 0;
    for (const auto& [voxel, mean] : means) {
      const Eigen::Vector3d p = averaged.point(i++).cast<double>();
      // Floats: one at up to 100 m, and a sum of up to some 400 within a voxel of up to 7 m.
      EXPECT_LT((p - mean.sum_m / mean.points).norm(), 1e-5 + 1e-5 * voxel_m);
    }
  });
}

TEST(VoxelAverageProperty, DoesNotDependOnHowTheCloudIsCutIntoScans) {
  forAll(50, [](Random& rnd) {
    const Cloud cloud = randomCloud(rnd, 2000, 3);
    VoxelAverage cut(0.5);
    for (std::size_t begin = 0; begin < cloud.size();) {
      const std::size_t end =
          std::min(cloud.size(), begin + static_cast<std::size_t>(rnd.oneOf({0, 1, 100, 700})));
      Cloud scan;
      for (std::size_t i = begin; i < end; ++i) scan.push(cloud.point(i));
      cut.add(scan);
      begin = end;
    }
    expectSameBits(cut.cloud(), averageOf(cloud, 0.5));
  });
}

TEST(VoxelAverageProperty, PassesOverPointsThatAreNotFiniteOrTooFar) {
  forAll(50, [](Random& rnd) {
    const Cloud cloud = randomCloud(rnd, 500, 20);
    Cloud faulty;
    for (std::size_t i = 0; i < cloud.size(); ++i) {
      faulty.push(cloud.point(i));
      if (rnd.uniform(0, 1) < 0.7) continue;
      Eigen::Vector3f bad = rnd.vectorWithin(20).cast<float>();
      bad(rnd.integer(0, 2)) =
          rnd.oneOf({std::numeric_limits<float>::quiet_NaN(), std::numeric_limits<float>::infinity(),
                     -std::numeric_limits<float>::infinity(), 0.5F * (1 << 22), -0.5F * ((1 << 22) + 1)});
      faulty.push(bad);
    }
    expectSameBits(averageOf(faulty, 0.5), averageOf(cloud, 0.5));
  });
}

TEST(VoxelAverage, RefusesAnEdgeThatIsNone) {
  for (const double edge_m : {0.0, -1.0, std::numeric_limits<double>::quiet_NaN()})
    EXPECT_THROW(VoxelAverage{edge_m}, std::invalid_argument);
  EXPECT_TRUE(averageOf({}, 1).empty());
}

}  // namespace
}  // namespace raceloc
