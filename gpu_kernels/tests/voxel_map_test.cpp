#include "raceloc/gpu/voxel_map.h"

#include "tests/on_each_device.h"
#include "tests/reference.h"

namespace raceloc::gpu::test {
namespace {

class Map : public OnEachDevice {};
INSTANTIATE_TEST_SUITE_P(Devices, Map, ::testing::Values(Backend::cpu, Backend::cuda), deviceName);

struct Sums {
  Vector mean{};
  Matrix C{};
  int count = 0;
};

/** The definition: averages over all points a voxel ever took. */
void insertInto(std::map<VoxelIndex, Sums>& map, double voxel_m, const Points& p, const Covariances& C,
                const Transform& T) {
  const Matrix R = rotationOf(T);
  for (std::size_t i = 0; i < p.size(); ++i) {
    const Vector q = applied(T, at(p, i));
    const Matrix turned_C = product(product(R, matrixAt(C, i)), flipped(R));
    Sums& sums = map[voxelOf(q, voxel_m)];
    for (std::size_t r = 0; r < 3; ++r) {
      sums.mean[r] += q[r];
      for (std::size_t c = 0; c < 3; ++c) sums.C[r][c] += turned_C[r][c];
    }
    ++sums.count;
  }
}

void expectSame(const VoxelGaussians& actual, const std::map<VoxelIndex, Sums>& expected) {
  ASSERT_EQ(actual.size(), expected.size());
  std::size_t i = 0;
  for (const auto& [index, sums] : expected) {
    ASSERT_EQ(VoxelIndex(actual.iz[i], actual.iy[i], actual.ix[i]), index);
    ASSERT_EQ(actual.covariance.neighbours[i], sums.count);
    const Matrix C = matrixAt(actual.covariance, i);
    for (std::size_t r = 0; r < 3; ++r) {
      EXPECT_NEAR(at(actual.mean, i)[r], sums.mean[r] / sums.count, 2e-6);  // rounding to float at 20 m
      for (std::size_t c = 0; c < 3; ++c) EXPECT_NEAR(C[r][c], sums.C[r][c] / sums.count, 1e-6);
    }
    ++i;
  }
}

TEST_P(Map, ServesTheDeviceItIsBroughtTo) {
  const Points p = randomCloud(1, 5000, 10);
  const Covariances C = randomCovariances(1, p.size());
  const Transform T = pose({0, 0, 0.1}, {1, 0, 0});
  VoxelMap made_there(context(), 0.8), brought(0.8);
  for (VoxelMap* map : {&made_there, &brought}) map->insert(p.view(), C.view(), T);
  brought.bringTo(context());
  const auto expectSameMaps = [&] {
    const auto here = linearize(context(), p.view(), C.view(), brought, T, {});
    const auto there = linearize(context(), p.view(), C.view(), made_there, T, {});
    EXPECT_GT(here.pairs, 0);
    EXPECT_EQ(here.cost, there.cost);
    EXPECT_EQ(here.pairs, there.pairs);
  };
  expectSameMaps();
  for (VoxelMap* map : {&made_there, &brought}) map->insert(p.view(), C.view(), {});  // it grows there, too
  expectSameMaps();
  EXPECT_THROW(VoxelMap(0.0), std::invalid_argument);
}

TEST_P(Map, FillsOnlyVoxelsThatWereEmpty) {
  VoxelMap map(context(), 0.8);
  std::map<VoxelIndex, Sums> expected;
  for (unsigned seed = 1; seed <= 4; ++seed) {
    const Points p = randomCloud(seed, 500, 5);  // most of its voxels overlap those of the one before
    const Covariances C = randomCovariances(seed, p.size());
    const Transform T = pose({0, 0, 0.1 * seed}, {1.0 * seed, 0, 0});
    EXPECT_EQ(map.fill(p.view(), C.view(), T), 0U);
    std::map<VoxelIndex, Sums> of_this;
    insertInto(of_this, 0.8, p, C, T);
    expected.merge(of_this);  // keeps what it has
    expectSame(map.contents(), expected);
  }
}

TEST_P(Map, AveragesAllItEverTook) {
  VoxelMap map(context(), 0.8);
  std::map<VoxelIndex, Sums> expected;
  for (unsigned seed = 1; seed <= 4; ++seed) {
    const Points p = randomCloud(seed, 2000, 5);
    const Covariances C = randomCovariances(seed, p.size());
    const Transform T = pose({0.1 * seed, -0.2, 0.7 * seed}, {1.0 * seed, -2, 0.5});
    EXPECT_EQ(map.insert(p.view(), C.view(), T), 0U);
    insertInto(expected, 0.8, p, C, T);
    expectSame(map.contents(), expected);
  }
  EXPECT_EQ(map.size(), expected.size());
}

TEST_P(Map, DoesNotCareHowInsertionIsCut) {
  const Points p = randomCloud(3, 3000, 4);
  const Covariances C = randomCovariances(3, p.size());
  VoxelMap whole(context(), 1.0), cut(context(), 1.0);
  whole.insert(p.view(), C.view(), {});
  const std::size_t n = 1234;
  const CovariancesView v = C.view();
  cut.insert({p.x.data(), p.y.data(), p.z.data(), n}, {v.xx, v.xy, v.xz, v.yy, v.yz, v.zz, n}, {});
  cut.insert({p.x.data() + n, p.y.data() + n, p.z.data() + n, p.size() - n},
             {v.xx + n, v.xy + n, v.xz + n, v.yy + n, v.yz + n, v.zz + n, p.size() - n}, {});
  EXPECT_EQ(whole.contents().mean.x, cut.contents().mean.x);
  EXPECT_EQ(whole.contents().covariance.xy, cut.contents().covariance.xy);
  EXPECT_EQ(whole.contents().covariance.neighbours, cut.contents().covariance.neighbours);
}

TEST_P(Map, ForgetsWhatIsFar) {
  VoxelMap map(context(), 0.5);
  std::map<VoxelIndex, Sums> expected;
  const Points p = randomCloud(11, 4000, 6);
  const Covariances C = randomCovariances(11, p.size());
  map.insert(p.view(), C.view(), {});
  insertInto(expected, 0.5, p, C, {});
  const Vector centre{1, -1, 0.5};
  const std::size_t before = expected.size();
  for (auto it = expected.begin(); it != expected.end();) {
    const Vector& m = it->second.mean;
    const double n = it->second.count;
    const bool far = std::hypot(m[0] / n - centre[0], m[1] / n - centre[1], m[2] / n - centre[2]) > 3.3;
    it = far ? expected.erase(it) : std::next(it);
  }
  EXPECT_EQ(map.keepWithin(centre, 3.3), before - expected.size());
  expectSame(map.contents(), expected);
  map.insert(p.view(), C.view(), {});  // what was dropped begins anew, what stayed goes on
  insertInto(expected, 0.5, p, C, {});
  expectSame(map.contents(), expected);
  EXPECT_EQ(map.keepWithin(centre, 0), expected.size());
  EXPECT_EQ(map.size(), 0U);
}

TEST_P(Map, ForgetsWhatIsOld) {
  const Points first = randomCloud(1, 800, 5), second = randomCloud(2, 800, 5);
  const Covariances C = randomCovariances(1, first.size());
  VoxelMap map(context(), 0.8);
  std::map<VoxelIndex, Sums> expected, newest;
  map.insert(first.view(), C.view(), {});
  map.insert(second.view(), C.view(), {});
  insertInto(expected, 0.8, first, C, {});
  insertInto(expected, 0.8, second, C, {});
  insertInto(newest, 0.8, second, C, {});
  ASSERT_LT(newest.size(), expected.size());
  const std::size_t room = newest.size() + 20;  // the new ones, and of the old ones the first 20
  std::size_t old = 0, dropped = 0;
  for (auto it = expected.begin(); it != expected.end();) {
    const bool drop = newest.count(it->first) == 0 && old++ >= 20;
    dropped += drop ? 1 : 0;
    it = drop ? expected.erase(it) : std::next(it);
  }
  EXPECT_EQ(map.keepNewest(room), dropped);
  expectSame(map.contents(), expected);
  EXPECT_EQ(map.keepNewest(room), 0U);
  map.insert(first.view(), C.view(), {});  // what was dropped begins anew
  insertInto(expected, 0.8, first, C, {});
  expectSame(map.contents(), expected);
  EXPECT_EQ(map.keepNewest(0), expected.size());
}

TEST_P(Map, DropsAndCountsWhatHasNoVoxel) {
  VoxelMap map(context(), 0.1);
  Points p = randomCloud(1, 6, 1);
  Covariances C = randomCovariances(1, p.size());
  p.x[0] = std::nanf("");
  p.y[1] = HUGE_VALF;
  p.z[2] = 2e5F;  // 2 million voxels
  C.xy[3] = std::nanf("");
  EXPECT_EQ(map.insert(p.view(), C.view(), {}), 4U);
  EXPECT_EQ(map.size(), 2U);
  Transform nowhere;
  nowhere.t[0] = std::nan("");
  EXPECT_EQ(map.insert(p.view(), C.view(), nowhere), 6U);
  EXPECT_EQ(map.insert(Points{}.view(), Covariances{}.view(), {}), 0U);
  EXPECT_EQ(map.size(), 2U);
}

TEST_P(Map, RefusesBadInput) {
  EXPECT_THROW(VoxelMap(context(), 0), std::invalid_argument);
  EXPECT_THROW(VoxelMap(context(), std::nan("")), std::invalid_argument);
  VoxelMap map(context(), 1);
  EXPECT_THROW(map.insert(randomCloud(1, 3, 1).view(), randomCovariances(1, 2).view(), {}),
               std::invalid_argument);
}

}  // namespace
}  // namespace raceloc::gpu::test
