/** \file
 * Given a localized car that is told a line, when the line leads into a wall, then the guard takes over; one that can be
 * driven is left alone. */
#include <gtest/gtest.h>

#include <cmath>
#include <cstdio>
#include <stdexcept>
#include <string>

#include "apps/apps.h"
#include "eval/trajectory_errors.h"

namespace raceloc::test {
namespace {

const DriveFiles kRace("alarms");

/** The first lap of the survey, the truth, so far to its right, as a CSV of points about 5 m apart. */
std::string lapToTheRight(double right_m) {
  constexpr double kStep_m = 5, kLap_m = 300;
  const auto poses = readTrajectoryFile(DATA "survey/two_laps_truth.tum").trajectory.poses;
  std::string csv = "x_m,y_m\n";
  double way_m = 0, written_m = -kStep_m;
  const Eigen::Vector3d begin_m = poses.front().T_map_body.translation();
  for (std::size_t i = 0; i < poses.size(); ++i) {
    const Pose& T = poses[i].T_map_body;
    if (i > 0) way_m += (T.translation() - poses[i - 1].T_map_body.translation()).norm();
    if (way_m > kLap_m && (T.translation() - begin_m).norm() < 2 * kStep_m) break;
    if (way_m - written_m < kStep_m) continue;
    written_m = way_m;
    const Eigen::Vector3d p_m = T * Eigen::Vector3d(0, -right_m, 0);
    char line[64];
    std::snprintf(line, sizeof line, "%.3f,%.3f\n", p_m.x(), p_m.y());
    csv += line;
  }
  return csv;
}

/** What raceloc-live says of its guard on the race, told a line that far to the right of where the survey went. */
struct Guarded {
  int localized, wall_following, emergency;
};
Guarded guarded(double right_m) {
  const TemporaryFolder out;
  writeFile(out / "line.csv", lapToTheRight(right_m));
  const std::string said =
      require(runCommand({app("raceloc-live"), "-c", ini("live.ini"), "-m", kRace.map(), "-i", kRace.race(),
                          "--race-line", out / "line.csv", "--trajectory", out / "race.tum"}))
          .out;
  Guarded counts{};
  const auto at = said.find("guard: localized");
  if (at == std::string::npos) throw std::runtime_error("nothing about the guard in: " + said);
  EXPECT_EQ(std::sscanf(said.c_str() + at, "guard: localized %d, wall following %d, emergency %d",
                        &counts.localized, &counts.wall_following, &counts.emergency),
            3);
  return counts;
}

TEST(RaceLine, OfTheSurveyIsLeftAloneAndOneBeyondTheWallIsNot) {
  const Guarded sound = guarded(0);
  EXPECT_GT(sound.localized, 100);  // 15 s at 10 Hz
  EXPECT_EQ(sound.emergency, 0);
  // The car nears a line by at most 2.5 m in the second that the guard looks ahead, so that it takes over only where the
  // outer wall is as near as that. This shows, too, that the line is heard at all.
  const Guarded into_wall = guarded(8);
  EXPECT_GE(into_wall.emergency, 5);
  EXPECT_GT(into_wall.localized, 50);
}

}  // namespace
}  // namespace raceloc::test
