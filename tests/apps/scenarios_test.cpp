/** \file
 * Given six lap pieces on which something goes wrong, when they are localized, then the figures are within stored bands, and
 * the files are the same bytes whatever the number of threads. tests/golden/scenarios/NAME.ini is what goes wrong,
 * NAME.csv the bands and what they are made of. */
#include <gmock/gmock.h>

#include <regex>

#include "apps/golden_csv.h"
#include "apps/localize.h"

namespace raceloc::test {
namespace {

const std::string kScenarios = ROOT "/tests/golden/scenarios/";

class Scenario : public ::testing::TestWithParam<std::string> {
 protected:
  /** trajectory, integrity and decisions of a log, as raceloc-live writes them with so many threads. */
  [[nodiscard]] std::string localized(const std::string& log, int threads) const {
    writeFile(out_ / "live.ini",
              std::regex_replace(readFile(ini("live.ini")), std::regex("\nthreads = [0-9]+"),
                                 "\nthreads = " + std::to_string(threads)));
    require(runCommand({app("raceloc-live"), "-c", out_ / "live.ini", "-m", drive_.map(), "-i", log,
                        "--trajectory", out_ / "race.tum", "--integrity", out_ / "own.csv", "--decisions",
                        out_ / "decisions.csv"}));
    return readFile(out_ / "race.tum") + readFile(out_ / "own.csv") + readFile(out_ / "decisions.csv");
  }
  TemporaryFolder out_;
  DriveFiles drive_{"alarms"};
};
INSTANTIATE_TEST_SUITE_P(Stored, Scenario,
                         ::testing::Values("clean", "one_gnss_bad", "two_gnss_bad", "lidar_bad", "gap",
                                           "late_data"),
                         [](const auto& scenario) { return scenario.param; });

TEST_P(Scenario, GivesTheStoredFiguresAndTheSameBytes) {
  std::string log = drive_.race();
  if (GetParam() != "clean") {
    log = out_ / "bad.rawlog";
    require(runCommand({app("raceloc-sim"), "inject", "--faults", kScenarios + GetParam() + ".ini", "-i",
                        drive_.race(), "-o", log}));
  }
  const std::string bytes = localized(log, 1);
  EXPECT_GT(bytes.size(), 300'000U);  // 15 s at 100 Hz
  EXPECT_TRUE(bytes == localized(log, 2));

  require(runCommand({app("raceloc-eval"), "--truth", drive_.folder + "race_truth.tum", "--estimate",
                      out_ / "race.tum", "--integrity", out_ / "own.csv", "--json", out_ / "figures.json"}));
  const auto figures = nlohmann::json::parse(readFile(out_ / "figures.json"));
  const auto bands = rowsOf(kScenarios + GetParam() + ".csv", 3);
  ASSERT_EQ(bands.size(), 7);
  for (const auto& band : bands) {
    const double figure = figures.at(nlohmann::json::json_pointer(band.at(0)));
    EXPECT_GE(figure, std::stod(band.at(1))) << band[0];
    EXPECT_LE(figure, std::stod(band.at(2))) << band[0];
  }
  for (const char* direction : {"lateral", "longitudinal", "heading"})
    for (const char* beyond : {"misleading", "hazardous"})
      EXPECT_EQ(figures.at("integrity").at(direction).at(beyond), 0) << direction << " " << beyond;
}

}  // namespace
}  // namespace raceloc::test
