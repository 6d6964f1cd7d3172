#include <gtest/gtest.h>

#include "cloud/deskew.h"
#include "odometry/liv_odometry.h"
#include "odometry/scan_queue.h"
#include "support/plain_car.h"
#include "support/room.h"

namespace raceloc {
namespace {

using test::forAll;
using test::Random;

Sweep alone(const Scan& scan) { return sweepOf({scan}); }

MotionSample motionAt(double stamp_s, double speed_mps, double yaw_rate_rps) {
  return {stamp_s, "vehicle", speed_mps, yaw_rate_rps};
}

TEST(MotionHistoryProperty, ConstantRatesGiveTheArc) {
  forAll(100, [](Random& rnd) {
    const double speed_mps = rnd.uniform(0, 80), yaw_rate_rps = rnd.uniform(-1, 1);
    MotionHistory history(test::plainMotion(), test::plainCalibration());
    for (int i = 0; i <= 100; ++i) history.add(motionAt(10 + 0.01 * i, speed_mps, yaw_rate_rps));
    const double from_s = 10 + rnd.uniform(0, 0.5), to_s = from_s + rnd.uniform(0, 0.5);
    const auto motion = history.between(from_s, to_s);
    ASSERT_TRUE(motion);
    const double duration_s = to_s - from_s;
    EXPECT_TRUE(motion->T_start_end.isApprox(arc(speed_mps * duration_s, yaw_rate_rps * duration_s), 1e-9));
    EXPECT_NEAR(motion->duration_s, duration_s, 1e-12);
  });
}

TEST(MotionHistoryProperty, SplittingAnIntervalGivesTheSame) {
  forAll(100, [](Random& rnd) {
    MotionHistory history({});
    for (int i = 0; i <= 100; ++i) history.add(motionAt(0.01 * i, 40 + rnd.normal(2), rnd.normal(0.1)));
    const double a = rnd.uniform(0, 0.3), b = rnd.uniform(0.3, 0.6), c = rnd.uniform(0.6, 1.0);
    const auto whole = history.between(a, c), first = history.between(a, b), second = history.between(b, c);
    ASSERT_TRUE(whole && first && second);
    EXPECT_LT(se3Log((first->T_start_end * second->T_start_end).inverse() * whole->T_start_end).norm(), 1e-9);
  });
}

TEST(MotionHistory, KnowsWhereItKnowsNothing) {
  MotionOptions options;
  options.max_gap_s = 0.5;
  MotionHistory history(options);
  EXPECT_FALSE(history.between(0, 1));
  for (int i = 0; i <= 10; ++i) history.add(motionAt(0.1 * i, 10, 0));
  EXPECT_TRUE(history.between(0.2, 1.4));   // held for 0.4 s
  EXPECT_FALSE(history.between(0.2, 1.6));  // not for 0.6 s
  EXPECT_EQ(history.between(0.3, 0.3)->T_start_end.matrix(), Pose::Identity().matrix());
}

TEST(MotionHistory, LeavesOutAYawRateThatTheGyroContradicts) {
  MotionHistory history({});
  for (int i = 0; i <= 10; ++i) {
    history.add(ImuSample{0.1 * i, "imu", {0, 0, 0.3 + 1e-9 * i}, {0, 0, 9.81}, {0, 0, 0}});
    history.add(motionAt(0.1 * i, 10, -5.0));  // a broken yaw rate from the car
  }
  EXPECT_NEAR(history.ratesBetween(0, 1)->yaw_rate_rps, 0.3, 1e-7);
}

TEST(ScanQueue, WaitsForTheMotionOfTheSweepButNotForever) {
  MotionHistory history({});
  ScanQueue queue;
  Scan scan{1.0, "lidar", Pose::Identity(), {}, {0.0F, 0.1F}, {}};
  for (int i = 0; i < 2; ++i) scan.cloud.push({10, 0, 0});
  queue.push(scan);
  history.add(motionAt(1.0, 10, 0));
  EXPECT_FALSE(queue.pop(history, 1.0));
  history.add(motionAt(1.2, 10, 0));
  EXPECT_TRUE(queue.pop(history, 1.2));
  scan.stamp_s = 1.1;
  queue.push(scan);
  EXPECT_FALSE(queue.pop(MotionHistory({}), 1.4));
  EXPECT_TRUE(queue.pop(MotionHistory({}), 1.6));  // 0.4 s after its end nobody will tell any more
  EXPECT_TRUE(queue.empty());
}

/** Drives a car down a street; every sweep is a snapshot (no point times). */
struct Drive {
  double error_m;
  bool all_trusted;
};
Drive drive(Random& rnd, bool with_wheels) {
  gpu::Context context(gpu::Backend::cpu);
  LivOdometry odometry(context, {}, {0, 60, 0, 0, 0}, {}, {});
  MotionHistory history({});
  const Cloud street = test::street(rnd, 0.01, 40000);
  Drive result{0, true};
  Pose T_map_start = poseFromRpy({-10, 0, 0.3}, 0, 0, 0.05);
  for (int k = 0; k <= 10; ++k) {
    const double stamp_s = 0.1 * k;
    const Pose T_map_body = T_map_start * arc(12 * stamp_s, 0.1 * stamp_s);
    if (with_wheels) history.add(motionAt(stamp_s, 12, 0.1));
    const auto step = odometry.add(
        alone({stamp_s, "lidar", Pose::Identity(), transformed(street, T_map_body.inverse()), {}, {}}),
        history);
    result.all_trusted = result.all_trusted && step.trusted;
    result.error_m = ((T_map_start.inverse() * T_map_body).inverse() * step.T_odom_body).translation().norm();
  }
  return result;
}

TEST(LivOdometryProperty, FollowsACarDownAStreet) {
  forAll(3, [](Random& rnd) {
    const Drive result = drive(rnd, true);
    EXPECT_TRUE(result.all_trusted);
    EXPECT_LT(result.error_m, 0.05);  // 12 m driven, 1 cm point noise, 1 m voxels
  });
}

TEST(LivOdometry, FollowsWithoutWheelsToo) {
  Random rnd(5);
  const Drive result = drive(rnd, false);
  EXPECT_TRUE(result.all_trusted);
  EXPECT_LT(result.error_m, 0.05);  // as above; the first step of 1.2 m is searched for
}

TEST(LivOdometry, DeadReckonsThroughAnEmptyScan) {
  gpu::Context context(gpu::Backend::cpu);
  LivOdometry odometry(context, {}, {}, {}, {});
  MotionHistory history(test::plainMotion(), test::plainCalibration());
  for (int i = 0; i <= 30; ++i) history.add(motionAt(0.1 * i, 10, 0));
  Random rnd(1);
  const Scan good{1.0, "lidar", Pose::Identity(), test::street(rnd, 0.01), {}, {}};
  (void)odometry.add(alone(good), history);
  const auto step = odometry.add(alone({1.2, "lidar", Pose::Identity(), {}, {}, {}}), history);
  EXPECT_FALSE(step.trusted);
  EXPECT_NEAR(step.T_odom_body.translation().x(), 2.0, 1e-9);                     // 10 m/s for 0.2 s
  EXPECT_THROW((void)odometry.add(alone(good), history), std::invalid_argument);  // older than the last
}

TEST(LivOdometry, BeginsWithTheFirstScanThatHasPoints) {
  gpu::Context context(gpu::Backend::cpu);
  LivOdometry odometry(context, {}, {}, {}, {});
  MotionHistory history({});
  for (int i = 0; i <= 30; ++i) history.add(motionAt(0.1 * i, 0, 0));
  Random rnd(2);
  const Cloud street = test::street(rnd, 0.01);
  EXPECT_FALSE(odometry.add(alone({1.0, "lidar", Pose::Identity(), {}, {}, {}}), history).trusted);
  bool trusted = false;
  for (int i = 0; i < 15; ++i)
    trusted =
        odometry.add(alone({1.1 + 0.1 * i, "lidar", Pose::Identity(), street, {}, {}}), history).trusted;
  EXPECT_TRUE(trusted);  // an empty local map is begun anew after ten scans at the latest
}

TEST(LivOdometry, BeginsAnewWhereItsMapEnds) {
  gpu::Context context(gpu::Backend::cpu);
  LivOdometry odometry(context, {}, {}, {}, {});
  MotionHistory history({});
  for (int i = 0; i <= 40; ++i) history.add(motionAt(0.1 * i, 0, 0));
  Random rnd(3);
  const Cloud here = test::street(rnd, 0.01);
  const Cloud elsewhere =
      transformed(here, Pose(Eigen::Translation3d(0, 300, 0)));  // beyond the crop: nothing is left
  (void)odometry.add(alone({1.0, "lidar", Pose::Identity(), here, {}, {}}), history);
  for (int i = 0; i < 5; ++i)
    EXPECT_FALSE(
        odometry.add(alone({1.1 + 0.1 * i, "lidar", Pose::Identity(), elsewhere, {}, {}}), history).trusted);
  EXPECT_TRUE(odometry.add(alone({1.7, "lidar", Pose::Identity(), here, {}, {}}), history)
                  .trusted);  // the old map is still there
}

}  // namespace
}  // namespace raceloc
