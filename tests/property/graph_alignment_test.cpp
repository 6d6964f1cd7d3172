#include "graph/graph_alignment.h"

#include <gtest/gtest.h>

#include "support/forall.h"

namespace raceloc {
namespace {

using test::forAll;
using test::Random;

using Points = std::vector<Eigen::Vector3d>;
const Eigen::Vector3d kUp = Eigen::Vector3d::UnitZ();

Points moved(const Pose& T, const Points& points) {
  Points out;
  for (const auto& p : points) out.push_back(T * p);
  return out;
}

Points cloudOf(Random& rnd, int points, double size_m) {
  Points out;
  for (int i = 0; i < points; ++i) out.push_back(rnd.vectorWithin(size_m));
  return out;
}

/** Key poses of an oval lap with hills. */
Points lap(Random& rnd, int points) {
  const double a_m = rnd.uniform(50, 400), b_m = rnd.uniform(0.3, 1) * a_m;
  Points out;
  for (int i = 0; i < points; ++i) {
    const double angle_rad = 2 * M_PI * i / points;
    out.emplace_back(a_m * std::cos(angle_rad), b_m * std::sin(angle_rad), 3 * std::sin(2 * angle_rad));
  }
  return out;
}

/** Farthest from where it belongs that a point lands. */
double worst_m(const Pose& T_to_from, const Points& from, const Points& to) {
  double worst = 0;
  for (std::size_t i = 0; i < from.size(); ++i) worst = std::max(worst, (T_to_from * from[i] - to[i]).norm());
  return worst;
}

TEST(AlignGraphsProperty, UndoesAnyRigidMotion) {
  forAll(200, [](Random& rnd) {
    const Pose T = rnd.pose(M_PI, 500);
    const Points from = cloudOf(rnd, rnd.oneOf({2, 3, 4, 100}), 50), to = moved(T, from);
    const auto aligned = alignGraphs(from, to, kUp, T.linear() * kUp);
    EXPECT_TRUE(aligned.T_to_from.isApprox(T, 1e-9));  // rounding at 500 m
    EXPECT_LT(aligned.rmse_m, 1e-9);
    EXPECT_EQ(aligned.inlier_share, 1);
  });
}

TEST(AlignGraphsProperty, WrongPartnersDoNotBendIt) {
  forAll(100, [](Random& rnd) {
    const Pose T = rnd.pose(M_PI, 500);
    const Points from = lap(rnd, 200), truth = moved(T, from);
    Points to = truth;
    // Each wrong in its own way anywhere, or a stretch of the lap all the same way.
    const bool together = rnd.oneOf({true, false});
    const Eigen::Vector3d aside_m = rnd.vectorWithin(1).normalized() * rnd.uniform(5, 50);
    const double share = rnd.uniform(0, 0.4);
    const auto wrong = static_cast<std::size_t>(share * 200);
    const auto first = static_cast<std::size_t>(rnd.integer(0, 199));
    for (std::size_t k = 0; k < wrong; ++k)
      to[(first + (together ? 1 : 7) * k) % 200] +=
          together ? aside_m : Eigen::Vector3d(rnd.vectorWithin(1).normalized() * rnd.uniform(5, 50));
    const auto aligned = alignGraphs(from, to, kUp, T.linear() * kUp);
    EXPECT_LT(worst_m(aligned.T_to_from, from, truth), 0.01)  // what weights of (0.5 m / 5 m)^4 leave
        << share << (together ? " in a stretch" : " strewn");
    EXPECT_GE(aligned.inlier_share, 1 - share - 1e-9);
  });
}

TEST(AlignGraphsProperty, UpKeepsTheRollAboutAStraight) {
  forAll(100, [](Random& rnd) {
    const Pose T = rnd.pose(M_PI, 500);
    const Eigen::Vector3d along = Eigen::Vector3d(1, 0, rnd.uniform(-0.2, 0.2)).normalized();
    Points from, to;
    for (int i = 0; i < 100; ++i) {
      from.push_back(2.0 * i * along);
      to.push_back(T * from.back() + Eigen::Vector3d(rnd.normal(0.02), rnd.normal(0.02), rnd.normal(0.02)));
    }
    const auto aligned = alignGraphs(from, to, kUp, T.linear() * kUp);
    // 2 cm of noise on 200 m: 3e-5 rad across; about the line the up vectors weigh 2e4 times the noise's moment.
    EXPECT_LT(Eigen::AngleAxisd(T.linear().transpose() * aligned.T_to_from.linear()).angle(), 2e-4);
    EXPECT_NEAR(aligned.rmse_m, 0.02 * std::sqrt(3), 0.01);
  });
}

TEST(AlignGraphsProperty, ARigidMoveOfBothSetsMovesTheResult) {
  forAll(100, [](Random& rnd) {
    const Pose T = rnd.pose(M_PI, 100), A = rnd.pose(M_PI, 500), B = rnd.pose(M_PI, 500);
    const Points from = lap(rnd, 100);
    Points to = moved(T, from);
    for (auto& p : to)
      p += rnd.vectorWithin(0.1) + (rnd.uniform(0, 1) < 0.2 ? rnd.vectorWithin(20) : kUp * 0);
    const auto here = alignGraphs(from, to, kUp, T.linear() * kUp);
    const auto there =
        alignGraphs(moved(A, from), moved(B, to), A.linear() * kUp, B.linear() * (T.linear() * kUp));
    // Both stop when a round moves less than 1e-9 of some 500 m; rounds contract slowly.
    EXPECT_LT((there.T_to_from.matrix() - (B * here.T_to_from * A.inverse()).matrix()).norm(), 1e-4);
    EXPECT_NEAR(there.rmse_m, here.rmse_m, 1e-6);
    EXPECT_EQ(there.inlier_share, here.inlier_share);
  });
}

TEST(AlignGraphs, RefusesFewerThanTwoPairs) {
  const Points none, one{kUp}, two{kUp, -kUp};
  EXPECT_THROW((void)alignGraphs(none, none), std::invalid_argument);
  EXPECT_THROW((void)alignGraphs(one, one), std::invalid_argument);
  EXPECT_THROW((void)alignGraphs(two, one), std::invalid_argument);
  EXPECT_NO_THROW((void)alignGraphs(two, two));
}

}  // namespace
}  // namespace raceloc
