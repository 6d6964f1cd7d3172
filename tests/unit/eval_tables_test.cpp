#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <fstream>
#include <limits>
#include <string>

#include "eval/acceleration.h"
#include "eval/csv_columns.h"
#include "eval/report.h"
#include "eval/run_plots.h"
#include "eval/run_tables.h"
#include "support/complaint.h"
#include "support/files.h"
#include "support/run_command.h"
#include "support/trajectories.h"

namespace raceloc::test {
namespace {

using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;

class Table : public ::testing::Test {
 protected:
  [[nodiscard]] std::string holding(const std::string& text) const {
    writeFile(folder / "table.csv", text);
    return folder / "table.csv";
  }
  TemporaryFolder folder;
};

TEST_F(Table, ColumnsAreFoundByTheirNames) {
  const CsvColumns table =
      readCsv("test", holding("b,name,a\r\n1,\"x, \"\"y\"\"\",2.5\r\ninf,z,-3e2\r\n"), {"a", "b"}, {"name"});
  EXPECT_EQ(table.lines, 2U);
  EXPECT_THAT(table.numbers.at("a"), ElementsAre(2.5, -300));
  EXPECT_THAT(table.numbers.at("b"), ElementsAre(1, std::numeric_limits<double>::infinity()));
  EXPECT_THAT(table.words.at("name"), ElementsAre("x, \"y\"", "z"));
}

TEST_F(Table, WhatIsWrongIsNamed) {
  const auto said = [&](const std::string& text) {
    return complaint([&] { (void)readCsv("test", holding(text), {"a"}); });
  };
  EXPECT_THAT(said(""), AllOf(HasSubstr("test "), HasSubstr("table.csv"), HasSubstr("empty")));
  EXPECT_THAT(said("a,b\n"), HasSubstr("no line below its header"));
  EXPECT_THAT(said("b,c\n1,2\n"), AllOf(HasSubstr("no column a"), HasSubstr("b, c")));
  EXPECT_THAT(said("a,b\n1,2\n3\n"), AllOf(HasSubstr("line 3"), HasSubstr("1 fields under 2 names")));
  EXPECT_THAT(said("a\n1\nx\n"), AllOf(HasSubstr("line 3"), HasSubstr("column a is \"x\"")));
  EXPECT_THAT(said("a\nnan\n"), HasSubstr("\"nan\""));
  EXPECT_THAT(complaint([&] { (void)readCsv("test", folder / "nowhere.csv", {"a"}); }),
              HasSubstr("nowhere.csv"));
}

constexpr char kIntegrityHeader[] =
    "stamp_s,state,protection_lateral_m,protection_longitudinal_m,protection_heading_rad,alert_limit_m\n";

TEST_F(Table, IntegrityIsInDegreesAndInOrder) {
  const auto lines =
      readIntegrity(holding(std::string(kIntegrityHeader) + "1,0,0.5,1,0.1,3\n2,2,inf,2,0.2,3\n"));
  ASSERT_EQ(lines.size(), 2U);
  EXPECT_EQ(lines[1].state, 2);
  EXPECT_NEAR(lines[0].protection_heading_deg, 18 / M_PI, 1e-12);
  EXPECT_TRUE(std::isinf(lines[1].protection_lateral_m));
  EXPECT_THAT(
      complaint([&] { (void)readIntegrity(holding(std::string(kIntegrityHeader) + "1,7,1,1,1,1\n")); }),
      HasSubstr("line 2: state must be"));
  EXPECT_THAT(complaint([&] {
                (void)readIntegrity(holding(std::string(kIntegrityHeader) + "2,0,1,1,1,1\n1,0,1,1,1,1\n"));
              }),
              HasSubstr("line 3: its stamp is before"));
}

TEST(StanfordCount, OfEachKindByHand) {
  const StanfordCounts c = stanfordCounts({{1, 2, 3},    // available
                                           {2, 2, 2},    // still available
                                           {1, 4, 3},    // said that it is not good enough
                                           {2.5, 2, 3},  // misleading
                                           {3.5, 2, 3},  // and hazardous
                                           {5, 4, 3}});  // misleading, but nobody was to use it
  EXPECT_EQ(c.epochs, 6U);
  EXPECT_EQ(c.available, 2U);
  EXPECT_EQ(c.unavailable, 1U);
  EXPECT_EQ(c.misleading, 3U);
  EXPECT_EQ(c.hazardous, 1U);
}

TEST(StanfordOf, TakesTheLinesOfTheSameStamps) {
  const auto left = moved(straight("e"), poseFromRpy({0.1, 0.25, 0}, 0, 0, 0));
  const auto poses = evaluate(straight("t"), left, {}).poses;
  const Stanford s =
      stanford(poses, {{0.05, 0, 9, 9, 9, 9}, {1.0002, 1, 0.5, 0.75, 2, 3}, {99, 3, 9, 9, 9, 9}}, "i.csv");
  ASSERT_EQ(s.lateral_m.size(), 1U);
  EXPECT_NEAR(s.lateral_m[0].error, 0.25, kRounding_m);
  EXPECT_EQ(s.lateral_m[0].protection, 0.5);
  EXPECT_EQ(s.lateral_m[0].alert_limit, 3);
  EXPECT_NEAR(s.longitudinal_m[0].error, 0.1, kRounding_m);
  EXPECT_EQ(s.longitudinal_m[0].protection, 0.75);
  EXPECT_THAT(s.states, ElementsAre(1, 1, 0, 1));
  EXPECT_THAT(complaint([&] { (void)stanford(poses, {{99, 0, 9, 9, 9, 9}}, "i.csv"); }), HasSubstr("i.csv"));
}

std::vector<DecisionLine> someDecisions() {
  return {{1, 0.3, 0.4, 2, true, "gps"},
          {1, 9, 9, 9, true, "scan"},
          {2, -0.3, 0, 4, true, "gps"},
          {3, 20, 5, 900, false, "gps"}};
}

TEST(SourceFigure, AreOfAcceptedFixesOfThatSource) {
  const SourceFigures f = sourceFigures(someDecisions(), "gps");
  EXPECT_EQ(f.decisions, 3U);
  ASSERT_EQ(f.accepted, 2U);
  EXPECT_NEAR(f.innovation->mean_along_m, 0, 1e-12);
  EXPECT_NEAR(f.innovation->mean_across_m, 0.2, 1e-12);
  EXPECT_NEAR(f.innovation->rms_m, std::sqrt((0.25 + 0.09) / 2), 1e-12);
  EXPECT_NEAR(f.innovation->mean_nis, 3, 1e-12);
  EXPECT_THAT(sourcesOf(someDecisions()), ElementsAre("gps", "scan"));

  const SourceFigures refused = sourceFigures({{1, 3, 4, 900, false, "gps"}}, "gps");
  EXPECT_EQ(refused.decisions, 1U);
  EXPECT_FALSE(refused.innovation);
}

TEST(Latency, FiguresByHand) {
  std::vector<LatencyLine> lines;
  for (int i = 1; i <= 101; ++i) lines.push_back({static_cast<double>(i), 0.001 * i});
  const LatencyFigures f = latencyFigures(lines);
  EXPECT_EQ(f.sweeps, 101U);
  EXPECT_NEAR(f.mean_ms, 51, 1e-9);
  EXPECT_NEAR(f.p50_ms, 51, 1e-9);
  EXPECT_NEAR(f.p99_ms, 100, 1e-9);
  EXPECT_NEAR(f.max_ms, 101, 1e-9);
}

TEST(Accelerations, OfACircleAreAcrossAndOfBrakingAhead) {
  const auto circle = sampled("c", 0, 20, 0.04, [](double t_s) { return onCircle(t_s); });
  const auto on_circle = accelerations(evaluate(circle, circle, {}).poses);
  EXPECT_EQ(on_circle.size(), 501U - 2 * 4);  // four poses at each end see less than 0.15 s to one side
  for (const auto& [along_mps2, across_mps2] : on_circle) {
    EXPECT_NEAR(across_mps2, 10 * 10 / 50.0, 0.01);  // v^2 / r; a parabola through an arc of 0.12 rad: 0.1 %
    EXPECT_NEAR(along_mps2, 0, 0.05);
  }
  const auto braking = sampled("b", 0, 5, 0.05, [](double t_s) {
    return StampedPose{t_s, poseFromRpy({50 * t_s - 4 * t_s * t_s, 0, 0}, 0, 0, 0)};
  });
  for (const auto& [along_mps2, across_mps2] : accelerations(evaluate(braking, braking, {}).poses)) {
    EXPECT_NEAR(along_mps2, -8, 1e-6);
    EXPECT_NEAR(across_mps2, 0, 1e-6);
  }
}

TEST(RunReport, HoldsWhatTheRunSaysOfItself) {
  const Evaluation e = evaluate(straight("t"), straight("e"), {});
  RunTables run;
  std::vector<IntegrityLine> integrity;
  for (const PoseError& pose : e.poses) integrity.push_back({pose.stamp_s, 0, 0.5, 0.5, 1, 3});
  run.stanford = stanford(e.poses, integrity, "i.csv");
  run.decisions = someDecisions();
  run.latency = {{1, 0.002}, {2, 0.004}};
  const std::string text = textReport(e, run), page = htmlReport(e, run, "raceloc-eval");
  for (const std::string words : {"integrity", "hazardous", "gps", "scan to pose"}) {
    EXPECT_THAT(text, HasSubstr(words));
    EXPECT_THAT(page, HasSubstr(words));
  }
  for (const std::string title : {"Stanford diagram", "Gate: innovation of gps", "Latency of the scan match"})
    EXPECT_THAT(page, HasSubstr(title));
  for (const Picture& picture : picturesOf(e, run))
    EXPECT_THAT(drawn(picture, PictureFormat::svg), HasSubstr("</svg>")) << picture.name;
}

}  // namespace
}  // namespace raceloc::test
