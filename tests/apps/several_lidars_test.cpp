/** \file
 * Three LiDARs on a simulated lap: given ..., when ..., then ... . */
#include <gmock/gmock.h>

#include <nlohmann/json.hpp>
#include <regex>

#include "apps/apps.h"

namespace {

using namespace raceloc::test;
using ::testing::HasSubstr;
using ::testing::Not;

/** What raceloc-live says of a drive, and how far off it was. */
struct Driven {
  std::string said;
  double rmse_m, covered_s;
};

class SeveralLidars : public ::testing::Test {
 protected:
  /** 240 m of an oval at up to 100 km/h, with `fault` in it; LiDARs that are counted on by name. */
  Driven drive(const std::string& fault, const std::string& lidar_labels = "*") const {
    std::vector<std::string> sim{app("raceloc-sim"),
                                 "--track",
                                 ROOT "/share/tracks/lor.ini",
                                 "--car",
                                 car(),
                                 "--devices",
                                 "lidar_* imu vehicle gps_left",
                                 "--laps",
                                 "0.22",
                                 "-o",
                                 folder_ / "drive.rawlog"};
    if (!fault.empty()) {
      writeFile(folder_ / "fault.ini", "[fault_01]\n" + fault);
      sim.insert(sim.end(), {"--faults", folder_ / "fault.ini"});
    }
    const auto simulated = runCommand(sim);
    EXPECT_EQ(simulated.exit_code, 0) << simulated.err;
    writeFile(folder_ / "live.ini",
              std::regex_replace(readFile(ini("live.ini")), std::regex("\nlidar_labels = .*"),
                                 "\nlidar_labels = " + lidar_labels));
    const auto live = runCommand({app("raceloc-live"), "-c", folder_ / "live.ini", "--odometry-only", "-i",
                                  folder_ / "drive.rawlog", "--trajectory", folder_ / "odometry.tum"});
    EXPECT_EQ(live.exit_code, 0) << live.err;
    const auto eval =
        runCommand({app("raceloc-eval"), "--align", "se3", "--truth", folder_ / "drive_truth.tum",
                    "--estimate", folder_ / "odometry.tum", "--json", folder_ / "figures.json"});
    EXPECT_EQ(eval.exit_code, 0) << eval.err;
    const auto figures = nlohmann::json::parse(readFile(folder_ / "figures.json"));
    return {live.out, figures.at("errors").at("position_3d_m").at("rmse"),
            figures.at("match").at("covered_truth_s")};
  }

  TemporaryFolder folder_;

 private:
  /** The Indy car with fewer points. */
  [[nodiscard]] std::string car() const {
    const auto text = readFile(ini("sim/indy.ini"));
    writeFile(folder_ / "car.ini",
              std::regex_replace(text, std::regex("\ncolumns = [0-9]+"), "\ncolumns = 200"));
    return folder_ / "car.ini";
  }
};

// Range noise of 2 cm and 1 m voxels: with all around in view, some centimetres; a standstill would be off by 100 m.
constexpr double kTolerance_m = 0.1;

TEST_F(SeveralLidars, GivenAllOfThemTheirMergedSweepsAreFollowed) {
  const Driven all = drive("");
  EXPECT_LT(all.rmse_m, kTolerance_m);
  EXPECT_GT(all.covered_s, 8);
  EXPECT_THAT(all.said, Not(HasSubstr("DEGRADED")));
  EXPECT_THAT(all.said, ::testing::ContainsRegex(" (8|9)[0-9] scans"));  // ten a second, not thirty
}

TEST_F(SeveralLidars, WhenOneIsDeadFromTheStartTheOthersDoAndItIsNamed) {
  const Driven dead = drive("kind = lidar_off\nlabels = lidar_left\n", "lidar_front lidar_left lidar_right");
  EXPECT_LT(dead.rmse_m, kTolerance_m);
  EXPECT_GT(dead.covered_s, 8);
  EXPECT_THAT(dead.said, HasSubstr("DEGRADED         LiDAR lidar_left: silent"));
}

TEST_F(SeveralLidars, WhenOneDiesOnTheWayTheOthersDoAndItIsNamed) {
  const Driven dies = drive("kind = lidar_off\nlabels = lidar_front\nfrom_s = 4\n");
  EXPECT_LT(dies.rmse_m, kTolerance_m);
  EXPECT_GT(dies.covered_s, 8);
  EXPECT_THAT(dies.said, HasSubstr("DEGRADED         LiDAR lidar_front: silent"));
  EXPECT_THAT(dies.said, Not(HasSubstr("lidar_left")));
}

TEST_F(SeveralLidars, WhenOneComesBackItIsMergedAgain) {
  const Driven back = drive("kind = lidar_off\nlabels = lidar_right\nfrom_s = 3\nto_s = 5\n");
  EXPECT_LT(back.rmse_m, kTolerance_m);
  std::smatch times;
  ASSERT_TRUE(
      std::regex_search(back.said, times, std::regex("LiDAR lidar_right: silent \\(([0-9]+) times\\)")));
  EXPECT_LT(std::stoi(times[1]), 25);  // of 2 s
}

TEST_F(SeveralLidars, AMapOfAllOfThemIsMade) {
  (void)drive("");
  const auto map = runCommand(
      {app("raceloc-map"), "-c", ini("map.ini"), "-o", folder_ / "map.rlmap", folder_ / "drive.rawlog"});
  EXPECT_EQ(map.exit_code, 0) << map.err;
  const auto live = runCommand({app("raceloc-live"), "-c", ini("live.ini"), "-m", folder_ / "map.rlmap", "-i",
                                folder_ / "drive.rawlog", "--disable", "lidar_left", "--disable-after", "4",
                                "-o", folder_ / "out.rawlog", "--trajectory", folder_ / "live.tum"});
  EXPECT_EQ(live.exit_code, 0) << live.err;
  EXPECT_THAT(live.out, HasSubstr("DEGRADED         LiDAR lidar_left: silent"));
  const auto eval = runCommand({app("raceloc-eval"), "--truth", folder_ / "drive_truth.tum", "--estimate",
                                folder_ / "live.tum", "--json", folder_ / "figures.json"});
  EXPECT_EQ(eval.exit_code, 0) << eval.err;
  const auto figures = nlohmann::json::parse(readFile(folder_ / "figures.json"));
  EXPECT_LT(figures.at("errors").at("position_plane_m").at("rmse"), kTolerance_m);
}

}  // namespace
