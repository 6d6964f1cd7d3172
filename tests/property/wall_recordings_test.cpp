/** \file
 * Walls in real scans: a guard-rail on a motorway, the wall of a building behind parked cars (KITTI). */
#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <string>
#include <vector>

#include "wall/wall_detector.h"

namespace raceloc {
namespace {

const std::string kData = RACELOC_ROOT "/build/data/";

/** Of files `x y z intensity` as float, in the order of their names; body frame: the HDL-64 is 1.73 m above the road. */
std::vector<Cloud> scansIn(const std::string& folder) {
  std::vector<std::filesystem::path> paths;
  for (const auto& entry : std::filesystem::directory_iterator(folder)) paths.push_back(entry.path());
  std::sort(paths.begin(), paths.end());
  std::vector<Cloud> scans;
  for (const auto& path : paths) {
    std::ifstream in(path, std::ios::binary);
    Cloud cloud;
    for (std::array<float, 4> p{}; in.read(reinterpret_cast<char*>(p.data()), sizeof p);) {
      const Eigen::Vector3f p_body_m(p[0] + 0.86F, p[1], p[2] + 1.43F);
      if (std::abs(p_body_m.x() - 1.5F) > 3 || std::abs(p_body_m.y()) > 1.2F) cloud.push(p_body_m);
    }
    scans.push_back(std::move(cloud));
  }
  return scans;
}

/** The walls of each scan, on their own. */
std::vector<WallScan> wallsIn(const std::vector<Cloud>& scans) {
  gpu::Context cpu(gpu::Backend::cpu);
  WallOptions o;
  o.keep_s = 0;
  WallDetector detector(cpu, o);
  std::vector<WallScan> walls;
  walls.reserve(scans.size());
  for (const Cloud& scan : scans)
    walls.push_back(detector.detect(scan, 0.1 * static_cast<double>(walls.size()), Pose::Identity()));
  return walls;
}

TEST(WallRecordings, AGuardRailStaysWhereItIsAsTheCarPasses) {
  const std::string folder = kData + "kitti_odom/sequences/01/velodyne";
  if (!std::filesystem::exists(folder))
    GTEST_SKIP() << "needs the KITTI odometry sequence 01 below build/data";
  auto scans = scansIn(folder);
  scans.erase(scans.begin(), scans.begin() + 30);  // the slip road: nothing but shrubs
  const auto walls = wallsIn(scans);
  int seen = 0, steady = 0;
  for (std::size_t k = 1; k < walls.size(); ++k) {
    EXPECT_EQ(walls[k].verdict, ScanVerdict::good);
    if (!walls[k].left || !walls[k - 1].left) continue;
    ++seen;
    // The car drives up to 1.8 m a scan, at up to 25 deg to the rail.
    const double nearing_m = 1.8 * std::tan(std::abs(walls[k].left->heading_rad()));
    steady +=
        std::abs(walls[k].left->distance_m() - walls[k - 1].left->distance_m()) < 0.3 + nearing_m ? 1 : 0;
  }
  EXPECT_GE(seen, 40);
  EXPECT_GE(steady, 0.9 * seen);
  for (std::size_t k = 20; k < walls.size(); ++k)
    if (walls[k].left) {
      EXPECT_NEAR(walls[k].left->distance_m(), 7, 1) << "scan " << k;  // beside the left lane
    }
}

TEST(WallRecordings, TheWallOfABuildingIsSeenBehindParkedCars) {
  const std::string folder = kData + "kitti_raw/2011_09_26/2011_09_26_drive_0013_sync/velodyne_points/data";
  if (!std::filesystem::exists(folder)) GTEST_SKIP() << "needs the KITTI drive 0013 below build/data";
  auto scans = scansIn(folder);
  scans.resize(30);
  const auto walls = wallsIn(scans);
  int seen = 0;
  for (std::size_t k = 0; k < walls.size(); ++k) {
    if (!walls[k].right) continue;
    ++seen;
    EXPECT_NEAR(walls[k].right->distance_m(), 7, 0.8) << "scan " << k;
    EXPECT_LT(walls[k].right->residual_m, 0.03) << "it is flat";
    EXPECT_NEAR(walls[k].right->beta[2], 0, 2e-3);
  }
  EXPECT_GE(seen, 24);
}

}  // namespace
}  // namespace raceloc
