/** \file
 * Laws of the line that a car is told, as it lies about it. */
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <stdexcept>

#include "support/forall.h"
#include "wall/tracked_path.h"

namespace raceloc {
namespace {

using test::forAll;
using test::Random;

constexpr double kRadius_m = 150;
constexpr double kUnknown = std::numeric_limits<double>::quiet_NaN();

/** Counter-clockwise about the origin, points 1 m apart, on the plane z = slope * x. */
std::vector<Eigen::Vector3d> circle(double slope, bool with_heights = true) {
  constexpr int kPoints = 942;
  std::vector<Eigen::Vector3d> line_m;
  for (int i = 0; i < kPoints; ++i) {
    const double at_rad = 2 * M_PI * i / kPoints;
    const double x_m = kRadius_m * std::cos(at_rad);
    line_m.emplace_back(x_m, kRadius_m * std::sin(at_rad), with_heights ? slope * x_m : kUnknown);
  }
  return line_m;
}

/** On the circle at an angle, left of it by so much, turned to its left by so much. */
Pose onCircle(double at_rad, double left_m = 0, double turned_rad = 0) {
  const double r_m = kRadius_m - left_m;
  return poseFromRpy({r_m * std::cos(at_rad), r_m * std::sin(at_rad), 0}, 0, 0,
                     at_rad + M_PI / 2 + turned_rad);
}

void expectSame(const Path& a, const Path& b, double within_m) {
  ASSERT_EQ(a.size(), b.size());
  for (std::size_t i = 0; i < a.size(); ++i) {
    EXPECT_NEAR(a[i].s_m, b[i].s_m, within_m);
    EXPECT_NEAR(a[i].x_m, b[i].x_m, within_m);
    EXPECT_NEAR(a[i].y_m, b[i].y_m, within_m);
    EXPECT_NEAR(wrapAngle(a[i].heading_rad - b[i].heading_rad), 0, within_m);
  }
}

TEST(ToldLineProperty, IsTheArcThatACarOnItDrives) {
  const ToldLine line(circle(0));
  forAll(20, [&](Random& rnd) {
    const Path path = line.from(onCircle(rnd.uniform(-10, 10)), 60);
    constexpr double kChord_m = 1.0 / 8 / kRadius_m;  // sagitta of 1 m
    double turned_rad = 0;
    for (std::size_t i = 0; i < path.size(); ++i) {
      EXPECT_NEAR(std::hypot(path[i].x_m, path[i].y_m - kRadius_m), kRadius_m, 2 * kChord_m);
      if (i > 0) turned_rad += path[i].curvature_per_m * (path[i].s_m - path[i - 1].s_m);
    }
    EXPECT_NEAR(turned_rad, path.back().s_m / kRadius_m, 1.1 / kRadius_m);  // within a corner
    const PathPoint here = beside(path, Eigen::Vector2d::Zero());
    EXPECT_NEAR(here.heading_rad, 0, 1 / kRadius_m);
    EXPECT_NEAR(path.back().s_m - here.s_m, 60, 1.01);
  });
}

TEST(ToldLineProperty, LiesAsItDidWhenMapAndCarAreMoved) {
  forAll(20, [](Random& rnd) {
    const Pose T_moved_map = poseFromRpy({rnd.uniform(-1e3, 1e3), rnd.uniform(-1e3, 1e3), rnd.uniform(-9, 9)},
                                         0, 0, rnd.uniform(-M_PI, M_PI));
    std::vector<Eigen::Vector3d> moved_m = circle(0);
    for (auto& p_m : moved_m) p_m = T_moved_map * p_m;
    const Pose T = onCircle(rnd.uniform(-9, 9), rnd.uniform(-5, 5), rnd.uniform(-0.5, 0.5));
    expectSame(ToldLine(circle(0)).from(T, 80), ToldLine(moved_m).from(T_moved_map * T, 80), 1e-6);
  });
}

TEST(ToldLineProperty, OnAPlaneIsTheSameWithHeightsAndWithout) {
  forAll(20, [](Random& rnd) {
    const double slope = rnd.uniform(-0.4, 0.4);
    // A car that stands on the plane, beside the line.
    const double at_rad = rnd.uniform(-9, 9), heading_rad = at_rad + M_PI / 2;
    const double r_m = kRadius_m - rnd.uniform(-8, 8);
    const Eigen::Vector3d up = Eigen::Vector3d(-slope, 0, 1).normalized();
    const Eigen::Vector3d ahead =
        Eigen::Vector3d(std::cos(heading_rad), std::sin(heading_rad), slope * std::cos(heading_rad))
            .normalized();
    Pose T = Pose::Identity();
    T.linear() << ahead, up.cross(ahead), up;
    T.translation() << r_m * std::cos(at_rad), r_m * std::sin(at_rad), slope * r_m * std::cos(at_rad);
    const Path with = ToldLine(circle(slope)).from(T, 80);
    expectSame(with, ToldLine(circle(slope, false)).from(T, 80), 1e-9);
    // In its own plane the way is as long as it is.
    EXPECT_GT(with.back().s_m, 84.9);
  });
}

TEST(ToldLineProperty, IsNotThereForACarThatIsElsewhere) {
  const ToldLine line(circle(0));
  EXPECT_FALSE(line.from(onCircle(1, 9), 60).empty());
  EXPECT_TRUE(line.from(onCircle(1, 11), 60).empty());
  EXPECT_FALSE(line.from(onCircle(1, 0, 55 * kDegree), 60).empty());
  EXPECT_TRUE(line.from(onCircle(1, 0, 70 * kDegree), 60).empty());  // 10 m on it has turned by 4
  EXPECT_TRUE(line.from(onCircle(1, 0, M_PI), 60).empty());
}

TEST(ToldLineProperty, NeedsThreePoints) {
  EXPECT_THROW(ToldLine({}), std::invalid_argument);
  EXPECT_THROW(ToldLine({{0, 0, 0}, {5, 0, 0}, {5, 0, 3}}), std::invalid_argument);
  EXPECT_FALSE(ToldLine({{0, 0, 0}, {50, 0, 0}, {50, 50, 0}}).from(Pose::Identity(), 10).empty());
}

TEST(ToldLineProperty, AtACrossingIsTheLegThatTheCarDrives) {
  std::vector<Eigen::Vector3d> eight_m;
  for (int i = 0; i < 400; ++i) {
    const double at_rad = 2 * M_PI * i / 400;
    eight_m.emplace_back(100 * std::sin(at_rad), 50 * std::sin(2 * at_rad), kUnknown);
  }
  const ToldLine line(eight_m);
  for (const double heading_rad : {M_PI / 4, 3 * M_PI / 4}) {  // x and y with equal slopes in the middle
    const Path path = line.from(poseFromRpy({0, 0, 0}, 0, 0, heading_rad), 20);
    ASSERT_FALSE(path.empty());
    EXPECT_NEAR(path.back().heading_rad, 0, 0.5);
    EXPECT_NEAR(path.back().y_m, 0, 4);
  }
}

TEST(TrackedPath, BeginsAtTheCarAndComesOntoTheLine) {
  const ToldLine line(circle(0));
  forAll(50, [&](Random& rnd) {
    const double left_m = rnd.uniform(-4, 4), ahead_m = rnd.uniform(5, 30);
    const Path path =
        trackedPath(line.from(onCircle(rnd.uniform(-9, 9), left_m), 12 * ahead_m + 60), ahead_m);
    ASSERT_FALSE(path.empty());
    const Eigen::Vector2d middle_m(0, kRadius_m - left_m);
    const auto off_m = [&](const PathPoint& q) {
      return std::abs((Eigen::Vector2d(q.x_m, q.y_m) - middle_m).norm() - kRadius_m);
    };
    EXPECT_LE(path.front().s_m, 1.1);
    EXPECT_NEAR(path.front().x_m, path.front().s_m, 0.1);
    EXPECT_NEAR(path.front().y_m, 0, 1.1 / ahead_m + 0.05);  // by at most a metre's way of coming nearer
    for (std::size_t i = 1; i < path.size(); ++i) {
      EXPECT_LE(off_m(path[i]), off_m(path[i - 1]) + 1e-3);
      EXPECT_LE(off_m(path[i - 1]) - off_m(path[i]),
                1.05 / ahead_m * 1.1);  // no steeper than 1 m over ahead_m
    }
    // 4 m at that slope take 3 times ahead_m, the last metre fades by e in each.
    EXPECT_NEAR(off_m(path.back()), 0, 0.01);
  });
  EXPECT_TRUE(trackedPath({}, 10).empty());
}

}  // namespace
}  // namespace raceloc
