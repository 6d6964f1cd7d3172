#include <gtest/gtest.h>

#include <Eigen/LU>

#include "graph/smoother.h"
#include "support/graphs.h"

namespace raceloc {
namespace {

using test::forAll;
using test::Random;

constexpr OptimiseOptions kToTheEnd{200, 1e-14};

/** The graph's poses one by one, each with the factors that have become possible. */
void replay(const PoseGraph& graph, Smoother& smoother) {
  std::vector<std::vector<Factor>> factors_at(graph.T_map_body.size());
  for (const Factor& factor : graph.factors) {
    const std::size_t j = secondKey(factor);
    factors_at[j == kNoPose ? firstKey(factor) : std::max(firstKey(factor), j)].push_back(factor);
  }
  for (std::size_t i = 0; i < graph.T_map_body.size(); ++i) {
    const Pose guess =
        i == 0 ? graph.T_map_body[0]
               : smoother.graph().T_map_body[i - 1] * graph.T_map_body[i - 1].inverse() * graph.T_map_body[i];
    smoother.update({guess}, factors_at[i]);
  }
}

TEST(SmootherProperty, EndsWhereTheBatchSolutionIs) {
  forAll(6, [](Random& rnd) {
    PoseGraph graph = test::randomGraph(rnd, rnd.integer(30, 600), 40);
    Smoother smoother({});
    replay(graph, smoother);
    const auto batch = optimise(graph, kToTheEnd);
    // Before the end: rest_sigma and model_sigma, squared, for some of the poses.
    EXPECT_LT(costOf(smoother.graph()), batch.final_cost * 1.02);
    const auto last = smoother.finish(kToTheEnd);
    EXPECT_NEAR(last.final_cost, batch.final_cost, 1e-9 * batch.final_cost);
    EXPECT_LT(test::difference(smoother.graph().T_map_body, graph.T_map_body), 1e-6);
  });
}

TEST(SmootherProperty, FalseLoopsDoNotBendIt) {
  forAll(4, [](Random& rnd) {
    const RobustLoss cauchy{RobustLoss::Kind::cauchy, 2};
    PoseGraph good = test::randomGraph(rnd, 150, 30, cauchy);
    PoseGraph graph = good;
    const Matrix6d W = std::get<BetweenFactor>(good.factors.back()).whitening;
    for (std::size_t k = 0; k < 5; ++k)
      graph.factors.emplace_back(BetweenFactor{10 + 20 * k, 60 + 20 * k % 80, rnd.pose(1, 20), W, cauchy});
    Smoother smoother({});
    replay(graph, smoother);
    smoother.finish(kToTheEnd);
    optimise(good, kToTheEnd);
    double worst_m = 0;
    for (std::size_t i = 0; i < good.T_map_body.size(); ++i)
      worst_m = std::max(
          worst_m, (good.T_map_body[i].translation() - smoother.graph().T_map_body[i].translation()).norm());
    EXPECT_LT(worst_m, 0.15);  // 3 sigma of one step
  });
}

TEST(SmootherProperty, ARigidMoveOfAllInputsMovesTheResult) {
  forAll(3, [](Random& rnd) {
    const PoseGraph graph = test::randomGraph(rnd, 80, 20);
    PoseGraph moved = graph;
    const Pose T_new_map = rnd.pose(3, 500);
    for (Pose& T : moved.T_map_body) T = T_new_map * T;
    auto& prior = std::get<PriorFactor>(moved.factors[0]);
    prior.T_map_body = T_new_map * prior.T_map_body;
    Smoother a({}), b({});
    replay(graph, a);
    replay(moved, b);
    std::vector<Pose> expected = a.graph().T_map_body;
    for (Pose& T : expected) T = T_new_map * T;
    EXPECT_LT(test::difference(b.graph().T_map_body, expected), 1e-6);  // rounding, 500 m from the origin
  });
}

TEST(SmootherProperty, MarginalsAreBlocksOfTheInverse) {
  forAll(5, [](Random& rnd) {
    const PoseGraph graph = test::randomGraph(rnd, 40, 12);
    Smoother smoother({});
    replay(graph, smoother);
    smoother.finish(kToTheEnd);
    Eigen::MatrixXd H = Eigen::MatrixXd::Zero(240, 240);
    for (const Factor& factor : graph.factors) {
      const LinearFactor term = linearise(factor, smoother.graph().T_map_body);
      Eigen::MatrixXd J = Eigen::MatrixXd::Zero(6, 240);
      J.middleCols<6>(static_cast<Eigen::Index>(6 * term.i)) = term.J_i;
      if (term.j != kNoPose) J.middleCols<6>(static_cast<Eigen::Index>(6 * term.j)) = term.J_j;
      H += J.transpose() * J;
    }
    const Eigen::MatrixXd covariance = H.inverse();
    for (std::size_t i = 0; i < 40; ++i) {
      const auto at = static_cast<Eigen::Index>(6 * i);  // to the condition number of H times rounding
      EXPECT_TRUE(smoother.marginalCovariance(i).isApprox(covariance.block<6, 6>(at, at), 1e-8)) << i;
    }
  });
}

TEST(Smoother, SameInputSameBits) {
  Random rnd(7);
  const PoseGraph graph = test::randomGraph(rnd, 400, 60);
  Smoother a({}), b({});
  replay(graph, a);
  replay(graph, b);
  for (std::size_t i = 0; i < graph.T_map_body.size(); ++i)
    EXPECT_EQ(a.graph().T_map_body[i].matrix(), b.graph().T_map_body[i].matrix());
}

TEST(Smoother, DoesNotSolveTheWholeGraphAtEachStep) {
  Random rnd(8);
  const PoseGraph graph = test::randomGraph(rnd, 1000, 0);
  Smoother smoother({});
  replay(graph, smoother);
  EXPECT_LE(smoother.renewals(), 5);  // room for 256 more, then for half as many again
}

TEST(Smoother, TakesSeveralPosesAndFactorsOfOldOnesInOneUpdate) {
  Random rnd(9);
  PoseGraph graph = test::randomGraph(rnd, 60, 20);
  Smoother smoother({});
  const std::vector<Pose> first(graph.T_map_body.begin(), graph.T_map_body.begin() + 30);
  const std::vector<Pose> second(graph.T_map_body.begin() + 30, graph.T_map_body.end());
  std::vector<Factor> now, later;
  for (const Factor& factor : graph.factors) {
    const bool possible = firstKey(factor) < 30 && (secondKey(factor) == kNoPose || secondKey(factor) < 30);
    (possible && now.size() < 35 ? now : later).push_back(factor);
  }
  smoother.update(first, now);
  smoother.update(second, later);
  smoother.finish(kToTheEnd);
  optimise(graph, kToTheEnd);
  EXPECT_LT(test::difference(smoother.graph().T_map_body, graph.T_map_body), 1e-6);
}

TEST(Smoother, RefusesAPoseThatNothingDetermines) {
  Smoother smoother({}, 0);
  smoother.update({Pose::Identity()}, {});
  EXPECT_THROW(smoother.update({Pose::Identity()}, {}), std::invalid_argument);
}

TEST(Smoother, RefusesAFactorOfNoPoseAndGoesOn) {
  Smoother smoother({}, 0);
  EXPECT_THROW(smoother.update({Pose::Identity()}, {LevelFactor{3, Eigen::Vector3d::UnitZ(), 0.1, {}}}),
               std::out_of_range);
  smoother.update({Pose::Identity()}, {});
  EXPECT_EQ(smoother.graph().T_map_body.size(), 1U);
  EXPECT_THROW((void)smoother.marginalCovariance(1), std::out_of_range);
}

}  // namespace
}  // namespace raceloc
