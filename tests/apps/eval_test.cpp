/** \file
 * raceloc-eval as its users run it. */
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstdio>
#include <filesystem>
#include <functional>
#include <nlohmann/json.hpp>

#include "apps/refused.h"
#include "cli/usage_log.h"
#include "support/wait.h"

namespace raceloc::test {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

std::string line(double stamp_s, double x_m, double y_m = 0, const std::string& q = "0 0 0 1") {
  char text[128];
  std::snprintf(text, sizeof text, "%.2f %.3f %.3f 0 %s\n", stamp_s, x_m, y_m, q.c_str());
  return text;
}

/** East at 10 m/s for 100 s, ten poses a second. */
std::string drive(double y_m = 0, double from_s = 0, const std::string& q = "0 0 0 1") {
  std::string text;
  for (int i = 0; i <= 1000; ++i) text += line(from_s + 0.1 * i, i, y_m, q);
  return text;
}

class Trajectories : public BadInput {
 protected:
  void SetUp() override { writeFile(in / "truth.tum", drive()); }
  [[nodiscard]] std::string written(const std::string& name, const std::string& text) const {
    writeFile(in / name, text);
    return in / name;
  }
  void expectRefusedEstimate(const std::string& text, const std::vector<std::string>& named) const {
    expectRefused({app("raceloc-eval"), "--truth", in / "truth.tum", "--estimate", written("bad.tum", text),
                   "--json", out / "f.json"},
                  named);
  }
  /** Errors of a drive as a table. */
  [[nodiscard]] std::string errorsOf(const std::string& name, const std::string& drive_text) const {
    std::string table = in / (name + ".csv");
    require(runCommand({app("raceloc-eval"), "--truth", in / "truth.tum", "--estimate",
                        written(name + ".tum", drive_text), "--csv", table}));
    return table;
  }
};

TEST_F(Trajectories, UnsortedAreRefused) {
  expectRefusedEstimate(line(0, 0) + line(2, 20) + line(1, 10), {"bad.tum, line 3", "stamps must increase"});
}
TEST_F(Trajectories, WithAStampTwiceAreRefused) {
  expectRefusedEstimate(line(0, 0) + line(1, 10) + line(1, 10), {"bad.tum, line 3", "drop duplicates"});
}
TEST_F(Trajectories, WithAQuaternionThatIsNotUnitAreRefused) {
  expectRefusedEstimate(line(0, 0) + line(1, 10, 0, "0 0 0 0.9"), {"bad.tum, line 2", "not of unit length"});
  expectRefusedEstimate(line(0, 0, 0, "0 0 0 0"), {"bad.tum, line 1", "not of unit length"});
}
TEST_F(Trajectories, WithNoNumbersAreRefused) {
  for (const std::string word : {"nan", "inf", "1e999", "x"})
    expectRefusedEstimate("0 " + word + " 0 0 0 0 0 1\n", {"bad.tum, line 1", "not eight numbers"});
}
TEST_F(Trajectories, WithoutPosesAreRefused) {
  expectRefusedEstimate("", {"bad.tum", "holds no pose"});
  expectRefusedEstimate("# only words\n\n", {"bad.tum", "holds no pose"});
}
TEST_F(Trajectories, OfAnotherTimeAreRefused) {
  expectRefusedEstimate(drive(0, 5000), {"bad.tum", "only 0 of 1001", "5000.000 .. 5100.000 s", "one clock"});
}
TEST_F(Trajectories, KilometresAwayAreRefused) {
  expectRefusedEstimate(drive(5000), {"bad.tum", "truth.tum", "constant offset of 5.000 km", "--align se3"});
}
TEST_F(Trajectories, TurnedByAQuarterAreRefused) {
  expectRefusedEstimate(drive(0, 0, "0 0 0.70710678 0.70710678"), {"bad.tum", "constant 90 deg"});
}

TEST_F(Trajectories, OptionsThatAreWrongAreRefused) {
  const auto refused = [&](const std::vector<std::string>& options, const std::vector<std::string>& named) {
    std::vector<std::string> command{app("raceloc-eval"), "--truth", in / "truth.tum", "--estimate",
                                     in / "truth.tum"};
    command.insert(command.end(), options.begin(), options.end());
    expectRefused(command, named);
  };
  refused({"--rpe", "1"}, {"--rpe", "1s or 10m"});
  refused({"--rpe", "-1s"}, {"--rpe", "> 0"});
  refused({"--segments", "20,x"}, {"--segments", "\"x\""});
  refused({"--sectors", "0"}, {"--sectors"});
  refused({"--align", "sim3"}, {"--align", "none | se3"});
  refused({"--picture", out / "x.jpg"}, {"x.jpg", ".png"});
  refused({"--json", in / "truth.tum"}, {"truth.tum", "is an input too"});
  refused({"--integrity", in / "nowhere.csv"}, {"nowhere.csv"});
  refused({"--integrity", written("i.csv", "stamp_s,state\n1,0\n")},
          {"i.csv", "no column protection_lateral_m"});
  refused({"--decisions", written("d.csv", "stamp_s,nis\n1,0\n")}, {"d.csv", "no column"});
  refused({"--latency", written("l.csv", "stamp_s,scan_to_pose_s\n1,fast\n")}, {"l.csv, line 2", "\"fast\""});
}

TEST_F(Trajectories, FiguresComeInEveryForm) {
  const auto run = runCommand({app("raceloc-eval"), "--truth", in / "truth.tum", "--estimate",
                               written("e.tum", drive(0.25)), "--rpe", "2s", "--json", out / "f.json",
                               "--csv", out / "f.csv"});
  EXPECT_EQ(run.exit_code, 0) << run.err;
  EXPECT_THAT(run.out, AllOf(HasSubstr("RPE over"), HasSubstr("2 s [m]"), HasSubstr("by speed (rmse)")));
  const auto figures = nlohmann::json::parse(readFile(out / "f.json"));
  EXPECT_NEAR(figures.at("errors").at("lateral_m").at("rmse"), 0.25, 1e-9);
  EXPECT_EQ(figures.at("rpe").at(0).at("pairs"), 50);
}

TEST_F(Trajectories, PicturesFillAFolder) {
  const auto run = runCommand({app("raceloc-eval"), "--truth", in / "truth.tum", "--estimate",
                               in / "truth.tum", "--pictures", out / "pictures"});
  EXPECT_EQ(run.exit_code, 0) << run.err;
  for (const std::string name : {"trajectory", "by_station", "by_speed", "gg"}) {
    EXPECT_THAT(readFile(out / ("pictures/" + name + ".svg")), HasSubstr("</svg>"));
    EXPECT_EQ(readFile(out / ("pictures/" + name + ".png")).substr(1, 3), "PNG");
  }
}

// ---- compare

TEST_F(Trajectories, TwoRunsAreCompared) {
  const auto run = runCommand({app("raceloc-eval"), "compare", errorsOf("a", drive(0.1)),
                               errorsOf("b", drive(0.3)), "--json", out / "c.json"});
  EXPECT_EQ(run.exit_code, 0) << run.err;
  EXPECT_THAT(run.out, HasSubstr("A is better"));
  const auto rmse = nlohmann::json::parse(readFile(out / "c.json")).at(0).at("rmse");
  EXPECT_NEAR(rmse.at("lateral_m").at("a_less_b"), -0.2, 1e-9);
  // All ten blocks differ one way: of the 2^10 swaps two are as large.
  EXPECT_NEAR(rmse.at("lateral_m").at("p"), 2.0 / 1024, 1.5e-3);
  EXPECT_EQ(rmse.at("height_m").at("p"), 1);
}

TEST_F(Trajectories, TwoFoldersAreComparedFileByFile) {
  namespace fs = std::filesystem;
  for (const std::string folder : {"a", "b"}) fs::create_directory(in / folder);
  const std::string good = errorsOf("good", drive(0.1)), bad = errorsOf("bad", drive(0.2));
  fs::copy(good, in / "a/both.csv");
  fs::copy(bad, in / "b/both.csv");
  fs::copy(bad, in / "b/alone.csv");
  writeFile(in / "a/other.csv", "x,y\n1,2\n");
  writeFile(in / "b/other.csv", "x,y\n1,2\n");
  const auto run = runCommand({app("raceloc-eval"), "compare", in / "a", in / "b", "--json", in / "c.json"});
  EXPECT_EQ(run.exit_code, 0) << run.err;
  const auto json = nlohmann::json::parse(readFile(in / "c.json"));
  ASSERT_EQ(json.size(), 1U);
  EXPECT_EQ(json.at(0).at("name"), "both.csv");
  fs::remove(in / "a/both.csv");
  expectRefused({app("raceloc-eval"), "compare", in / "a", in / "b"}, {"no file", "alone.csv, both.csv"});
  expectRefused({app("raceloc-eval"), "compare", in / "a", bad}, {"one is a folder"});
}

TEST_F(Trajectories, FilesThatAreNoErrorsAreRefused) {
  expectRefused({app("raceloc-eval"), "compare", in / "truth.tum", in / "nowhere.csv"},
                {"truth.tum", "no column"});
  expectRefused({app("raceloc-eval"), "compare", errorsOf("a", drive(0.1)), in / "nowhere.csv"},
                {"nowhere.csv"});
}

// ---- cpu

TEST(Commands, HaveManualsOfTheirOwn) {
  for (const std::string command : {"compare", "cpu"}) {
    const auto help = runCommand({app("raceloc-eval"), command, "--help"});
    EXPECT_EQ(help.exit_code, 0);
    EXPECT_THAT(help.err, IsEmpty());
    EXPECT_THAT(help.out, HasSubstr("raceloc-eval " + command));
    for (const std::string part : {"EXAMPLES", "EXIT STATUS", "OPTIONS"})
      EXPECT_THAT(help.out, HasSubstr(part));
  }
}

using Cpu = BadInput;

CommandResult measured(const std::string& script, const std::vector<std::string>& options = {}) {
  std::vector<std::string> command{app("raceloc-eval"), "cpu"};
  command.insert(command.end(), options.begin(), options.end());
  command.insert(command.end(), {"--", "sh", "-c", script});
  return runCommand(command);
}

TEST_F(Cpu, PassesOutputAndStatusThrough) {
  const auto run = measured("echo words; echo more >&2; exit 7");
  EXPECT_EQ(run.exit_code, 7);
  EXPECT_EQ(run.out, "words\n");
  EXPECT_THAT(run.err, AllOf(HasSubstr("more\n"), HasSubstr("exit status 7"), HasSubstr("core-seconds")));
  EXPECT_EQ(measured("kill -USR1 $$").exit_code, 128 + SIGUSR1);
}

TEST_F(Cpu, WhatCannotBeStartedIsNamed) {
  expectRefused({app("raceloc-eval"), "cpu", "--", in / "nowhere"}, {in / "nowhere", "cannot be started"});
  expectRefused({app("raceloc-eval"), "cpu", "--json", out / "f.json"}, {"no command given"});
  expectRefused({app("raceloc-eval"), "cpu", "--period", "0", "--", "true"}, {"--period"});
  expectRefused(
      {app("raceloc-eval"), "cpu", "--json", in / "no/f.json", "--", "sh", "-c", "touch " + (out / "ran")},
      {in / "no/f.json"});  // and nothing has run
}

TEST_F(Cpu, CountsTheTimeOfAllProcesses) {
  const std::string busy = "python3 -c 'import time\nwhile time.process_time() < 0.3: pass'";
  const auto run = measured(busy + " & " + busy + "; wait", {"--recorded", "2", "--json", out / "f.json"});
  EXPECT_EQ(run.exit_code, 0) << run.err;
  const auto json = nlohmann::json::parse(readFile(out / "f.json"));
  const double core_s = json.at("core_s");
  EXPECT_GE(core_s, 0.6);
  EXPECT_NEAR(json.at("core_s_per_recorded_s"), core_s / 2, 1e-9);
  EXPECT_NEAR(json.at("cores").at("mean"), core_s / json.at("wall_s").get<double>(), 1e-9);
  EXPECT_NEAR(json.at("cpu_percent_of_machine").at("mean"),
              100 * json.at("cores").at("mean").get<double>() / json.at("threads_of_machine").get<double>(),
              1e-9);
}

TEST_F(Cpu, CountsMemory) {
  ASSERT_EQ(measured("python3 -c 'x = b\"1\" * (200 << 20)'", {"--json", out / "f.json"}).exit_code, 0);
  EXPECT_GE(nlohmann::json::parse(readFile(out / "f.json")).at("peak_rss_MiB"), 200);
}

TEST_F(Cpu, HandsASignalOn) {
  RunningCommand run({app("raceloc-eval"), "cpu", "--", "sh", "-c", "echo ready >&2; exec sleep 1000"});
  ASSERT_TRUE(comesTrue([&] { return run.errSoFar().find("ready") != std::string::npos; }));
  run.kill(SIGTERM);
  const auto result = run.wait();
  EXPECT_EQ(result.exit_code, 128 + SIGTERM);
  EXPECT_THAT(result.err, HasSubstr("exit status 143"));
}

TEST(UsageLog, MeanMaxAndMinOfPeriods) {
  UsageLog log;
  log.add(1, {0.5, 10});
  log.add(2, {2.5, 40});
  log.add(4, {2.9, 20});
  ProcessUsage usage{};
  usage.peak_rss_MiB = 30;
  log.fill(usage);
  EXPECT_EQ(usage.periods, 3U);
  EXPECT_NEAR(usage.cores_max, 2, 1e-12);
  EXPECT_NEAR(usage.cores_min, 0.2, 1e-12);
  EXPECT_EQ(usage.peak_rss_MiB, 40);
  ASSERT_EQ(usage.samples.size(), 3U);
  EXPECT_NEAR(usage.samples[0].cores, 0.5, 1e-12);
}

TEST(UsageLog, OfALongRunStaysSmallAndKeepsItsPeaks) {
  UsageLog log;
  for (int i = 1; i <= 100000; ++i) log.add(i, {0.5 * i, i == 777 ? 900.0 : 100.0});
  ProcessUsage usage{};
  log.fill(usage);
  EXPECT_EQ(usage.periods, 100000U);
  EXPECT_LE(usage.samples.size(), ProcessUsage::kMostSamples);
  EXPECT_GE(usage.samples.size(), ProcessUsage::kMostSamples / 2 - 1);
  double peak_MiB = 0;
  for (const UsageSample& sample : usage.samples) {
    peak_MiB = std::max(peak_MiB, sample.rss_MiB);
    EXPECT_NEAR(sample.cores, 0.5, 1e-9);
  }
  EXPECT_EQ(peak_MiB, 900);
  EXPECT_EQ(usage.peak_rss_MiB, 900);
}

TEST(UsageLog, GrowthIsToldFromAFlatRun) {
  const auto of = [](const std::function<double(int)>& memory_MiB) {
    UsageLog log;
    for (int i = 1; i <= 400; ++i) log.add(i, {0.1 * i, memory_MiB(i)});
    ProcessUsage usage{};
    log.fill(usage);
    return usage;
  };
  const ProcessUsage leaking = of([](int i) { return 100 + 0.1 * i; });
  EXPECT_NEAR(leaking.rss_growth_MiB.value(), 20, 0.5);  // 200 s of 0.1 MiB/s
  EXPECT_EQ(leaking.isFlat(), false);
  const ProcessUsage warm = of([](int i) {
    return i < 150 ? i : i < 400 ? 150 : 20;
  });  // frees all before it ends
  EXPECT_EQ(warm.rss_growth_MiB, 0);
  EXPECT_EQ(warm.isFlat(), true);

  UsageLog shorter;
  for (int i = 1; i < 8; ++i) shorter.add(i, {0.1 * i, 100.0 * i});
  ProcessUsage unknown{};
  shorter.fill(unknown);
  EXPECT_EQ(unknown.rss_growth_MiB, std::nullopt);
  EXPECT_EQ(unknown.isFlat(), std::nullopt);
}

}  // namespace
}  // namespace raceloc::test
