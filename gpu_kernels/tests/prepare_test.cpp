#include "raceloc/gpu/prepare.h"

#include "raceloc/gpu/matcher.h"
#include "raceloc/gpu/voxel_grid.h"
#include "tests/expect_same.h"
#include "tests/on_each_device.h"
#include "tests/scenes.h"

namespace raceloc::gpu::test {
namespace {

class Prepare : public OnEachDevice {};
INSTANTIATE_TEST_SUITE_P(Devices, Prepare, ::testing::Values(Backend::cpu, Backend::cuda), deviceName);

TEST_P(Prepare, GivesTheBitsOfTheThreeSteps) {
  MovingScan m = moving(hall(1, 20000));
  m.scan.x[5000] = m.time_s[17] = std::nanf("");
  for (const float* time_s : std::initializer_list<const float*>{m.time_s.data(), nullptr}) {
    for (const Neighbourhood neighbourhood : {Neighbourhood::radius, Neighbourhood::nearest}) {
      CovarianceOptions options;
      options.neighbourhood = neighbourhood;
      Crop crop;
      crop.max_range_m = time_s == nullptr ? 80 : 1e6F;  // with fewer than 2^32 voxels within, and with more
      const Deskewed scan = deskew(context(), m.scan.view(), time_s, m.sweep(), crop);
      const Points points = voxelGrid(context(), scan.points.view(), 0.25F);
      const Covariances C = covariances(context(), points.view(), options);
      EXPECT_GT(points.size(), 1000U);
      Deskewed full;
      for (Deskewed* wanted : {&full, static_cast<Deskewed*>(nullptr)}) {
        const PreparedScan out =
            prepare(context(), m.scan.view(), time_s, m.sweep(), crop, 0.25F, options, wanted);
        expectSamePoints(out.points, points);
        EXPECT_EQ(out.covariances.xx, C.xx);
        EXPECT_EQ(out.covariances.xy, C.xy);
        EXPECT_EQ(out.covariances.xz, C.xz);
        EXPECT_EQ(out.covariances.yy, C.yy);
        EXPECT_EQ(out.covariances.yz, C.yz);
        EXPECT_EQ(out.covariances.zz, C.zz);
        EXPECT_EQ(out.covariances.neighbours, C.neighbours);
      }
      expectSamePoints(full.points, scan.points);
      EXPECT_EQ(full.indices, scan.indices);
    }
  }
}

TEST_P(Prepare, IsMatchedAsItsPointsAre) {
  const MovingScan m = moving(hall(4, 20000));
  const Points target = hall(5, 20000);
  VoxelMap map(context(), 1.0);
  map.insert(target.view(), covariances(context(), target.view(), {}).view(), {});
  const PreparedScan scan = prepare(context(), m.scan.view(), m.time_s.data(), m.sweep(), {}, 0.25F, {});
  const Transform guess = pose({0, 0.01, 0.03}, {-1, 0, -1.5});
  const Match expected = match(context(), scan.points.view(), scan.covariances.view(), map, guess, {});
  const Match here = match(context(), scan, map, guess, {});
  (void)covariances(context(), target.view(), {});
  const Match later = match(context(), scan, map, guess, {});
  for (const Match* other : {&here, &later}) {
    EXPECT_EQ(other->T_map_source.R, expected.T_map_source.R);
    EXPECT_EQ(other->T_map_source.t, expected.T_map_source.t);
    EXPECT_EQ(other->last.H, expected.last.H);
    EXPECT_EQ(other->stop, expected.stop);
  }
  EXPECT_GT(expected.last.inliers, 100);
}

TEST_P(Prepare, TakesScansOfWhichNothingIsLeft) {
  const MovingScan m = moving(hall(2, 500));
  const Crop nothing{0, 1e-3F, 0, 0, 0};
  for (const PointsView& scan : {m.scan.view(), PointsView{}}) {
    Deskewed full;
    const PreparedScan out = prepare(context(), scan, m.time_s.data(), m.sweep(), nothing, 0.25F, {}, &full);
    EXPECT_EQ(out.points.size(), 0U);
    EXPECT_EQ(out.covariances.size(), 0U);
    EXPECT_EQ(full.points.size(), 0U);
  }
}

TEST_P(Prepare, RefusesWhatItsStepsRefuse) {
  const MovingScan m = moving(hall(3, 100));
  const auto run = [&](const SweepView& sweep, const Crop& crop, float size_m,
                       const CovarianceOptions& options) {
    (void)prepare(context(), m.scan.view(), m.time_s.data(), sweep, crop, size_m, options);
  };
  CovarianceOptions without_radius;
  without_radius.radius_m = 0;
  Crop without_range;
  without_range.max_range_m = 0;
  EXPECT_NO_THROW(run(m.sweep(), {}, 1, {}));
  EXPECT_THROW(run({m.T_end_lidar.data(), 0, 0.1F}, {}, 1, {}), std::invalid_argument);
  EXPECT_THROW(run(m.sweep(), without_range, 1, {}), std::invalid_argument);
  EXPECT_THROW(run(m.sweep(), {}, 0, {}), std::invalid_argument);
  EXPECT_THROW(run(m.sweep(), {}, 1, without_radius), std::invalid_argument);
}

}  // namespace
}  // namespace raceloc::gpu::test
