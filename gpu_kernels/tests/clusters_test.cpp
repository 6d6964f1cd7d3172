#include "raceloc/gpu/clusters.h"

#include <numeric>
#include <queue>

#include "tests/on_each_device.h"
#include "tests/reference.h"
#include "tests/scenes.h"

namespace raceloc::gpu::test {
namespace {

class Clusters : public OnEachDevice {};
INSTANTIATE_TEST_SUITE_P(Devices, Clusters, ::testing::Values(Backend::cpu, Backend::cuda), deviceName);

/** By walking from each point to all that are near. */
std::vector<std::int32_t> walked(const Points& p, float radius_m) {
  std::vector<std::int32_t> labels(p.size(), -1);
  for (std::size_t seed = 0; seed < p.size(); ++seed) {
    if (labels[seed] >= 0) continue;
    std::queue<std::size_t> next;
    next.push(seed);
    labels[seed] = static_cast<std::int32_t>(seed);
    for (; !next.empty(); next.pop())
      for (std::size_t j = 0; j < p.size(); ++j) {
        const std::size_t i = next.front();
        const float x = p.x[i] - p.x[j], y = p.y[i] - p.y[j], z = p.z[i] - p.z[j];
        if (labels[j] >= 0 || !(x * x + y * y + z * z <= radius_m * radius_m)) continue;
        labels[j] = labels[seed];
        next.push(j);
      }
  }
  return labels;
}

TEST_P(Clusters, AreThoseOfAWalk) {
  for (const unsigned seed : {1U, 2U, 3U}) {
    const Points p = randomCloud(seed, 1500, 5);
    for (const float radius_m : {0.05F, 0.45F, 0.6F, 20.0F})  // alone, near percolation, nearly one, one
      EXPECT_EQ(clusters(context(), p.view(), radius_m), walked(p, radius_m)) << radius_m;
  }
}

TEST_P(Clusters, FollowAWallFromEndToEnd) {  // the longest way that a label has to go
  Points p;
  for (int i = 0; i < 3000; ++i) push(p, 0.5 * ((i * 1103) % 3000), 10, 0);
  EXPECT_EQ(clusters(context(), p.view(), 0.6F), std::vector<std::int32_t>(p.size(), 0));
  for (const std::int32_t label : clusters(context(), p.view(), 0.4F)) EXPECT_GE(label, 0);
}

TEST_P(Clusters, DoNotDependOnWhereTheyAre) {
  Points p = randomCloud(4, 500, 4), far = p;
  for (std::size_t i = 0; i < far.size(); ++i) far.x[i] += 1024, far.z[i] -= 64;
  for (std::size_t i = 0; i < p.size(); ++i)
    p.x[i] = far.x[i] - 1024, p.z[i] = far.z[i] + 64;  // the same floats, less what is exact
  EXPECT_EQ(clusters(context(), p.view(), 0.5F), clusters(context(), far.view(), 0.5F));
}

TEST_P(Clusters, TakeTheSmallestClouds) {
  EXPECT_TRUE(clusters(context(), Points{}.view(), 1).empty());
  Points two;
  push(two, 0, 0, 0);
  push(two, 1, 0, 0);
  EXPECT_EQ(clusters(context(), two.view(), 1), (std::vector<std::int32_t>{0, 0}));  // at most the radius
  EXPECT_EQ(clusters(context(), two.view(), 0.99F), (std::vector<std::int32_t>{0, 1}));
}

TEST_P(Clusters, RefuseWhatIsNoPointAndNoRadius) {
  Points p = randomCloud(1, 10, 1);
  for (const float radius_m : {0.0F, -1.0F, std::nanf(""), HUGE_VALF})
    EXPECT_THROW((void)clusters(context(), p.view(), radius_m), std::invalid_argument) << radius_m;
  p.y[3] = std::nanf("");
  EXPECT_THROW((void)clusters(context(), p.view(), 1), std::invalid_argument);
}

}  // namespace
}  // namespace raceloc::gpu::test
