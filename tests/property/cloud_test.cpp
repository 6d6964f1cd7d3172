#include <gmock/gmock.h>

#include <limits>

#include "cloud/covariances.h"
#include "cloud/deskew.h"
#include "cloud/voxel_grid.h"
#include "core/errors.h"
#include "support/forall.h"

namespace raceloc {
namespace {

using test::forAll;
using test::Random;

CropOptions everything() { return {0, 1e6, 0, 0, 0}; }

gpu::Context& cpu() {
  static gpu::Context context(gpu::Backend::cpu);
  return context;
}

DeskewedScan deskewed(const Scan& scan, const SweepPoses& T_begin_at, const CropOptions& crop) {
  return deskew(cpu(), sweepOf({scan}), T_begin_at, crop);
}

/** A scan of random points, each seen by the LiDAR from where the car was at the point's own time. */
struct SeenFromAMovingCar {
  Scan scan;
  std::vector<Eigen::Vector3d> p_end_m;  ///< the same points in the body frame at the end of the sweep
};

SeenFromAMovingCar drive(Random& rnd, const Vector6d& twist) {
  SeenFromAMovingCar seen{{100.0, "lidar", rnd.pose(3.0, 2.0), {}, {}, {}}, {}};
  constexpr double kSweep_s = 0.1;
  for (int i = 0; i <= 50; ++i) {
    const double time_s = kSweep_s * i / 50;
    const Pose T_end_then = se3Exp(twist * (time_s - kSweep_s));
    const Eigen::Vector3d p_end_m = rnd.vectorWithin(100);
    seen.p_end_m.push_back(p_end_m);
    seen.scan.cloud.push(((T_end_then * seen.scan.T_body_lidar).inverse() * p_end_m).cast<float>());
    seen.scan.time_s.push_back(static_cast<float>(time_s));
  }
  return seen;
}

Vector6d twist(double speed_mps, double yaw_rate_rps) {
  Vector6d xi = Vector6d::Zero();
  xi(2) = yaw_rate_rps;
  xi(3) = speed_mps;
  return xi;
}

/** For scans whose points have no times, or a car that does not move. */
const SweepPoses kStill = steadySweep(Vector6d::Zero(), 0.1);

TEST(DeskewProperty, UndoesTheMotionOfTheCar) {
  forAll(200, [](Random& rnd) {
    const double bend = rnd.oneOf({0.0, 1e-6, 1.0});  // the degenerate cases belong to the law
    Vector6d motion = twist(rnd.uniform(-5, 80), bend * rnd.uniform(-1, 1));
    motion(0) = bend * rnd.normal(0.2), motion(1) = bend * rnd.normal(0.2);
    motion(4) = rnd.normal(2), motion(5) = rnd.normal(0.5);
    const auto seen = drive(rnd, motion);
    const DeskewedScan moved = deskewed(seen.scan, steadySweep(motion, 0.1), everything());
    EXPECT_NEAR(moved.stamp_s, 100.1, 1e-6);  // float time of 0.1 s
    ASSERT_EQ(moved.cloud.size(), seen.p_end_m.size());
    // Straight within a step: (3 ms * 1.2 rad/s)^2 / 8 of 180 m is 0.4 mm; float at 180 m: 0.05 mm.
    for (std::size_t i = 0; i < seen.p_end_m.size(); ++i)
      EXPECT_LT((moved.cloud.point(i).cast<double>() - seen.p_end_m[i]).norm(), 5e-4);
  });
}

TEST(DeskewProperty, BringsSeveralLidarsToTheEndOfTheLast) {
  forAll(100, [](Random& rnd) {
    const Vector6d motion = twist(rnd.uniform(-5, 80), rnd.uniform(-1, 1));
    constexpr double kBegin_s = 1.7e9, kEnd_s = kBegin_s + 0.16;
    std::vector<Scan> scans;
    std::vector<Eigen::Vector3d> p_end_m;
    const auto see = [&](Scan& scan, double stamp_s) {
      p_end_m.push_back(rnd.vectorWithin(100));
      const Pose T_end_then = se3Exp(motion * (stamp_s - kEnd_s));
      scan.cloud.push(((T_end_then * scan.T_body_lidar).inverse() * p_end_m.back()).cast<float>(), 0.5F);
    };
    for (const double begin_s : {kBegin_s, kBegin_s + 0.03, kBegin_s + 0.06}) {
      Scan& scan = scans.emplace_back(Scan{begin_s, "lidar", rnd.pose(3.0, 2.0), {}, {}, {}});
      for (int i = 0; i <= 50; ++i) {
        see(scan, begin_s + 0.002 * i);
        scan.time_s.push_back(0.002F * static_cast<float>(i));
      }
    }
    Scan& snapshot = scans.emplace_back(Scan{kBegin_s + 0.1, "flash", rnd.pose(3.0, 2.0), {}, {}, {}});
    for (int i = 0; i < 10; ++i) see(snapshot, snapshot.stamp_s);
    const DeskewedScan merged = deskew(cpu(), sweepOf(scans), steadySweep(motion, 0.16), everything());
    EXPECT_NEAR(merged.stamp_s, kEnd_s, 1e-6);
    ASSERT_EQ(merged.cloud.size(), p_end_m.size());
    EXPECT_EQ(merged.cloud.intensity.size(), p_end_m.size());
    // As above with steps of 5 ms: 0.8 mm; and 1 us of a stamp of today at 80 m/s: 0.1 mm.
    for (std::size_t i = 0; i < p_end_m.size(); ++i)
      EXPECT_LT((merged.cloud.point(i).cast<double>() - p_end_m[i]).norm(), 1e-3);
  });
}

TEST(Deskew, AScanWithoutIntensityTakesItFromAllThatItIsMergedWith) {
  Scan with{5, "a", Pose::Identity(), {}, {}, {}}, without = with;
  with.cloud.push({10, 2, 1}, 0.5F);
  without.cloud.push({10, 2, 1});
  const DeskewedScan merged = deskew(cpu(), sweepOf({with, without}), kStill, everything());
  EXPECT_EQ(merged.cloud.size(), 2U);
  EXPECT_TRUE(merged.cloud.intensity.empty());
}

TEST(PrepareProperty, IsDeskewedThinnedAndWithCovariances) {
  forAll(10, [](Random& rnd) {
    const Vector6d motion = twist(rnd.uniform(0, 80), rnd.uniform(-1, 1));
    std::vector<Scan> scans{drive(rnd, motion).scan, drive(rnd, motion).scan};
    scans.resize(static_cast<std::size_t>(rnd.oneOf({1, 2})));
    const Sweep sweep = sweepOf(scans);
    const SweepPoses poses = steadySweep(motion, sweep.end_s - sweep.begin_s);
    const CropOptions crop{2, 60, 4, 1, 1};
    Cloud full;
    const CovarianceCloud prepared = SweepPreparer(cpu(), crop, 5, {}).prepare(sweep, poses, &full);
    const Cloud alone = deskew(cpu(), sweep, poses, crop).cloud;
    const CovarianceCloud by_steps = withCovariances(cpu(), voxelGrid(cpu(), alone, 5), {});
    EXPECT_EQ(full.x, alone.x);
    EXPECT_EQ(full.z, alone.z);
    EXPECT_EQ(prepared.cloud.y, by_steps.cloud.y);
    EXPECT_EQ(prepared.covariances.xz, by_steps.covariances.xz);
  });
}

TEST(DeskewProperty, LeavesAStandingCarAlone) {
  forAll(50, [](Random& rnd) {
    const auto seen = drive(rnd, twist(0, 0));
    const DeskewedScan moved = deskewed(seen.scan, kStill, everything());
    for (std::size_t i = 0; i < seen.p_end_m.size(); ++i)  // float at 170 m, twice
      EXPECT_LT((moved.cloud.point(i).cast<double>() - seen.p_end_m[i]).norm(), 1e-4);
  });
}

TEST(ArcProperty, IsTheEndOfManySmallSteps) {
  forAll(100, [](Random& rnd) {
    const double length_m = rnd.uniform(-10, 10), turn_rad = rnd.uniform(-2, 2);
    Pose T = Pose::Identity();
    constexpr int kSteps = 20000;
    for (int i = 0; i < kSteps; ++i) T = T * poseFromRpy({length_m / kSteps, 0, 0}, 0, 0, turn_rad / kSteps);
    // Euler steps err by half a step across the path: 10 m * 2 rad / 40000.
    EXPECT_TRUE(arc(length_m, turn_rad).isApprox(T, 1e-3));
  });
}

TEST(CropProperty, KeepsExactlyWhatIsInRangeAndNotTheOwnCar) {
  forAll(100, [](Random& rnd) {
    Scan scan{100, "lidar", rnd.pose(3.0, 1.0), {}, {}, {}};
    const CropOptions crop{2, 60, 4, 1, 1};
    std::vector<Eigen::Vector3d> kept_m;
    for (int i = 0; i < 300; ++i) {
      const Eigen::Vector3d p_lidar_m = rnd.vectorWithin(rnd.oneOf({3.0, 80.0})).cast<float>().cast<double>();
      scan.cloud.push(p_lidar_m.cast<float>());
      const Eigen::Vector3d p_body_m = scan.T_body_lidar * p_lidar_m;
      const bool own_car = p_body_m.x() > -1 && p_body_m.x() < 4 && std::abs(p_body_m.y()) < 1;
      if (p_lidar_m.norm() >= 2 && p_lidar_m.norm() <= 60 && !own_car) kept_m.push_back(p_body_m);
    }
    scan.cloud.push({std::numeric_limits<float>::quiet_NaN(), 10, 0});
    const DeskewedScan cropped = deskewed(scan, kStill, crop);
    ASSERT_EQ(cropped.cloud.size(), kept_m.size());
    for (std::size_t i = 0; i < kept_m.size(); ++i)  // float at 60 m
      EXPECT_LT((cropped.cloud.point(i).cast<double>() - kept_m[i]).norm(), 2e-5);
  });
}

TEST(Deskew, TakesSweepsOfAMicrosecondAtStampsOfToday) {
  Scan scan{1.7e9, "lidar", Pose::Identity(), {}, {0.0F, 3e-7F, -2e-7F}, {}};
  for (int i = 0; i < 3; ++i) scan.cloud.push({10, 2, 1});
  EXPECT_EQ(deskewed(scan, steadySweep(twist(70, 1), 1e-6), everything()).cloud.size(), 3U);
}

TEST(TransformProperty, GoesToTheKernelsAndBackUnchanged) {
  forAll(50, [](Random& rnd) {
    const Pose T = rnd.pose(3.0, 1000);
    EXPECT_EQ(toPose(toTransform(T)).matrix(), T.matrix());
  });
}

TEST(Deskew, TakesAScanWithoutTimesAsItIs) {
  Scan scan{5, "lidar", Pose::Identity(), {}, {}, {}};
  scan.cloud.push({10, 2, 1}, 0.5F);
  const DeskewedScan moved = deskewed(scan, steadySweep(twist(50, 1), 0.1), everything());
  EXPECT_EQ(moved.stamp_s, 5);
  EXPECT_EQ(moved.cloud.point(0), Eigen::Vector3f(10, 2, 1));
  EXPECT_EQ(moved.cloud.intensity.at(0), 0.5F);
}

TEST(Deskew, RefusesTimesThatAreNotSecondsSinceTheStamp) {
  Scan scan{5, "lidar_front", Pose::Identity(), {}, {0.0F, 1.3e9F}, {}};
  scan.cloud.push({10, 2, 1});
  scan.cloud.push({10, 2, 1});
  try {
    (void)deskewed(scan, steadySweep(twist(50, 1), 0.1), everything());
    FAIL() << "accepted";
  } catch (const InputError& e) {
    EXPECT_THAT(e.what(), ::testing::HasSubstr("lidar_front"));
  }
}

TEST(Deskew, TakesAnEmptyScan) {
  const DeskewedScan moved = deskewed({5, "lidar", Pose::Identity(), {}, {}, {}}, kStill, everything());
  EXPECT_TRUE(moved.cloud.empty());
}

}  // namespace
}  // namespace raceloc
