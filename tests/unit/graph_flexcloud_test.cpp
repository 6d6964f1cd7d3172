/** \file
 * The graphs of a real drive: 2386 GNSS positions and LiDAR poses over 6.5 km, recorded beside the checkout. */
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <vector>

#include "core/statistics.h"
#include "graph/graph_alignment.h"
#include "graph/map_graphs.h"

namespace raceloc {
namespace {

const std::string kFolder = RACELOC_ROOT "/../shared/data/flexcloud/";

std::vector<Keyframe> keyframesOf() {
  std::ifstream lidar(kFolder + "poses_keyframes.txt"), gnss(kFolder + "positions_interpolated.txt");
  std::vector<Keyframe> keyframes;
  double stamp_ns = 0, stamp_s = 0;
  Eigen::Vector3d p, at, sigma;
  Eigen::Quaterniond q;
  while (lidar >> stamp_ns >> p.x() >> p.y() >> p.z() >> q.x() >> q.y() >> q.z() >> q.w()) {
    if (!(gnss >> stamp_s >> at.x() >> at.y() >> at.z() >> sigma.x() >> sigma.y() >> sigma.z())) break;
    Keyframe k{stamp_s, Pose::Identity(), {}};
    k.T_odom_body.linear() = q.normalized().toRotationMatrix();
    k.T_odom_body.translation() = p;
    if (!keyframes.empty())
      k.since_last = {stamp_s - keyframes.back().stamp_s,
                      keyframes.back().T_odom_body.inverse() * k.T_odom_body, Matrix6d::Zero()};
    k.gps.push_back({"gnss", at, Eigen::Matrix3d::Zero(), Eigen::Vector3d::Zero()});
    k.level = {Eigen::Vector3d::UnitZ(), 1};  // how the LiDAR is tilted is not known
    keyframes.push_back(k);
  }
  return keyframes;
}

/** Median over every tenth key pose: along one stretch of some 20 s GNSS and LiDAR are 10 m apart. */
constexpr std::size_t kFirst = 5, kEvery = 10;
double medianDistance(const std::vector<Pose>& T_map_body, const std::vector<Eigen::Vector3d>& gnss_m) {
  std::vector<double> off_m;
  for (std::size_t i = kFirst; i < gnss_m.size(); i += kEvery)
    off_m.push_back((T_map_body[i].translation() - gnss_m[i]).norm());
  return quantile(off_m, 0.5);
}

TEST(FlexCloud, RefinementBringsFixesThatItDoesNotKnowNearerThanAlignmentAlone) {
  if (!std::filesystem::exists(kFolder)) GTEST_SKIP() << "no recordings beside the checkout";
  std::vector<Keyframe> keyframes = keyframesOf();
  ASSERT_EQ(keyframes.size(), 2386U);
  std::vector<Eigen::Vector3d> lidar_m, gnss_m;
  for (const Keyframe& k : keyframes) {
    lidar_m.push_back(k.T_odom_body.translation());
    gnss_m.push_back(k.gps.front().p_map_antenna_m);
  }
  const GraphAlignment aligned = alignGraphs(lidar_m, gnss_m);
  std::vector<Pose> T_map_body;
  for (const Keyframe& k : keyframes) T_map_body.push_back(aligned.T_to_from * k.T_odom_body);
  const double alone_m = medianDistance(T_map_body, gnss_m);
  for (std::size_t i = kFirst; i < keyframes.size(); i += kEvery) keyframes[i].gps.clear();
  const GraphSolution joint = solveGraph(GraphKind::joint, keyframes, {}, T_map_body, {});
  const double refined_m = medianDistance(joint.T_map_body, gnss_m);
  std::printf(
      "flexcloud: alignment alone %.3f m, refined %.3f m at fixes that the graph did not have (medians)\n",
      alone_m, refined_m);
  // The antenna's place on the car is not known, a metre or two; a turn of 30 deg within the 8 m to the next fixes
  // makes half of that a distance.
  EXPECT_LT(refined_m, 0.5);
  EXPECT_LT(refined_m, 0.1 * alone_m);
}

}  // namespace
}  // namespace raceloc
