#include <gmock/gmock.h>

#include <limits>

#include "cloud/covariances.h"
#include "cloud/deskew.h"
#include "core/errors.h"
#include "support/forall.h"

namespace raceloc {
namespace {

using test::forAll;
using test::Random;

CropOptions everything() { return {0, 1e6, 0, 0, 0}; }

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
    const DeskewedScan deskewed = deskew(seen.scan, steadySweep(motion, 0.1), everything());
    EXPECT_NEAR(deskewed.stamp_s, 100.1, 1e-6);  // float time of 0.1 s
    ASSERT_EQ(deskewed.cloud.size(), seen.p_end_m.size());
    // Straight within a step: (3 ms * 1.2 rad/s)^2 / 8 of 180 m is 0.4 mm; float at 180 m: 0.05 mm.
    for (std::size_t i = 0; i < seen.p_end_m.size(); ++i)
      EXPECT_LT((deskewed.cloud.point(i).cast<double>() - seen.p_end_m[i]).norm(), 5e-4);
  });
}

TEST(DeskewProperty, LeavesAStandingCarAlone) {
  forAll(50, [](Random& rnd) {
    const auto seen = drive(rnd, twist(0, 0));
    const DeskewedScan deskewed = deskew(seen.scan, kStill, everything());
    for (std::size_t i = 0; i < seen.p_end_m.size(); ++i)  // float at 170 m, twice
      EXPECT_LT((deskewed.cloud.point(i).cast<double>() - seen.p_end_m[i]).norm(), 1e-4);
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
    const DeskewedScan cropped = deskew(scan, kStill, crop);
    ASSERT_EQ(cropped.cloud.size(), kept_m.size());
    for (std::size_t i = 0; i < kept_m.size(); ++i)  // float at 60 m
      EXPECT_LT((cropped.cloud.point(i).cast<double>() - kept_m[i]).norm(), 2e-5);
  });
}

TEST(Deskew, TakesSweepsOfAMicrosecondAtStampsOfToday) {
  Scan scan{1.7e9, "lidar", Pose::Identity(), {}, {0.0F, 3e-7F, -2e-7F}, {}};
  for (int i = 0; i < 3; ++i) scan.cloud.push({10, 2, 1});
  EXPECT_EQ(deskew(scan, steadySweep(twist(70, 1), 1e-6), everything()).cloud.size(), 3U);
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
  const DeskewedScan deskewed = deskew(scan, steadySweep(twist(50, 1), 0.1), everything());
  EXPECT_EQ(deskewed.stamp_s, 5);
  EXPECT_EQ(deskewed.cloud.point(0), Eigen::Vector3f(10, 2, 1));
  EXPECT_EQ(deskewed.cloud.intensity.at(0), 0.5F);
}

TEST(Deskew, RefusesTimesThatAreNotSecondsSinceTheStamp) {
  Scan scan{5, "lidar_front", Pose::Identity(), {}, {0.0F, 1.3e9F}, {}};
  scan.cloud.push({10, 2, 1});
  scan.cloud.push({10, 2, 1});
  try {
    (void)deskew(scan, steadySweep(twist(50, 1), 0.1), everything());
    FAIL() << "accepted";
  } catch (const InputError& e) {
    EXPECT_THAT(e.what(), ::testing::HasSubstr("lidar_front"));
  }
}

TEST(Deskew, TakesAnEmptyScan) {
  const DeskewedScan deskewed = deskew({5, "lidar", Pose::Identity(), {}, {}, {}}, kStill, everything());
  EXPECT_TRUE(deskewed.cloud.empty());
}

}  // namespace
}  // namespace raceloc
