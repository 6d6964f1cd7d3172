/** \file
 * Laws of the wall detector, the path along a wall and the guard. */
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "support/wall_scene.h"
#include "wall/guard.h"

namespace raceloc {
namespace {

using test::addCar;
using test::addGround;
using test::addWall;
using test::forAll;
using test::Random;

WallScan seenIn(const Cloud& cloud, int threads = 1) {
  gpu::Context cpu(gpu::Backend::cpu, 0, threads);
  return WallDetector(cpu, {}).detect(cloud, 0, Pose::Identity());
}

struct Road {
  Eigen::Vector3d left, right;
  Cloud cloud;
};

Road randomRoad(Random& rnd) {
  const double bend_per_m = rnd.uniform(-0.003, 0.003), slope = rnd.uniform(-0.1, 0.1);
  Road road{{rnd.uniform(3, 15), slope, bend_per_m}, {rnd.uniform(-15, -3), slope, bend_per_m}, {}};
  addGround(road.cloud, rnd, 30);
  addWall(road.cloud, rnd, road.left, -25, 40);
  addWall(road.cloud, rnd, road.right, -25, 40);
  return road;
}

constexpr double kSeen_m = 0.02;      // 1 cm of noise, cells that cut the wall anywhere
constexpr double kSeen_rad = 0.003;   // that over some 15 m
constexpr double kSeen_per_m = 3e-4;  // and over their square

void expectNear(const Wall& wall, const Eigen::Vector3d& beta) {
  EXPECT_NEAR(wall.beta[0], beta[0], kSeen_m);
  EXPECT_NEAR(wall.beta[1], beta[1], kSeen_rad);
  EXPECT_NEAR(wall.beta[2], beta[2], kSeen_per_m);
}

TEST(WallProperty, IsWhereItWasPut) {
  forAll(20, [](Random& rnd) {
    const Road road = randomRoad(rnd);
    const WallScan seen = seenIn(road.cloud);
    ASSERT_TRUE(seen.left && seen.right);
    expectNear(*seen.left, road.left);
    expectNear(*seen.right, road.right);
    EXPECT_EQ(seen.left->age_s, 0);
    EXPECT_NEAR(seen.left->height_m, 1, 0.1);
    EXPECT_GT(seen.left->to_x_m, 30);
    EXPECT_LT(seen.left->from_x_m, -15);
    EXPECT_NEAR(seen.left->length_m, 65, 12);
  });
}

TEST(WallProperty, WhatComesIsNotBentByWhatIsPassed) {
  // Straight behind the car and a turn of 150 m ahead: no parabola is both.
  const Eigen::Vector3d straight(-6, 0, 0), turn(-6, 0, 1 / 300.0);
  forAll(10, [&](Random& rnd) {
    Cloud cloud;
    addGround(cloud, rnd, 30);
    addWall(cloud, rnd, straight, -40, 0);
    addWall(cloud, rnd, turn, 0, 40);
    const WallScan seen = seenIn(cloud);
    ASSERT_TRUE(seen.right);
    ASSERT_TRUE(seen.right->beta_ahead);
    EXPECT_FALSE(seen.right->is_passed);
    const Wall wall = ahead(*seen.right);
    for (const double x_m : {5.0, 20.0})  // the bend's noise grows with the square of x
      EXPECT_NEAR(wall.y_m(x_m), turn[0] + turn[2] * x_m * x_m, kSeen_m + kSeen_per_m * x_m * x_m) << x_m;

    // One second on, the same wall: its curve ahead moves as the wall does.
    const Pose T_last_now(Eigen::Translation3d(10, 0, 0));
    const Wall later = ahead(moved(*seen.right, T_last_now, 0.2));
    EXPECT_NEAR(later.y_m(5), wall.y_m(15), 1e-9);
  });
}

TEST(WallProperty, AWallThatEndsBesideTheCarIsPassed) {
  forAll(10, [](Random& rnd) {
    Cloud cloud;
    addGround(cloud, rnd, 30);
    addWall(cloud, rnd, {-6, 0, 0}, -40, 2);
    const WallScan seen = seenIn(cloud);
    ASSERT_TRUE(seen.right);
    EXPECT_NEAR(seen.right->distance_m(), 6, kSeen_m);
    EXPECT_TRUE(seen.right->is_passed);
    EXPECT_FALSE(ahead(seen).right);
    // And one that reaches farther is passed later.
    Wall wall = *seen.right;
    wall.is_passed = false;
    wall.to_x_m = 30;
    EXPECT_FALSE(moved(wall, Pose(Eigen::Translation3d(29, 0, 0)), 0.4).is_passed);
    EXPECT_TRUE(moved(wall, Pose(Eigen::Translation3d(31, 0, 0)), 0.4).is_passed);
  });
}

TEST(WallProperty, TurnsWithTheScan) {
  forAll(20, [](Random& rnd) {
    const Road road = randomRoad(rnd);
    const Pose T_turned_body =
        poseFromRpy({rnd.uniform(-2, 2), rnd.uniform(-1, 1), 0}, 0, 0, rnd.uniform(-0.2, 0.2));
    const WallScan before = seenIn(road.cloud), after = seenIn(transformed(road.cloud, T_turned_body));
    ASSERT_TRUE(before.right && after.right && before.left && after.left);
    for (const Side side : {Side::left, Side::right})
      for (const double x_m : {-5.0, 0.0, 10.0}) {
        const Eigen::Vector3d p_m = T_turned_body * Eigen::Vector3d(x_m, before.on(side)->y_m(x_m), 0);
        EXPECT_NEAR(after.on(side)->y_m(p_m.x()), p_m.y(), 2 * kSeen_m);  // both are off
      }
  });
}

TEST(WallProperty, OfAMirroredScanIsMirrored) {
  forAll(20, [](Random& rnd) {
    Cloud cloud = randomRoad(rnd).cloud;
    const WallScan seen = seenIn(cloud);
    for (float& y : cloud.y) y = -y;
    const WallScan mirrored = seenIn(cloud);
    ASSERT_TRUE(seen.left && seen.right && mirrored.left && mirrored.right);
    // A point on the edge of a cell, of some hundred, goes to the other one.
    EXPECT_LT((seen.left->beta + mirrored.right->beta).norm(), 1e-3);
    EXPECT_LT((seen.right->beta + mirrored.left->beta).norm(), 1e-3);
    EXPECT_NEAR(seen.left->to_x_m, mirrored.right->to_x_m, 0.01);
  });
}

TEST(WallProperty, DoesNotSeeMoreGround) {
  forAll(20, [](Random& rnd) {
    const Road road = randomRoad(rnd);
    Cloud more = road.cloud;
    for (int i = 0; i < 20000; ++i) {
      const double x = rnd.uniform(-60, 60), y = rnd.uniform(-60, 60);
      const auto isNear = [&](const Eigen::Vector3d& beta) {
        return std::abs(y - beta[0] - x * (beta[1] + x * beta[2])) < 1;
      };
      if (isNear(road.left) || isNear(road.right)) continue;  // the foot of a wall may change it
      more.push(Eigen::Vector3d(x, y, test::kRoad_m + rnd.normal(0.02)).cast<float>());
    }
    const WallScan before = seenIn(road.cloud), after = seenIn(more);
    ASSERT_TRUE(before.left && after.left);
    EXPECT_EQ(before.left->beta, after.left->beta);  // not one bit
    EXPECT_EQ(before.right->beta, after.right->beta);
  });
}

TEST(WallProperty, HasTheSameBitsWithAnyNumberOfThreads) {
  forAll(5, [](Random& rnd) {
    const Road road = randomRoad(rnd);
    const WallScan one = seenIn(road.cloud, 1), three = seenIn(road.cloud, 3);
    ASSERT_TRUE(one.left && three.left);
    EXPECT_EQ(one.left->beta, three.left->beta);
    EXPECT_EQ(one.left->covariance, three.left->covariance);
    EXPECT_EQ(one.right->beta, three.right->beta);
  });
}

TEST(WallProperty, GoesOnBehindAGapAndACar) {
  forAll(20, [](Random& rnd) {
    const Eigen::Vector3d beta(rnd.uniform(-12, -7), rnd.uniform(-0.05, 0.05), rnd.uniform(-0.002, 0.002));
    Cloud cloud;
    addGround(cloud, rnd, 30);
    addWall(cloud, rnd, beta, -20, 12);
    addWall(cloud, rnd, beta, 24, 45);  // a pit entry, or what a car hides
    const double x_m = rnd.uniform(2, 16);
    addCar(cloud, {x_m, beta[0] + x_m * (beta[1] + x_m * beta[2]) + 2.6});  // 1.6 m before the wall
    addCar(cloud, {rnd.uniform(5, 20), 3});
    const WallScan seen = seenIn(cloud);
    ASSERT_TRUE(seen.right.has_value());
    expectNear(*seen.right, beta);
    EXPECT_GT(seen.right->to_x_m, 35) << "the gap is bridged";
    EXPECT_FALSE(seen.left.has_value()) << "a car is no wall";
  });
}

Wall someWall(Random& rnd) {
  const Side side = rnd.oneOf({Side::left, Side::right});
  const double sign = side == Side::left ? 1 : -1;
  Wall wall{side,
            {sign * rnd.uniform(2, 15), rnd.uniform(-0.1, 0.1), rnd.uniform(-0.003, 0.003)},
            1e-4 * Eigen::Matrix3d::Identity(),
            -30,
            rnd.uniform(20, 80),
            60,
            0.01,
            1,
            0};
  return wall;
}

TEST(MovedWall, StaysWhereItIs) {
  forAll(100, [](Random& rnd) {
    const Wall wall = someWall(rnd);
    const Pose T_last_now =
        poseFromRpy({rnd.uniform(0, 8), rnd.uniform(-0.2, 0.2), 0}, 0, 0, rnd.uniform(-0.05, 0.05));
    const Wall now = moved(wall, T_last_now, 0.1);
    for (const double x_m : {0.0, 10.0, 20.0}) {
      const Eigen::Vector3d p_m = T_last_now * Eigen::Vector3d(x_m, now.y_m(x_m), 0);
      // A parabola turned by 3 deg is none: 0.5 x^3 bend^2 turn.
      EXPECT_NEAR(wall.y_m(p_m.x()), p_m.y(), 0.02);
    }
    EXPECT_EQ(now.age_s, 0.1);
    EXPECT_NEAR(now.to_x_m, wall.to_x_m - T_last_now.translation().x(), 1e-9);
    EXPECT_GE(now.distanceSigma_m(), wall.distanceSigma_m());
    EXPECT_LT((moved(now, T_last_now.inverse(), 0).beta - wall.beta).norm(), 0.02);
  });
}

TEST(WallClearance, IsTheDistanceOfTheNearestPoint) {
  forAll(100, [](Random& rnd) {
    const Wall wall = someWall(rnd);
    const Eigen::Vector2d p_m(rnd.uniform(-3, 10), rnd.uniform(-1, 1));
    double nearest_m = 1e9;
    for (const double x : test::steps(-30, 40, 0.01))
      nearest_m = std::min(nearest_m, (p_m - Eigen::Vector2d(x, wall.y_m(x))).norm());
    EXPECT_NEAR(wall.clearance_m(p_m), nearest_m, 0.1);  // to first order in the slope: 0.5 d^2 bend
    EXPECT_LT(wall.clearance_m({5, wall.y_m(5) + (wall.side == Side::left ? 0.5 : -0.5)}), 0);
  });
}

TEST(WallPathProperty, LeadsSmoothlyFromTheCarToTheGap) {
  forAll(200, [](Random& rnd) {
    const Wall wall = someWall(rnd);
    WallPathOptions o;
    o.horizon_s = 30;  // to its end
    o.least_gap_m = 0;
    o.step_m = 0.2;
    const double gap_m = rnd.uniform(1.5, 5), speed_mps = rnd.oneOf({0.0, 5.0, 30.0, 70.0});
    const double curvature_per_m = 2 * wall.beta[2] + rnd.uniform(-0.5, 0.5) * o.shift_limit_mps2 /
                                                          std::max(25.0, speed_mps * speed_mps);
    const WallPath path = planAlong(wall, gap_m, speed_mps, curvature_per_m, o);
    ASSERT_GT(path.points.size(), 10U);
    const PathPoint& first = path.points.front();
    EXPECT_EQ(first.s_m, 0);
    EXPECT_NEAR(first.y_m, 0, 1e-9);
    EXPECT_NEAR(first.heading_rad, 0, 1e-9);
    EXPECT_NEAR(first.curvature_per_m, curvature_per_m, 1e-9);
    const double v_mps = std::max(speed_mps, 5.0);
    for (std::size_t k = 1; k < path.points.size(); ++k) {
      const PathPoint &a = path.points[k - 1], &b = path.points[k];
      const double step_m = std::hypot(b.x_m - a.x_m, b.y_m - a.y_m);
      EXPECT_NEAR(step_m, o.step_m, 0.01);
      EXPECT_NEAR(wrapAngle(b.heading_rad - a.heading_rad),
                  0.5 * (a.curvature_per_m + b.curvature_per_m) * step_m, 1e-3);  // trapezoids, slopes to 1
      // The shift's bounds, and the wall's own bend; slopes of 0.3 change a curvature by 15 %.
      if (!path.drivable) continue;
      EXPECT_LE(std::abs(b.curvature_per_m), o.lateral_limit_mps2 / (v_mps * v_mps) * (1 + 1e-9));
      EXPECT_LE(std::abs(b.curvature_per_m - a.curvature_per_m),
                1.2 * o.shift_limit_mps3 / (v_mps * v_mps * v_mps) * step_m + 1e-4);
    }
    const PathPoint& last = path.points.back();
    if (last.s_m > path.settled_m && std::abs(last.heading_rad) < 0.3) {
      // Parallel in y, not across: 0.5 slope^2 of the gap.
      EXPECT_NEAR(wall.clearance_m({last.x_m, last.y_m}), gap_m, 0.06 * gap_m);
    }
    EXPECT_LE(path.valid_m, last.s_m);
  });
}

TEST(WallPathProperty, OfAMirroredWallIsMirrored) {
  forAll(50, [](Random& rnd) {
    Wall wall = someWall(rnd);
    const double curvature_per_m = rnd.uniform(-0.003, 0.003);
    const WallPath path = planAlong(wall, 3, 50, curvature_per_m, {});
    wall.beta = -wall.beta;
    wall.side = wall.side == Side::left ? Side::right : Side::left;
    const WallPath mirrored = planAlong(wall, 3, 50, -curvature_per_m, {});
    ASSERT_EQ(path.points.size(), mirrored.points.size());
    for (std::size_t k = 0; k < path.points.size(); ++k) {
      EXPECT_NEAR(path.points[k].y_m, -mirrored.points[k].y_m, 1e-9);
      EXPECT_NEAR(path.points[k].curvature_per_m, -mirrored.points[k].curvature_per_m, 1e-9);
    }
  });
}

TEST(WallPathProperty, DoesNotTouchTheWallOnTheWayToTheGap) {
  forAll(200, [](Random& rnd) {  // a car that heads for the wall
    Wall wall = someWall(rnd);
    const double towards = wall.side == Side::left ? -1 : 1;
    wall.beta[1] = towards * rnd.uniform(0, 0.1);
    const WallPath path = planAlong(wall, 3, rnd.uniform(0, 70), 0, {});
    const double least_m = std::min(WallPathOptions{}.least_gap_m, wall.clearance_m({0, 0}));
    for (const PathPoint& p : path.points)
      if (p.s_m < path.settled_m) {
        EXPECT_GT(wall.clearance_m({p.x_m, p.y_m}),
                  least_m - 0.2);  // 0.05 m, and between the places looked at
      }
  });
}

TEST(GuardProperty, TimeToWallIsThatOfACarThatDrivesOn) {
  forAll(200, [](Random& rnd) {
    GuardOptions o;
    WallScan walls{0, ScanVerdict::good, std::nullopt, std::nullopt};
    Wall wall = someWall(rnd);
    wall.beta[2] = 0;
    wall.to_x_m = 1000;
    (wall.side == Side::left ? walls.left : walls.right) = wall;
    const double speed_mps = rnd.uniform(10, 70);
    const Clearance c = clearanceOf(walls, arcPath(0, 500), speed_mps, o);
    const double sign = wall.side == Side::left ? 1 : -1, closing = -sign * wall.beta[1];
    // The front wheel of a car that drives straight on meets a straight wall here.
    const double x_m = (wall.distance_m() - o.half_width_m) / closing - o.wheelbase_m;
    if (closing > 0 && x_m < 490) {
      ASSERT_TRUE(c.time_to_wall_s.has_value());
      EXPECT_NEAR(*c.time_to_wall_s, x_m / speed_mps, 1e-6);
      EXPECT_LE(*c.time_to_close_s, *c.time_to_wall_s);
    } else if (closing < 0) {
      EXPECT_FALSE(c.time_to_wall_s.has_value());
      EXPECT_FALSE(c.time_to_close_s.has_value());
    }
  });
}

TEST(SteeringHandoverProperty, MakesNoStepAndEnds) {
  forAll(200, [](Random& rnd) {
    const GuardOptions o;
    SteeringHandover handover(o);
    constexpr double kStep_s = 0.01;
    double before_rad = 0, wanted_before_rad = 0, since_s = 0;
    GuardState state = GuardState::localized;
    for (int k = 0; k < 500; ++k) {
      const GuardState state_before = state;
      if (rnd.uniform(0, 1) < 0.01) {
        state = rnd.oneOf(
            {GuardState::localized, GuardState::wall_following, GuardState::emergency, GuardState::no_wall});
        since_s = 0;
      }
      // Each controller wants something smooth of its own.
      const double wanted_rad = 0.1 * std::sin(0.02 * k + 2 * static_cast<double>(state));
      const double command_rad = handover.steer(state, wanted_rad, kStep_s);
      const double own_rad = state != state_before ? 0 : std::abs(wanted_rad - wanted_before_rad);
      if (k > 0) {
        EXPECT_LE(std::abs(command_rad - before_rad),
                  own_rad + kDegree * o.emergency_deg_per_s * kStep_s + 1e-12);
      }
      if (since_s > 0.2 / (kDegree * o.handover_deg_per_s)) {
        EXPECT_EQ(command_rad, wanted_rad);
      }
      before_rad = command_rad;
      wanted_before_rad = wanted_rad;
      since_s += kStep_s;
    }
  });
}

}  // namespace
}  // namespace raceloc
