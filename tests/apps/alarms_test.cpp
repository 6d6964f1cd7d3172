/** \file
 * Given a lap with a fault, when it is localized, then the state says so at the stated times, and the estimate is where
 * the car is. tests/golden/alarms/NAME.ini is the fault, NAME.csv what is expected of it. */
#include <gmock/gmock.h>

#include <algorithm>
#include <nlohmann/json.hpp>

#include "apps/golden_csv.h"
#include "apps/localize.h"
#include "eval/trajectory_errors.h"

namespace raceloc::test {
namespace {

const std::string kExpected = ROOT "/tests/golden/alarms/";
const std::string kStates[] = {"ok", "degraded", "dead_reckoning", "lost"};

/** The state turns to this one between two instants, and stays so until the next turn begins. */
struct Turn {
  double from_s, to_s;
  std::string state, cause;  ///< the cause contains this
};

/** While sources that are right are left, the project's bound; else 1 % of 4 s at up to 27 m/s, and the error at their begin. */
constexpr double kHeld_m = 0.30, kDeadReckoned_m = 1.2;
struct AlarmCase {
  const char* name;
  double worst_m;
};
class Alarm : public ::testing::TestWithParam<AlarmCase> {};
INSTANTIATE_TEST_SUITE_P(Faults, Alarm,
                         ::testing::Values(AlarmCase{"gps_step", kHeld_m}, AlarmCase{"gps_ramp", kHeld_m},
                                           AlarmCase{"gps_noise", kHeld_m}, AlarmCase{"gps_outage", kHeld_m},
                                           AlarmCase{"lidar_off", kHeld_m},
                                           AlarmCase{"all_sources", kDeadReckoned_m},
                                           AlarmCase{"leap_together", kDeadReckoned_m},
                                           AlarmCase{"wheel_lock", kHeld_m},
                                           AlarmCase{"imu_frozen", kHeld_m}),
                         [](const auto& alarm) { return std::string(alarm.param.name); });
void PrintTo(const AlarmCase& alarm, std::ostream* out) { *out << alarm.name; }

TEST_P(Alarm, ComesAndGoesAtTheStatedTimes) {
  const TemporaryFolder out;
  const DriveFiles drive("alarms");
  const std::string name = GetParam().name;
  require(runCommand({app("raceloc-sim"), "inject", "--faults", kExpected + name + ".ini", "-i", drive.race(),
                      "-o", out / "bad.rawlog"}));
  require(runCommand({app("raceloc-live"), "-c", ini("live.ini"), "-m", drive.map(), "-i", out / "bad.rawlog",
                      "--trajectory", out / "race.tum", "--integrity", out / "own.csv"}));
  require(runCommand({app("raceloc-eval"), "--truth", drive.folder + "race_truth.tum", "--estimate",
                      out / "race.tum", "--json", out / "figures.json"}));

  std::vector<Turn> turns;
  for (const auto& row : rowsOf(kExpected + name + ".csv", 4)) {
    ASSERT_EQ(row.size(), 4);
    turns.push_back({std::stod(row[0]), std::stod(row[1]), row[2], row[3]});
  }
  ASSERT_GE(turns.size(), 2);
  const double start_s = readTrajectoryFile(drive.folder + "race_truth.tum").trajectory.poses.front().stamp_s;
  std::size_t judged = 0;
  for (const auto& row : rowsOf(out / "own.csv", 15)) {
    const double t = std::stod(row.front()) - start_s;
    const auto next =
        std::find_if(turns.begin(), turns.end(), [&](const Turn& turn) { return turn.from_s > t; });
    if (next == turns.begin() || t < std::prev(next)->to_s) continue;
    const Turn& now = *std::prev(next);
    ++judged;
    EXPECT_EQ(kStates[std::stoi(row[1])], now.state) << t << " s: " << row.back();
    EXPECT_THAT(row.back(), ::testing::HasSubstr(now.cause)) << t << " s";
  }
  EXPECT_GT(judged, 800) << "outputs, of 15 s at 100 Hz less the spans in which the state turns";

  const auto figures = nlohmann::json::parse(readFile(out / "figures.json"));
  EXPECT_LT(figures.at("errors").at("position_plane_m").at("max"), GetParam().worst_m);
}

}  // namespace
}  // namespace raceloc::test
