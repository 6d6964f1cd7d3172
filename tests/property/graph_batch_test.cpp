#include <gtest/gtest.h>

#include "graph/g2o_file.h"
#include "graph/optimise.h"
#include "support/graphs.h"

namespace raceloc {
namespace {

using test::forAll;
using test::Random;

Matrix6d randomWhitening(Random& rnd) {
  Matrix6d A;
  for (int k = 0; k < 36; ++k) A(k) = rnd.normal();
  return whiteningOf(Matrix6d(A * A.transpose() + Matrix6d::Identity()));
}

std::vector<Factor> oneOfEachKind(Random& rnd, const RobustLoss& loss) {
  const Matrix6d W = randomWhitening(rnd);
  const Eigen::Matrix3d W3 = W.topLeftCorner<3, 3>();
  return {PriorFactor{0, rnd.pose(1.5, 10), W, loss}, BetweenFactor{1, 0, rnd.pose(1.5, 10), W, loss},
          PositionFactor{0, rnd.vectorWithin(10), rnd.vectorWithin(2), W3, loss},
          AttitudeFactor{0, rnd.pose(1.5, 1).linear(), W3, loss},
          LevelFactor{0, rnd.vectorWithin(1).normalized(), rnd.uniform(0.1, 2), loss}};
}

TEST(FactorProperty, JacobiansAreTheNumericOnes) {
  forAll(100, [](Random& rnd) {
    const std::vector<Pose> poses{rnd.pose(1.0, 10), rnd.pose(1.0, 10)};
    for (const Factor& factor : oneOfEachKind(rnd, {})) {
      const LinearFactor at = linearise(factor, poses);
      for (std::size_t pose = 0; pose < 2; ++pose) {
        const Matrix6d& J = pose == at.i ? at.J_i : at.J_j;
        if (pose != at.i && pose != at.j) continue;
        for (int k = 0; k < 6; ++k) {
          const double h = 1e-6;
          std::vector<Pose> ahead = poses, behind = poses;
          ahead[pose] = ahead[pose] * se3Exp(h * Vector6d::Unit(k));
          behind[pose] = behind[pose] * se3Exp(-h * Vector6d::Unit(k));
          const Vector6d numeric = (linearise(factor, ahead).r - linearise(factor, behind).r) / (2 * h);
          // Central differences: h^2 times third derivatives, and 1e-16 / h of rounding, on numbers up to 100.
          EXPECT_LT((numeric - J.col(k)).norm(), 1e-6) << "kind " << factor.index() << " column " << k;
        }
      }
    }
  });
}

TEST(RobustLossProperty, WeightIsTheDerivativeOfTheCost) {
  forAll(100, [](Random& rnd) {
    for (const auto kind : {RobustLoss::Kind::none, RobustLoss::Kind::huber, RobustLoss::Kind::cauchy}) {
      const RobustLoss loss{kind, rnd.uniform(0.5, 5)};
      const double s = rnd.uniform(0, 100), h = 1e-5;
      EXPECT_NEAR((loss.cost(s + h) - loss.cost(s)) / h, loss.weight(s), 1e-4);  // forward: h times curvature
      EXPECT_NEAR(loss.cost(1e-6), 1e-6, 1e-11);
    }
  });
}

TEST(OptimiseProperty, AgreesWithCeres) {
  forAll(8, [](Random& rnd) {
    PoseGraph graph = test::randomGraph(rnd, 60, 20, {RobustLoss::Kind::cauchy, 3});
    for (Factor& factor : oneOfEachKind(rnd, {RobustLoss::Kind::huber, 1})) graph.factors.push_back(factor);
    const auto [poses, cost] = test::solvedByCeres(graph);
    const auto result = optimise(graph, {200, 1e-14});
    EXPECT_TRUE(result.converged);
    EXPECT_NEAR(result.final_cost, cost, 1e-6 * cost);
    EXPECT_LT(test::difference(graph.T_map_body, poses), 1e-6);  // both stop when the cost is flat to 1e-14
  });
}

TEST(OptimiseProperty, ARigidMoveOfAllInputsMovesTheResult) {
  forAll(5, [](Random& rnd) {
    PoseGraph graph = test::randomGraph(rnd, 50, 15);
    PoseGraph moved = graph;
    const Pose T_new_map = rnd.pose(3, 500);
    for (Pose& T : moved.T_map_body) T = T_new_map * T;
    auto& prior = std::get<PriorFactor>(moved.factors[0]);
    prior.T_map_body = T_new_map * prior.T_map_body;
    optimise(graph, {100, 1e-14});
    optimise(moved, {100, 1e-14});
    for (Pose& T : graph.T_map_body) T = T_new_map * T;
    EXPECT_LT(test::difference(graph.T_map_body, moved.T_map_body), 1e-9);
  });
}

TEST(Optimise, SameInputSameBits) {
  Random rnd(3);
  const PoseGraph graph = test::randomGraph(rnd, 80, 30);
  PoseGraph a = graph, b = graph;
  optimise(a, {});
  optimise(b, {});
  for (std::size_t i = 0; i < a.T_map_body.size(); ++i)
    EXPECT_EQ(a.T_map_body[i].matrix(), b.T_map_body[i].matrix());
}

TEST(Optimise, AHeldPoseStaysToTheLastBit) {
  Random rnd(4);
  PoseGraph graph = test::randomGraph(rnd, 30, 10);
  graph.factors.erase(graph.factors.begin());  // the prior
  graph.held = 7;
  const Pose before = graph.T_map_body[7];
  EXPECT_TRUE(optimise(graph, {}).converged);
  EXPECT_EQ(graph.T_map_body[7].matrix(), before.matrix());
}

TEST(Optimise, RefusesAPoseThatNothingDetermines) {
  Random rnd(5);
  PoseGraph graph = test::randomGraph(rnd, 10, 2);
  graph.T_map_body.push_back(Pose::Identity());
  EXPECT_THROW(optimise(graph, {}), std::invalid_argument);
}

TEST(Optimise, RefusesAFactorOfNoPose) {
  PoseGraph graph{{Pose::Identity()}, {LevelFactor{1, Eigen::Vector3d::UnitZ(), 0.1, {}}}, std::nullopt};
  EXPECT_THROW(optimise(graph, {}), std::out_of_range);
}

TEST(G2oProperty, ReadsWhatItWrites) {
  Random rnd(6);
  PoseGraph graph = test::randomGraph(rnd, 40, 10);
  graph.held = 2;
  const std::string path = ::testing::TempDir() + "written.g2o";
  EXPECT_EQ(writeG2o(path, graph), 1U);  // the prior has no line
  const PoseGraph read = readG2o(path);
  EXPECT_EQ(read.held, graph.held);
  ASSERT_EQ(read.factors.size() + 1, graph.factors.size());
  EXPECT_LT(test::difference(read.T_map_body, graph.T_map_body), 1e-14);  // 17 digits, one normalisation
  graph.factors.erase(graph.factors.begin());
  EXPECT_NEAR(chiSquareOf(read), chiSquareOf(graph), 1e-9 * chiSquareOf(graph));
}

}  // namespace
}  // namespace raceloc
