/** \file
 * Import, map, localization and evaluation on a drive through a made-up street, whose truth is known. */
#include <gmock/gmock.h>

#include <set>
#include <sstream>

#include "apps/localize.h"

namespace {

using namespace raceloc::test;
using ::testing::HasSubstr;

const DriveFiles kDrive("synthetic");
// The truth's own noise (2 cm east and north, 3 cm up: 0.04 m), as much again in the map through the GPS, and
// half the spacing of the map's points (0.1 m); nothing else may add up.
constexpr double kTolerance_m = 0.2;

TEST(SyntheticDrive, IsFollowedFromItsStartToItsEnd) {
  const TemporaryFolder out;
  const auto run = localize(kDrive, kDrive.race(), out);
  EXPECT_LT(run.rmse_m, kTolerance_m);
  EXPECT_GT(run.match_share, 0.9);
  EXPECT_GT(run.covered_s,
            6.5);  // of 8 s, less two sweeps at either end and a start that waits for a heading
}

TEST(SyntheticDrive, IsFollowedWithoutGps) {
  const TemporaryFolder out;
  const auto run = localize(kDrive, kDrive.race(), out, {"--disable", "gps_*"});
  EXPECT_LT(run.rmse_m, kTolerance_m);
  EXPECT_GT(run.covered_s, 6.5);
}

TEST(SyntheticDrive, BadGpsIsRejected) {
  const TemporaryFolder out, noisy_out;
  const auto clean = localize(kDrive, kDrive.race(), out);
  const auto noisy = localize(kDrive, kDrive.noisyRace(), noisy_out);
  EXPECT_LT(noisy.rmse_m, kTolerance_m);
  EXPECT_GT(noisy.covered_s, clean.covered_s - 1);
}

TEST(SyntheticDrive, IsFollowedWithoutAMapToo) {
  const TemporaryFolder out;
  const auto live = runCommand({app("raceloc-live"), "-c", ini("live.ini"), "--odometry-only", "-i",
                                kDrive.race(), "--trajectory", out / "odometry.tum"});
  ASSERT_EQ(live.exit_code, 0) << live.err;
  EXPECT_THAT(live.out, HasSubstr("wheel scale"));
  const auto eval = runCommand({app("raceloc-eval"), "--align", "se3", "--truth", kDrive.truth(),
                                "--estimate", out / "odometry.tum", "--json", out / "figures.json"});
  ASSERT_EQ(eval.exit_code, 0) << eval.err;
  const auto figures = nlohmann::json::parse(readFile(out / "figures.json"));
  EXPECT_LT(figures.at("errors").at("position_3d_m").at("rmse"), kTolerance_m);
}

TEST(SyntheticDrive, OdometryAloneTakesNoMap) {
  const TemporaryFolder out;
  const std::vector<std::string> odometry{app("raceloc-live"), "-c", ini("live.ini"),
                                          "--odometry-only",   "-i", kDrive.race()};
  const auto refused = [&](const std::vector<std::string>& more, const std::string& why) {
    auto command = odometry;
    command.insert(command.end(), more.begin(), more.end());
    const auto run = runCommand(command);
    EXPECT_EQ(run.exit_code, 2);
    EXPECT_THAT(run.err, HasSubstr(why));
  };
  refused({}, "--trajectory");
  refused({"--trajectory", out / "x.tum", "-m", kDrive.map()}, "no map");
}

TEST(SyntheticDrive, GivesTheSameBitsTwice) {
  const TemporaryFolder out, again_out;
  const auto run = localize(kDrive, kDrive.race(), out), again = localize(kDrive, kDrive.race(), again_out);
  EXPECT_EQ(run.trajectory, again.trajectory);
  EXPECT_TRUE(readFile(out / "out.rawlog") == readFile(again_out / "out.rawlog"));
}

TEST(SyntheticDrive, AnnotatedLogOpensInMrpt) {
  if (runCommand({"which", "rawlog-edit"}).exit_code != 0)
    GTEST_SKIP() << "rawlog-edit is not installed (mrpt-apps)";
  const TemporaryFolder out;
  (void)localize(kDrive, kDrive.race(), out);
  const auto info = runCommand({"rawlog-edit", "--info", "-i", out / "out.rawlog"});
  EXPECT_EQ(info.exit_code, 0) << info.err;
  for (const std::string label : {"lidar_top", "gps_oxts", "vehicle", "estimate_pose", "gate", "guard"})
    EXPECT_THAT(info.out, HasSubstr(label + " /"));
}

TEST(SyntheticDrive, ReportIsOnePageWithPictures) {
  const TemporaryFolder out;
  const auto eval = runCommand({app("raceloc-eval"), "--truth", kDrive.truth(), "--estimate", kDrive.truth(),
                                "--report", out / "report.html", "--picture", out / "picture.svg"});
  ASSERT_EQ(eval.exit_code, 0) << eval.err;
  EXPECT_THAT(eval.out, HasSubstr("rmse"));
  const auto page = readFile(out / "report.html");
  EXPECT_THAT(page, HasSubstr("<svg"));
  EXPECT_THAT(page, Not(::testing::ContainsRegex("(src|href)=\"http")));
  EXPECT_THAT(readFile(out / "picture.svg"), HasSubstr("<svg"));
}

TEST(SyntheticDrive, TellsOfItselfWhatTheEvaluationReads) {
  const TemporaryFolder out;
  auto command = liveCommand(ini("live.ini"), kDrive.map(), kDrive.race(), out);
  command.insert(command.end(), {"--integrity", out / "integrity.csv", "--decisions", out / "decisions.csv",
                                 "--latency", out / "latency.csv"});
  ASSERT_EQ(runCommand(command).exit_code, 0);
  const auto eval =
      runCommand({app("raceloc-eval"), "--truth", kDrive.truth(), "--estimate", out / "race.tum",
                  "--integrity", out / "integrity.csv", "--decisions", out / "decisions.csv", "--latency",
                  out / "latency.csv", "--json", out / "figures.json"});
  ASSERT_EQ(eval.exit_code, 0) << eval.err;
  const auto figures = nlohmann::json::parse(readFile(out / "figures.json"));
  EXPECT_EQ(figures.at("integrity").at("lateral").at("epochs"), figures.at("match").at("poses"));
  ASSERT_EQ(figures.at("gate").size(), 2U);
  EXPECT_EQ(figures.at("gate").at(0).at("source"), "gps_oxts");
  EXPECT_EQ(figures.at("gate").at(1).at("source"), "scan_match");
  // Matches come later than the fixes after them, and the decisions are made anew: none is lost by that.
  EXPECT_GE(figures.at("gate").at(1).at("decisions"), figures.at("latency").at("sweeps"));
  EXPECT_EQ(figures.at("gate").at(1).at("accepted"), figures.at("gate").at(1).at("decisions"));
  std::set<std::string> said;  // stamp and source, once each
  std::istringstream decisions(readFile(out / "decisions.csv"));
  for (std::string line; std::getline(decisions, line);)
    EXPECT_TRUE(said.insert(line.substr(0, line.find(',')) + line.substr(line.rfind(','))).second) << line;
  EXPECT_LT(figures.at("gate").at(0).at("innovation_rms_m"), 0.2);  // of fixes with 2 cm of noise
  EXPECT_GT(figures.at("latency").at("sweeps"), 0);
}

TEST(SyntheticDrive, TheMapHasAPageAndFiguresWithTheSameVerdict) {
  const auto figures = nlohmann::json::parse(readFile(kDrive.folder + "map.json"));
  EXPECT_FALSE(figures.at("passed"));
  EXPECT_THAT(figures.at("verdict"), HasSubstr("full laps 0 < 1"));  // a street, driven once
  EXPECT_EQ(figures.at("receivers").at(0).at("receiver"), "gps_oxts");
  EXPECT_FALSE(figures.at("receivers").at(0).at("time_offset").at("observable"));
  const auto page = readFile(kDrive.folder + "map.html");
  EXPECT_THAT(page, HasSubstr("full laps 0 &lt; 1"));
  EXPECT_THAT(page, HasSubstr("<svg"));
  for (const std::string outside :
       {"<script", "<link", "src=", "@import", "url(http", "href=\"http", "href='http"})
    EXPECT_THAT(page, Not(HasSubstr(outside)));
}

}  // namespace
