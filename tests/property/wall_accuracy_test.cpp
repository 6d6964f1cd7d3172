/** \file
 * Walls of the shipped circuits against the truth: the three LiDARs of the race car on the ovals, the roof LiDAR of the
 * road car between open verges, trees and stands. */
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <raceloc/gpu/standing.h>

#include "core/statistics.h"
#include "support/wall_scans.h"
#include "wall/wall_detector.h"

namespace raceloc {
namespace {

using test::ScannedLap;

class Ovals : public ::testing::TestWithParam<const char*> {};
INSTANTIATE_TEST_SUITE_P(Shipped, Ovals, ::testing::Values("lvms", "ims", "tms", "lor"),
                         [](const auto& track) { return std::string(track.param); });

TEST_P(Ovals, HaveWallsToFiveCentimetresAndHalfADegree) {
  constexpr double kNear_m = 20;
  constexpr int kScans = 50;
  ScannedLap lap(GetParam(), "indy");
  gpu::Context cpu(gpu::Backend::cpu);
  WallDetector detector(cpu, {});
  std::vector<double> off_m, turned_deg, sigmas;
  int near = 0;
  for (int k = 0; k < kScans; ++k) {
    const DeskewedScan scan = lap.scan(cpu, 0.5 + k * (lap.lap_s() - 2) / kScans);
    const WallScan walls = detector.detect(scan.cloud, scan.stamp_s, Pose::Identity());
    ASSERT_EQ(walls.verdict, ScanVerdict::good);
    for (const Side side : {Side::left, Side::right}) {
      const auto truth = lap.wall(scan.stamp_s, side);
      if (!truth || truth->distance_m > kNear_m) continue;
      ++near;
      const auto& wall = walls.on(side);
      if (!wall || wall->age_s > 0) continue;
      off_m.push_back(std::abs(wall->distance_m() - truth->distance_m));
      turned_deg.push_back(std::abs(wall->heading_rad() - truth->heading_rad) / kDegree);
      sigmas.push_back(off_m.back() / wall->distanceSigma_m());
    }
  }
  EXPECT_GT(near, 45);
  EXPECT_GE(static_cast<double>(off_m.size()), 0.98 * near) << "walls that are near are seen";
  EXPECT_LE(quantile(off_m, 0.5), 0.05);
  EXPECT_LE(quantile(off_m, 0.99), 0.15);
  EXPECT_LE(quantile(turned_deg, 0.95), 0.5);
  EXPECT_LE(quantile(sigmas, 0.99), 4) << "the sigma means something";
  RecordProperty("distance_p99_mm", static_cast<int>(1000 * quantile(off_m, 0.99)));
}

/** Whether nothing stands beside the road from 70 m behind to 70 m ahead, but trees. */
bool isOpen(const Circuit& circuit, double s_m, Side side) {
  constexpr double kSight_m = 70;
  const auto isNear = [&](double from_m, double to_m) {
    return from_m < s_m + kSight_m && to_m > s_m - kSight_m;
  };
  return std::none_of(circuit.barriers.begin(), circuit.barriers.end(),
                      [&](const Barrier& b) { return b.side == side && isNear(b.from_m, b.to_m); }) &&
         std::none_of(circuit.scenery.begin(), circuit.scenery.end(), [&](const Scenery& x) {
           return x.kind != SceneryKind::trees && (x.side == side || x.side == Side::both) &&
                  isNear(x.from_m, x.to_m);
         });
}

TEST(RoadCourse, HasNoWallsWhereItIsOpenAndWallsWhereTheyAre) {
  constexpr int kScans = 250;
  ScannedLap lap("monza_like", "road_car", 1, 3);
  lap.keep("lidar_top");
  gpu::Context cpu(gpu::Backend::cpu);
  WallDetector detector(cpu, {});
  int open = 0, false_walls = 0, walled = 0, found = 0;
  for (int k = 0; k < kScans; ++k) {
    const DeskewedScan scan = lap.scan(cpu, 0.5 + k * (lap.lap_s() - 2) / kScans);
    const WallScan walls = detector.detect(scan.cloud, scan.stamp_s, Pose::Identity());
    const Circuit& circuit = lap.lap().circuit;
    const double s_m = circuit.track.wrapped(lap.lap().motion.state(scan.stamp_s).s_m);
    for (const Side side : {Side::left, Side::right}) {
      const bool is_seen = walls.on(side) && walls.on(side)->age_s == 0;
      const auto truth = lap.wall(scan.stamp_s, side);
      if (isOpen(circuit, s_m, side)) {
        ++open;
        false_walls += is_seen ? 1 : 0;
      } else if (truth && truth->distance_m < 15) {
        ++walled;
        found += is_seen ? 1 : 0;
      }
    }
  }
  EXPECT_GT(open, 150);
  EXPECT_EQ(false_walls, 0);
  EXPECT_GT(walled, 100);
  EXPECT_GE(found, 0.85 * walled) << "the ends of rails are shorter than min_length_m, and cars hide others";
}

/** Share of the returns from the road, its kerbs and verges that pass as ground. */
double groundRecall(const std::string& track, const std::string& car, int scans) {
  constexpr double kOn_m = 0.1, kWallFoot_m = 0.7;  // of a cell that the wall stands in
  ScannedLap lap(track, car);
  gpu::Context cpu(gpu::Backend::cpu);
  std::size_t ground = 0, passed = 0;
  std::vector<std::uint8_t> is_standing;
  for (int k = 0; k < scans; ++k) {
    const DeskewedScan scan = lap.scan(cpu, 0.5 + k * (lap.lap_s() - 2) / scans);
    (void)gpu::standingCells(cpu, viewOf(scan.cloud), WallOptions{}.forKernels(), &is_standing);
    const Pose T_map_body = lap.T_map_body(scan.stamp_s);
    for (std::size_t i = 0; i < scan.cloud.size(); i += 23) {
      const Eigen::Vector3d p_map_m = T_map_body * scan.cloud.point(i).cast<double>();
      const auto place = lap.lap().circuit.track.locate(p_map_m, 40);
      if (!place || std::abs(place->height_m) > kOn_m) continue;
      const RoadFrame road = lap.lap().circuit.track.at(place->s_m);
      if (place->n_m > road.left_m - kWallFoot_m || place->n_m < -road.right_m + kWallFoot_m) continue;
      ++ground;
      passed += is_standing[i] == 0 ? 1 : 0;
    }
  }
  EXPECT_GT(ground, 10000U);
  return static_cast<double>(passed) / static_cast<double>(ground);
}

TEST(Ground, Is99PercentGroundOn24DegreesOfBankOverCrestsAndKerbs) {
  EXPECT_GE(groundRecall("tms", "indy", 15), 0.99);                // banks of 24 deg
  EXPECT_GE(groundRecall("everland_like", "road_car", 15), 0.99);  // 43 m of height
  EXPECT_GE(groundRecall("monza_like", "road_car", 15), 0.99);     // kerbs
}

}  // namespace
}  // namespace raceloc
