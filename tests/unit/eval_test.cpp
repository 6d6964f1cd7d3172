#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "eval/report.h"
#include "eval/trajectory_errors.h"
#include "support/complaint.h"
#include "support/trajectories.h"

namespace raceloc::test {
namespace {

using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::SizeIs;

TEST(Statistics, OfFourNumbersByHand) {
  const Statistics s = statisticsOf({-3, 1, 1, 5});  // squares 9 1 1 25, deviations from 1: 16 0 0 16
  EXPECT_DOUBLE_EQ(s.rmse, 3);
  EXPECT_DOUBLE_EQ(s.mean, 1);
  EXPECT_DOUBLE_EQ(s.median, 1);
  EXPECT_DOUBLE_EQ(s.std, std::sqrt(8));
  EXPECT_DOUBLE_EQ(s.max, 5);
  EXPECT_DOUBLE_EQ(statisticsOf({-7, 2, 1}).max, 7);
  EXPECT_DOUBLE_EQ(statisticsOf({2, -7, 1}).median, 1);
  EXPECT_THROW((void)statisticsOf({}), std::invalid_argument);
}

TEST(Interpolation, IsLinearBetweenNeighboursAndExactAtThem) {
  const std::vector<StampedPose> truth = {{1, poseFromRpy({0, 0, 0}, 0, 0, 0)},
                                          {2, poseFromRpy({4, 8, -2}, 0, 0, 1)}};
  EXPECT_TRUE(interpolated(truth, 1, 1)->isApprox(truth[0].T_map_body, 0));
  EXPECT_TRUE(interpolated(truth, 2, 1)->isApprox(truth[1].T_map_body, 0));
  EXPECT_TRUE(interpolated(truth, 1.25, 1)->isApprox(poseFromRpy({1, 2, -0.5}, 0, 0, 0.25), 1e-12));
}

TEST(Interpolation, LeavesGapsAndEndsOpen) {
  const std::vector<StampedPose> truth = {onStraight(0), onStraight(0.5), onStraight(1.5)};
  EXPECT_TRUE(interpolated(truth, 0.2, 0.5));  // as wide as allowed
  EXPECT_FALSE(interpolated(truth, 1.0, 0.5));
  EXPECT_TRUE(interpolated(truth, 1.5, 0.5));  // at the end of a gap there is a truth
  EXPECT_FALSE(interpolated(truth, -0.001, 0.5));
  EXPECT_FALSE(interpolated(truth, 1.501, 0.5));
}

TEST(Evaluation, OfItselfIsZero) {
  const Evaluation e = evaluate(straight("truth"), straight("estimate"), {});
  EXPECT_THAT(e.poses, SizeIs(101));
  EXPECT_EQ(e.matchShare(), 1);
  EXPECT_EQ(e.position_3d_m.max, 0);
  EXPECT_EQ(e.heading_deg.max, 0);
  EXPECT_NEAR(e.path_length_m, 100, kRounding_m);
  EXPECT_NEAR(e.min_speed_mps, 10, kRounding_m);
  EXPECT_NEAR(e.max_speed_mps, 10, kRounding_m);
  EXPECT_THAT(e.warnings, IsEmpty());
}

TEST(Evaluation, OffsetToTheLeftOnACircleIsLateralOnly) {
  const auto to_the_left = [](double t_s) { return onCircle(t_s, 1); };
  const Evaluation e = evaluate(sampled("truth", 0, 30, 0.1, [](double t_s) { return onCircle(t_s); }),
                                sampled("estimate", 0, 30, 0.1, to_the_left), {});
  EXPECT_NEAR(e.lateral_m.mean, 1, kRounding_m);
  EXPECT_NEAR(e.lateral_m.rmse, 1, kRounding_m);
  EXPECT_NEAR(e.lateral_m.std, 0, kRounding_m);
  EXPECT_NEAR(e.longitudinal_m.max, 0, kRounding_m);
  EXPECT_NEAR(e.position_plane_m.rmse, 1, kRounding_m);
  EXPECT_NEAR(e.position_3d_m.rmse, 1, kRounding_m);
  EXPECT_NEAR(e.height_m.max, 0, kRounding_m);
  EXPECT_NEAR(e.heading_deg.max, 0, kRounding_m);
}

TEST(Evaluation, SignsAreAheadLeftUpAndCounterClockwise) {
  const Pose T_north = poseFromRpy({0, 0, 0}, 0, 0, M_PI / 2);
  const Pose T_estimate = poseFromRpy({-2, 3, 4}, 0, 0, M_PI / 2 + 0.1);
  const Evaluation e = evaluate(file("truth", {{0, T_north}}), file("estimate", {{0, T_estimate}}), {});
  EXPECT_NEAR(e.longitudinal_m.mean, 3, kRounding_m);
  EXPECT_NEAR(e.lateral_m.mean, 2, kRounding_m);
  EXPECT_NEAR(e.height_m.mean, 4, kRounding_m);
  EXPECT_NEAR(e.heading_deg.mean, 18 / M_PI, kRounding_m);
  EXPECT_NEAR(e.position_plane_m.mean, std::sqrt(13), kRounding_m);
  EXPECT_NEAR(e.position_3d_m.mean, std::sqrt(29), kRounding_m);
}

TEST(Evaluation, HeadingErrorIsTheShortWayRound) {
  const Evaluation e = evaluate(file("truth", {{0, poseFromRpy({0, 0, 0}, 0, 0, 3.1)}}),
                                file("estimate", {{0, poseFromRpy({0, 0, 0}, 0, 0, -3.1)}}), {});
  EXPECT_NEAR(e.heading_deg.mean, (2 * M_PI - 6.2) * 180 / M_PI, kRounding_m);
}

TEST(Evaluation, RatesNeedNotAgree) {
  const auto sparse = sampled("sparse", 0.05, 9.85, 0.7, onStraight);
  const auto dense = sampled("dense", 0, 10, 0.01, onStraight);
  const Evaluation truth_is_dense = evaluate(dense, sparse, {});
  EXPECT_THAT(truth_is_dense.poses, SizeIs(15));
  EXPECT_NEAR(truth_is_dense.position_3d_m.max, 0, kRounding_m);
  EvalOptions options;
  options.max_gap_s = 1;
  const Evaluation truth_is_sparse = evaluate(sparse, dense, options);
  EXPECT_EQ(truth_is_sparse.outside_truth, 1001 - truth_is_sparse.poses.size());
  EXPECT_NEAR(truth_is_sparse.position_3d_m.max, 0, kRounding_m);
}

TEST(Evaluation, CountsWhatItLeavesOut) {
  auto truth = straight("truth");
  auto& poses = truth.trajectory.poses;
  poses.erase(poses.begin() + 41, poses.begin() + 60);  // none between 4.0 and 6.0 s
  const Evaluation e = evaluate(truth, sampled("estimate", -1, 10, 0.1, onStraight), {});
  EXPECT_EQ(e.in_gaps, 19U);
  EXPECT_EQ(e.outside_truth, 10U);
  EXPECT_THAT(e.poses, SizeIs(111 - 19 - 10));
}

TEST(Evaluation, TooFewMatchesNameBothSpans) {
  const auto late = sampled("late.tum", 6, 16, 0.1, onStraight);
  EXPECT_THAT(complaint([&] { (void)evaluate(straight("truth.tum"), late, {}); }),
              AllOf(HasSubstr("estimate late.tum: only 41 of 101 poses have a truth in truth.tum"),
                    HasSubstr("estimate 6.000 .. 16.000 s, truth 0.000 .. 10.000 s")));
}

TEST(Evaluation, NoOverlapNamesBothSpans) {
  const auto other_day = sampled("other.tum", 86400, 86410, 0.1, onStraight);
  EXPECT_THAT(complaint([&] { (void)evaluate(straight("truth.tum"), other_day, {}); }),
              AllOf(HasSubstr("only 0 of 101 poses"), HasSubstr("86400.000 .. 86410.000 s")));
}

TEST(Evaluation, TwoMapOriginsAreNamed) {
  auto truth = straight("truth.tum");
  auto estimate = straight("estimate.tum");
  truth.trajectory.origin = GeodeticPoint{45.61, 9.28, 180};
  estimate.trajectory.origin = truth.trajectory.origin;
  EXPECT_EQ(evaluate(truth, estimate, {}).position_3d_m.max, 0);
  estimate.trajectory.origin->longitude_deg = 9.29;
  EXPECT_THAT(complaint([&] { (void)evaluate(truth, estimate, {}); }),
              AllOf(HasSubstr("truth.tum"), HasSubstr("estimate.tum"),
                    HasSubstr("lat 45.61000000 lon 9.28000000"), HasSubstr("lon 9.29000000")));
  EvalOptions aligned;
  aligned.align = Alignment::se3;
  EXPECT_NEAR(evaluate(truth, estimate, aligned).position_3d_m.max, 0, kRounding_m);
}

TEST(Evaluation, AlignmentNeedsThreePoses) {
  EvalOptions options;
  options.align = Alignment::se3;
  const auto two = sampled("two.tum", 0, 1, 1, onStraight);
  EXPECT_THAT(complaint([&] { (void)evaluate(straight("truth.tum"), two, options); }),
              AllOf(HasSubstr("two.tum"), HasSubstr("at least 3")));
}

EvalOptions aligned() {
  EvalOptions options;
  options.align = Alignment::se3;
  return options;
}

TEST(Evaluation, AxesThatAreADegreeOffAreDriftUntilTheyAreAligned) {
  const auto turned = [](double t_s) {
    StampedPose pose = onCircle(t_s);
    pose.T_map_body.rotate(Eigen::AngleAxisd(kDegree, Eigen::Vector3d::UnitZ()));
    return pose;
  };
  const auto truth = sampled("truth.tum", 0, 10, 0.1, [](double t_s) { return onCircle(t_s); });
  const auto estimate = sampled("estimate.tum", 0, 10, 0.1, turned);
  // 21 steps of just under a metre, each 0.02 rad of the circle, are a piece of 20 m; its chord points a degree to the
  // right of where it should, and is off by the base of a triangle with two sides of its length
  const double piece_m = 21 * 100 * std::sin(0.01);
  const double chord_m = 100 * std::sin(0.21);
  EXPECT_NEAR(evaluate(truth, estimate, aligned()).relative[0].translation_percent,
              100 * chord_m * 2 * std::sin(kDegree / 2) / piece_m, 1e-6);

  EvalOptions options;
  options.align = Alignment::axes;
  const Evaluation e = evaluate(truth, estimate, options);
  EXPECT_NEAR(e.relative[0].translation_percent, 0, 1e-6);
  EXPECT_NEAR(e.bodyTurn_deg().z(), -1, 1e-6);
  const auto json = nlohmann::json::parse(figuresJson(e, {}));
  EXPECT_EQ(json["aligned"], "axes");
  EXPECT_NEAR(json["body_axes_turned_deg"][2], -1, 1e-6);
}

TEST(Frames, AnOffsetOfKilometresIsNamedAndRefused) {
  const auto far = moved(straight("far.tum"), poseFromRpy({12000, -5000, 0}, 0, 0, 0));
  EXPECT_THAT(complaint([&] { (void)evaluate(straight("truth.tum"), far, {}); }),
              AllOf(HasSubstr("far.tum"), HasSubstr("truth.tum"), HasSubstr("constant offset of 13.000 km"),
                    HasSubstr("--align se3")));
  EXPECT_THAT(evaluate(straight("truth"), far, aligned()).warnings, IsEmpty());
}

TEST(Frames, AQuarterTurnIsNamedAndRefused) {
  auto turned = straight("turned.tum");
  for (auto& pose : turned.trajectory.poses)
    pose.T_map_body = pose.T_map_body * poseFromRpy({0, 0, 0}, 0, 0, -1.55);
  EXPECT_THAT(complaint([&] { (void)evaluate(straight("truth.tum"), turned, {}); }),
              AllOf(HasSubstr("turned.tum"), HasSubstr("headings differ by a constant -89 deg")));
  EXPECT_THAT(evaluate(straight("truth"), turned, aligned()).warnings,
              ElementsAre(HasSubstr("headings differ by a constant -89 deg")));
}

TEST(Frames, AnOffsetOfMetresAndATurnOfDegreesAreErrorsOfTheEstimate) {
  const auto off = moved(straight("off"), poseFromRpy({300, 0, 0}, 0, 0, 0.1));
  EXPECT_THAT(evaluate(straight("truth"), off, {}).warnings, IsEmpty());
}

TEST(Frames, ATruthThatDoesNotLookWhereItDrivesIsAWarning) {
  auto sideways = straight("truth");
  for (auto& pose : sideways.trajectory.poses)
    pose.T_map_body.linear() = poseFromRpy({0, 0, 0}, 0, 0, 1).linear();
  EXPECT_THAT(evaluate(sideways, sideways, {}).warnings,
              ElementsAre(HasSubstr("heading is -57 deg off its path")));
}

TEST(Report, TextHoldsTheFigures) {
  const auto left = moved(straight("estimate.tum"), poseFromRpy({0, 0.25, 0}, 0, 0, 0));
  EvalOptions options;
  options.segment_lengths_m = {20, 500};
  const std::string text = textReport(evaluate(straight("truth.tum"), left, options), {});
  EXPECT_THAT(text,
              AllOf(HasSubstr("truth.tum: 101 poses, 10.0 s, 10.0 Hz"), HasSubstr("101 of 101"),
                    HasSubstr("lateral [m]               0.250      0.250"), HasSubstr("path is too short")));
}

TEST(Report, JsonHoldsTheFiguresWithTheirUnits) {
  const auto left = moved(straight("estimate.tum"), poseFromRpy({0, 0.25, 0}, 0, 0, 0));
  EvalOptions options;
  options.speed_bin_mps = 4;  // 10 m/s is well inside of 8 .. 12
  const auto json = nlohmann::json::parse(figuresJson(evaluate(straight("truth.tum"), left, options), {}));
  EXPECT_EQ(json.at("truth").at("file"), "truth.tum");
  EXPECT_EQ(json.at("match").at("poses"), 101);
  EXPECT_NEAR(json.at("errors").at("lateral_m").at("rmse").get<double>(), 0.25, kRounding_m);
  EXPECT_EQ(json.at("drift").at(0).at("length_m"), 20);
  EXPECT_EQ(json.at("rpe").at(0).at("step_s"), 1);
  EXPECT_EQ(json.at("rpe").at(0).at("pairs"), 10);
  EXPECT_EQ(json.at("by_sector").size(), 12U);
  EXPECT_EQ(json.at("by_speed").size(), 1U);
  EXPECT_TRUE(json.at("warnings").empty());
}

TEST(Report, CsvHasALineAPoseUnderItsHeader) {
  const std::string csv = errorsCsv(
      evaluate(file("t", {onStraight(0), onStraight(0.1)}), file("e", {onStraight(0), onStraight(0.1)}), {}));
  const std::string header = csv.substr(0, csv.find('\n'));
  EXPECT_THAT(header, HasSubstr("stamp_s,station_m,"));
  EXPECT_EQ(std::count(csv.begin(), csv.end(), '\n'), 3);
  EXPECT_EQ(std::count(csv.begin(), csv.end(), ','), 3 * std::count(header.begin(), header.end(), ','));
}

}  // namespace
}  // namespace raceloc::test
