#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>

#include "core/errors.h"
#include "graph/g2o_file.h"
#include "graph/optimise.h"
#include "support/graphs.h"

namespace raceloc {
namespace {

using ::testing::HasSubstr;

std::string file(const std::string& text) {
  std::string path =  // of each test its own: they run side by side
      ::testing::TempDir() + ::testing::UnitTest::GetInstance()->current_test_info()->name() + "_graph.g2o";
  std::ofstream(path) << text;
  return path;
}

std::string refusal(const std::string& text) {
  try {
    (void)readG2o(file(text));
  } catch (const InputError& e) {
    return e.what();
  }
  return "accepted";
}

const char kEdge[] = "EDGE_SE3:QUAT 0 1 1 0 0 0 0 0 1 1 0 0 0 0 0 1 0 0 0 0 1 0 0 0 4 0 0 4 0 4\n";

TEST(G2o, StartsFromTheEdgesWhereThereIsNoVertex) {
  const PoseGraph graph = readG2o(file(kEdge));
  ASSERT_EQ(graph.T_map_body.size(), 2U);
  EXPECT_TRUE(graph.T_map_body[1].translation().isApprox(Eigen::Vector3d::UnitX()));
  EXPECT_EQ(graph.held, 0U);
  EXPECT_NEAR(std::get<BetweenFactor>(graph.factors[0]).whitening(0, 0), 2, 1e-15);  // rotation first, here
}

TEST(G2o, ReadsPlanarGraphs) {
  const PoseGraph graph = readG2o(
      file("VERTEX_SE2 7 1 2 0.5\nVERTEX_SE2 3 2 2 0\n# a remark\nEDGE_SE2 7 3 1 0 0 4 0 0 9 0 16\nFIX 3\n"));
  EXPECT_NEAR(yawOf(graph.T_map_body[0]), 0.5, 1e-15);
  EXPECT_EQ(graph.held, 1U);
  const Matrix6d W = std::get<BetweenFactor>(graph.factors[0]).whitening;
  EXPECT_EQ(Vector6d(W.diagonal()), (Vector6d() << 1, 1, 4, 2, 3, 1).finished());
}

TEST(G2o, NamesFileAndLineOfWhatItRefuses) {
  EXPECT_THAT(refusal(std::string(kEdge) + "EDGE_SE3:QUAT 1 2 1 0 0 0 0 0\n"),
              HasSubstr("graph.g2o:2: EDGE_SE3:QUAT has 6 readable numbers where 7 must be"));
  EXPECT_THAT(refusal("EDGE_SE3:QUAT 0 x\n"), HasSubstr("without the number of a pose"));
  EXPECT_THAT(refusal("VERTEX_XY 0 1 2\n"), HasSubstr(":1: 'VERTEX_XY' is no tag"));
  EXPECT_THAT(refusal("VERTEX_SE2 0 1 2 3 4\n"), HasSubstr("goes on with '4'"));
  EXPECT_THAT(refusal("VERTEX_SE2 0 1 2 nan\n"), HasSubstr("2 readable numbers"));
  EXPECT_THAT(refusal("VERTEX_SE2 0 1 2 3\nVERTEX_SE2 0 1 2 3\n"), HasSubstr(":2: pose 0 is there already"));
  EXPECT_THAT(refusal("VERTEX_SE3:QUAT 0 0 0 0 0 0 0 0.5\n"), HasSubstr("norm is not 1"));
  EXPECT_THAT(refusal("EDGE_SE2 0 0 1 0 0 1 0 0 1 0 1\n"), HasSubstr("to itself"));
  EXPECT_THAT(refusal("EDGE_SE2 0 1 1 0 0 1 0 0 -1 0 1\n"), HasSubstr("not positive definite"));
  EXPECT_THAT(refusal(std::string(kEdge) + "EDGE_SE2 5 6 1 0 0 1 0 0 1 0 1\n"),
              HasSubstr(":2: neither pose 5 nor pose 6"));
  EXPECT_THAT(refusal("FIX 0\n"), HasSubstr("not there yet"));
  EXPECT_THAT(refusal(std::string(kEdge) + "FIX 0\nFIX 1\n"), HasSubstr(":3: a second FIX"));
  EXPECT_THAT(refusal("EDGE3 0 1 0 0 0 0 1.5707963267948966 0\n"), HasSubstr("right angle"));
  EXPECT_THAT(refusal("\n"), HasSubstr("no vertex and no edge"));
  EXPECT_THROW((void)readG2o("/nowhere/graph.g2o"), InputError);
}

class PublicGraph : public ::testing::Test {
 protected:
  /** \param start, end  chi-square that others report, \param share  to which theirs and ours agree */
  static void reaches(const std::string& name, double start, double end, double share) {
    const std::string path = std::string(RACELOC_ROOT "/../shared/data/g2o/") + name;
    if (!std::filesystem::exists(path)) GTEST_SKIP() << "no " << path;
    PoseGraph graph = readG2o(path);
    EXPECT_NEAR(chiSquareOf(graph), start, share * start);
    const OptimiseResult result = optimise(graph, {});
    EXPECT_TRUE(result.converged);
    EXPECT_NEAR(2 * result.final_cost, end, share * end);
    // Ceres, from there, finds nothing better: ours stops at a decrease of 1e-10 of the cost, and poses go with
    // its root, in sigmas of the loosest direction.
    const auto [poses, cost] = test::solvedByCeres(graph);
    EXPECT_NEAR(result.final_cost, cost, 1e-6 * cost);
    EXPECT_LT(test::difference(graph.T_map_body, poses), 1e-6);
  }
};

TEST_F(PublicGraph, ParkingGarage) { reaches("parking-garage.g2o", 16725, 1.2684, 1e-3); }

// The reference was taken from a file whose angles somebody had turned into quaternions: 0.1 % apart.
TEST_F(PublicGraph, Sphere2500) { reaches("sphere2500.txt", 2.585e6, 1351.4, 2e-3); }

}  // namespace
}  // namespace raceloc
