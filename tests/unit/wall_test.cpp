/** \file
 * Scans that show no wall, old walls, and the guard's decisions one by one. */
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <limits>

#include "support/wall_scene.h"
#include "wall/guard.h"

namespace raceloc {
namespace {

using test::addCar;
using test::addGround;
using test::addWall;
using test::Random;

class Detector : public ::testing::Test {
 protected:
  /** The next scan, 0.1 s and `T_last_now` after the one before. */
  WallScan see(const Cloud& cloud, const Pose& T_last_now = Pose::Identity()) {
    return x_detector.detect(cloud, x_stamp_s += 0.1, T_last_now);
  }
  Random rnd{1};

 private:
  gpu::Context x_cpu{gpu::Backend::cpu};
  WallDetector x_detector{x_cpu, {}};
  double x_stamp_s = 0;
};

void expectNothing(const WallScan& scan, ScanVerdict verdict) {
  EXPECT_EQ(scan.verdict, verdict);
  EXPECT_FALSE(scan.left.has_value());
  EXPECT_FALSE(scan.right.has_value());
}

TEST_F(Detector, SaysThatThereIsNothing) {
  expectNothing(see({}), ScanVerdict::no_points);
  Cloud nan;
  for (int i = 0; i < 1000; ++i) nan.push(Eigen::Vector3f::Constant(std::numeric_limits<float>::quiet_NaN()));
  expectNothing(see(nan), ScanVerdict::no_points);
  Cloud ground;
  addGround(ground, rnd);
  expectNothing(see(ground), ScanVerdict::good);
  addCar(ground, {8, 4});
  addCar(ground, {1, -3.5});
  expectNothing(see(ground), ScanVerdict::good);
}

TEST_F(Detector, SaysThatTheGroundIsNotBelow) {
  Cloud cloud;
  addGround(cloud, rnd);
  addWall(cloud, rnd, {6, 0, 0}, -20, 40);
  EXPECT_TRUE(see(cloud).left.has_value());
  // The LiDAR of a road car, 1.5 m above the axle, mounted upside down; then on its side.
  for (const double roll_rad : {M_PI, M_PI / 2}) {
    const Pose place = poseFromRpy({1, 0, 1.5}, 0, 0, 0);
    const Pose wrong = place * poseFromRpy({0, 0, 0}, roll_rad, 0, 0) * place.inverse();
    Random other(2);
    gpu::Context cpu(gpu::Backend::cpu);
    expectNothing(WallDetector(cpu, {}).detect(transformed(cloud, wrong), 0, Pose::Identity()),
                  ScanVerdict::ground_not_below);
  }
}

TEST_F(Detector, RemembersAWallForAWhileAndSaysThatItIsOld) {
  Cloud with, without;
  addGround(with, rnd);
  without = with;
  const Eigen::Vector3d beta(-6, 0.02, 0.001);
  addWall(with, rnd, beta, -20, 40);
  EXPECT_EQ(see(with).right->age_s, 0);
  const Pose T_last_now = poseFromRpy({5, 0.05, 0}, 0, 0, 0.01);
  Wall expected = *see(with).right;
  for (int k = 1; k <= 5; ++k) {
    const WallScan scan = see(without, T_last_now);
    ASSERT_TRUE(scan.right.has_value()) << k;
    EXPECT_NEAR(scan.right->age_s, 0.1 * k, 1e-9);
    expected = moved(expected, T_last_now, 0.1);
    EXPECT_EQ(scan.right->beta, expected.beta);
  }
  EXPECT_FALSE(see(without, T_last_now).right.has_value()) << "0.6 s are more than keep_s";
  EXPECT_EQ(see(with).right->age_s, 0);
}

TEST_F(Detector, TakesTheWallBeforeTheGrandstand) {
  Cloud cloud;
  addGround(cloud, rnd);
  addWall(cloud, rnd, {9, 0, 0}, -10, 15);
  for (int row = 0; row < 12; ++row) addWall(cloud, rnd, {14.0 + 2 * row, 0, 0}, -50, 50);
  EXPECT_NEAR(see(cloud).left->distance_m(), 9, 0.03);
}

TEST_F(Detector, SeesNoWallAcrossTheRoad) {
  Cloud cloud;
  addGround(cloud, rnd);
  for (const double y : test::steps(-15, 15, 0.2))  // an overpass that is seen from below, and a row of tyres
    for (const double z : test::steps(0, 1.5, 0.1)) {
      cloud.push(Eigen::Vector3d(30, y, 5 + z).cast<float>());
      if (y < -5) cloud.push(Eigen::Vector3d(20, y, test::kRoad_m + z).cast<float>());
    }
  expectNothing(see(cloud), ScanVerdict::good);
}

TEST_F(Detector, RefusesStampsThatDoNotIncrease) {
  gpu::Context cpu(gpu::Backend::cpu);
  WallDetector detector(cpu, {});
  (void)detector.detect({}, 1, Pose::Identity());
  for (const double stamp_s : {1.0, 0.5, std::nan("")})
    EXPECT_THROW((void)detector.detect({}, stamp_s, Pose::Identity()), std::invalid_argument);
}

Wall wallOn(Side side, double distance_m) {
  return {side,
          {side == Side::left ? distance_m : -distance_m, 0, 0},
          1e-4 * Eigen::Matrix3d::Identity(),
          -30,
          80,
          100,
          0.01,
          1,
          0};
}

TEST(WallPathUnit, HasAValidLengthAndSaysWhenItIsTooFast) {
  Wall wall = wallOn(Side::right, 5);
  wall.to_x_m = 42.5;
  const WallPath path = planAlong(wall, 3, 60, 0, {});
  EXPECT_NEAR(path.valid_m, 42, 1);
  EXPECT_TRUE(path.drivable);
  EXPECT_GT(path.settled_m, 20);
  wall.beta[2] = 0.01;  // a bend of 50 m
  EXPECT_FALSE(planAlong(wall, 3, 60, 0.02, {}).drivable);
  EXPECT_TRUE(planAlong(wall, 3, 15, 0.02, {}).drivable);
  for (const double bad : {0.0, -1.0, std::nan("")})
    EXPECT_THROW((void)planAlong(wall, bad, 60, 0, {}), std::invalid_argument);
  for (const double bad : {-1.0, std::nan(""), HUGE_VAL})
    EXPECT_THROW((void)planAlong(wall, 3, bad, 0, {}), std::invalid_argument);
}

class GuardUnit : public ::testing::Test {
 protected:
  /** A tenth of a second at 50 m/s. */
  GuardOutput step(bool is_localized) {
    return x_guard.update({x_stamp_s += 0.1, is_localized, walls, tracked, 50, 0});
  }
  GuardState stateAfter(double duration_s, bool is_localized) {
    for (int k = 0; k < std::lround(duration_s / 0.1); ++k) (void)step(is_localized);
    return x_guard.state();
  }
  WallScan walls{0, ScanVerdict::good, std::nullopt, wallOn(Side::right, 6)};
  Path tracked = arcPath(0, 150);

 private:
  Guard x_guard{{}, {}};
  double x_stamp_s = 0;
};

/** A straight path that turns towards the wall on the right. */
Path towardsTheWall(double angle_rad) {
  Path path;
  for (const double s_m : test::steps(0, 150, 1))
    path.push_back({s_m, s_m * std::cos(angle_rad), -s_m * std::sin(angle_rad), -angle_rad, 0});
  return path;
}

TEST_F(GuardUnit, FollowsTheWallOnlyAfterAWhileAndGivesBackOnlyAfterAWhile) {
  EXPECT_EQ(stateAfter(1, true), GuardState::localized);
  EXPECT_EQ(stateAfter(0.3, false), GuardState::localized) << "0.2 s since the first rejection";
  const GuardOutput out = step(false);
  EXPECT_EQ(out.state, GuardState::wall_following);
  EXPECT_TRUE(out.has_changed);
  EXPECT_EQ(out.side, Side::right);
  ASSERT_TRUE(out.path.has_value());
  EXPECT_EQ(out.path->gap_m, WallPathOptions{}.gap_m);
  EXPECT_FALSE(step(false).has_changed);
  EXPECT_EQ(stateAfter(1, true), GuardState::wall_following) << "0.9 s since the first fix";
  EXPECT_EQ(stateAfter(0.2, true), GuardState::localized);
  EXPECT_FALSE(step(true).path.has_value());
}

TEST_F(GuardUnit, DoesNotFlutter) {
  int changes = 0;
  for (int k = 0; k < 200; ++k) changes += step(k % 3 == 0).has_changed ? 1 : 0;  // 0.2 s bad, 0.1 s good
  EXPECT_EQ(changes, 0) << "never rejected for 0.3 s";
  (void)stateAfter(1, false);
  for (int k = 0; k < 200; ++k) changes += step(k % 8 != 0).has_changed ? 1 : 0;  // never good for 1 s
  EXPECT_EQ(changes, 0);
}

TEST_F(GuardUnit, SaysWhenThereIsNoWallAndKeepsToTheOtherOne) {
  walls.right.reset();
  EXPECT_EQ(stateAfter(1, false), GuardState::no_wall);
  EXPECT_FALSE(step(false).path.has_value());
  walls.left = wallOn(Side::left, 8);
  const GuardOutput out = step(false);
  EXPECT_EQ(out.state, GuardState::wall_following);
  EXPECT_EQ(out.side, Side::left);
  EXPECT_EQ(out.path->gap_m, 8) << "it does not cross the road";
  walls.right = wallOn(Side::right, 6);
  EXPECT_EQ(step(false).side, Side::left) << "once followed, it is followed";
  walls.left.reset();
  EXPECT_EQ(step(false).side, Side::right);
}

TEST_F(GuardUnit, KeepsToTheMiddleOfANarrowRoad) {
  walls.left = wallOn(Side::left, 2);
  walls.right = wallOn(Side::right, 2.4);
  (void)stateAfter(1, false);
  EXPECT_NEAR(step(false).path->gap_m, 2.2, 1e-9);
}

TEST_F(GuardUnit, TakesOverBeforeThePathReachesTheWall) {
  EXPECT_EQ(stateAfter(1, true), GuardState::localized);
  tracked = towardsTheWall(0.08);  // 5 m to go at 4 m/s
  GuardOutput out = step(true);
  EXPECT_EQ(out.state, GuardState::localized);
  ASSERT_TRUE(out.clearance.time_to_wall_s && out.clearance.time_to_close_s);
  EXPECT_NEAR(out.clearance.wheel_m, 6 - GuardOptions{}.half_width_m, 1e-9);
  // The front wheel is 2.97 m ahead: 0.06 s earlier.
  EXPECT_NEAR(*out.clearance.time_to_wall_s, 5.03 / 4 - 0.06, 0.01);
  EXPECT_LT(*out.clearance.time_to_close_s, *out.clearance.time_to_wall_s);
  tracked = towardsTheWall(0.1);
  out = step(true);
  EXPECT_EQ(out.state, GuardState::emergency);
  EXPECT_EQ(out.side, Side::right);
  EXPECT_EQ(out.path->gap_m, 6) << "away from the wall, never nearer";
  tracked = towardsTheWall(0);
  EXPECT_EQ(stateAfter(0.5, true), GuardState::emergency) << "clear for 0.4 s";
  EXPECT_EQ(stateAfter(0.2, true), GuardState::localized);
}

TEST_F(GuardUnit, LetsACarThatIsNearButLeavesGoOn) {
  walls.right = wallOn(Side::right, 1.3);  // 0.33 m from the wheel
  tracked = towardsTheWall(-0.02);
  EXPECT_EQ(step(true).state, GuardState::localized);
  tracked = towardsTheWall(0.003);
  EXPECT_EQ(step(true).state, GuardState::localized) << "0.2 deg are along the wall, not towards it";
  tracked = towardsTheWall(0.01);
  const GuardOutput out = step(true);
  EXPECT_EQ(out.state, GuardState::emergency);
  EXPECT_EQ(out.path->gap_m, WallPathOptions{}.gap_m);
}

TEST_F(GuardUnit, AssumesTheArcWhereNobodySaysWhatIsTracked) {
  tracked.clear();
  GuardOutput out = step(true);
  EXPECT_FALSE(out.clearance.time_to_wall_s.has_value());
  Guard guard({}, {});
  out = guard.update({0, true, walls, tracked, 50, -0.01});
  EXPECT_EQ(out.state, GuardState::emergency);
}

TEST_F(GuardUnit, EndsTheEmergencyOfAWallThatIsGone) {
  tracked = towardsTheWall(0.2);
  EXPECT_EQ(step(true).state, GuardState::emergency);
  walls.right.reset();
  EXPECT_EQ(step(true).state, GuardState::localized);
}

TEST_F(GuardUnit, RefusesStampsThatGoBack) {
  Guard guard({}, {});
  (void)guard.update({1, true, walls, tracked, 50, 0});
  (void)guard.update({1, true, walls, tracked, 50, 0});
  for (const double stamp_s : {0.9, std::nan("")})
    EXPECT_THROW((void)guard.update({stamp_s, true, walls, tracked, 50, 0}), std::invalid_argument);
}

TEST(WallOptionsUnit, ThatContradictEachOtherAreRefused) {
  const auto messageOf = [](const GuardOptions& guard, const WallPathOptions& path) -> std::string {
    try {
      const Guard made(guard, path);
    } catch (const InputError& error) {
      return error.what();
    }
    return "";
  };
  GuardOptions near;
  near.clear_distance_m = 0.1;
  EXPECT_EQ(messageOf(near, {}),
            "section [guard]: emergency_distance_m = 0.5, but it must be at most clear_distance_m = 0.1");
  GuardOptions soon;
  soon.clear_time_s = 0.5;
  EXPECT_THAT(messageOf(soon, {}),
              ::testing::HasSubstr("emergency_time_s = 1, but it must be at most clear_time_s"));
  WallPathOptions path;
  path.gap_m = 1;
  EXPECT_THAT(messageOf({}, path), ::testing::HasSubstr("[wall_path]: least_gap_m = 2, but"));
  EXPECT_EQ(messageOf({}, {}), "");
  WallOptions wall;
  wall.reach_m = 0.3;
  gpu::Context context(gpu::Backend::cpu);
  EXPECT_THROW(WallDetector(context, wall), InputError);
}

TEST(WallOptionsUnit, AreCheckedKeyByKey) {
  WallOptions wall;
  GuardOptions guard;
  WallPathOptions path;
  EXPECT_THAT(iniText("wall", wall), ::testing::HasSubstr("cell_m"));
  EXPECT_THAT(iniText("guard", guard), ::testing::HasSubstr("side = right"));
  EXPECT_THAT(iniText("wall_path", path), ::testing::HasSubstr("gap_m"));
}

}  // namespace
}  // namespace raceloc
