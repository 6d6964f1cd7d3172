// Every number expected here is worked out by hand or taken from a printed table.
#include <gmock/gmock.h>

#include <cmath>
#include <limits>
#include <stdexcept>

#include "fusion/chi_square.h"
#include "fusion/fusion_filter.h"

namespace raceloc {
namespace {

using ::testing::DoubleNear;
using ::testing::ElementsAre;
using ::testing::HasSubstr;

constexpr double kRounding = 1e-12;
constexpr double kPi = 3.14159265358979323846;

PoseFix fixAt(const std::string& source, double x_m, double y_m, double sigma_m = 1) {
  return {source, {x_m, y_m}, sigma_m * sigma_m * Eigen::Matrix2d::Identity()};
}
PoseFix fixWithHeading(const std::string& source, HeadingKind kind, double heading_rad, double sigma_rad,
                       double x_m = 1) {
  PoseFix fix = fixAt(source, x_m, 0);
  fix.heading = kind;
  fix.heading_rad = heading_rad;
  fix.heading_sigma_rad = sigma_rad;
  return fix;
}
CarState atOrigin() { return {Eigen::Vector4d::Zero(), Eigen::Matrix4d::Identity()}; }

TEST(BayesGate, AllWithinEpsilonUsesThePrimary) {
  GateOptions options;
  options.primary_order = "scan_match gps_*";
  const auto scan = fixAt("scan_match", 0.1, 0), left = fixAt("gps_left", 0, 0.15),
             right = fixAt("gps_right", 0, 0.2);
  const auto result = gate(atOrigin(), {right, left, scan}, options);
  EXPECT_EQ(result.decision.rule, GateRule::primary);
  EXPECT_FALSE(result.decision.alarm);
  ASSERT_TRUE(result.fused);
  EXPECT_EQ(result.fused->source, "scan_match");
  EXPECT_EQ(result.fused->p_map_m, scan.p_map_m);
  EXPECT_EQ(result.fused->cov_p_m2, scan.cov_p_m2);
  EXPECT_EQ(result.decision.sources[0].source, "gps_right");  // verdicts stand in the order of the fixes
  EXPECT_EQ(result.decision.sources[0].weight, 0);
  EXPECT_TRUE(result.decision.sources[0].accepted);
  EXPECT_NEAR(result.decision.sources[0].delta, 0.2, kRounding);
  EXPECT_EQ(result.decision.sources[0].limit, 5.0);
  EXPECT_EQ(result.decision.sources[2].weight, 1);
}

TEST(BayesGate, ThePrimaryIsFirstByPatternThenByName) {
  const auto primary = [](const std::string& order) {
    GateOptions options;
    options.primary_order = order;
    return gate(atOrigin(), {fixAt("gps_right", 0, 0), fixAt("ins", 0, 0), fixAt("gps_left", 0, 0)}, options)
        .fused->source;
  };
  EXPECT_EQ(primary("gps_*"), "gps_left");
  EXPECT_EQ(primary("ins gps_*"), "ins");
  EXPECT_EQ(primary("gps_right, gps_*"), "gps_right");
  EXPECT_EQ(primary("scan_match ins"), "ins");
  EXPECT_EQ(primary("scan_match"), "gps_left");  // none named: by name
  EXPECT_EQ(primary(""), "gps_left");
}

TEST(BayesGate, OfSeveralUnderOnePatternThePrimaryIsTheSurest) {
  std::vector<PoseFix> fixes{fixAt("gps_left", 0, 0), fixAt("gps_right", 0, 0), fixAt("ins", 0, 0)};
  fixes[1].cov_p_m2 *= 0.5;
  fixes[2].cov_p_m2 *= 0.25;
  GateOptions options;
  options.primary_order = "gps_*";
  EXPECT_EQ(gate(atOrigin(), fixes, options).fused->source, "gps_right");
  options.primary_order = "";
  EXPECT_EQ(gate(atOrigin(), fixes, options).fused->source, "ins");
}

TEST(BayesGate, BetweenEpsilonAndDeltaIsAWeightedSum) {
  // Deltas 1, 2, 3: lambda = 1 - Delta/6 = 5/6, 4/6, 3/6; over K - 1 = 2: 5/12, 4/12, 3/12.
  const auto result =
      gate(atOrigin(), {fixAt("a", 1, 0, 1), fixAt("b", 0, 2, 2), fixAt("c", -3, 0, 3)}, GateOptions());
  EXPECT_EQ(result.decision.rule, GateRule::weighted);
  EXPECT_NEAR(result.decision.sources[0].weight, 5.0 / 12, kRounding);
  EXPECT_NEAR(result.decision.sources[1].weight, 4.0 / 12, kRounding);
  EXPECT_NEAR(result.decision.sources[2].weight, 3.0 / 12, kRounding);
  ASSERT_TRUE(result.fused);
  EXPECT_NEAR(result.fused->p_map_m.x(), (5.0 * 1 - 3.0 * 3) / 12, kRounding);
  EXPECT_NEAR(result.fused->p_map_m.y(), 4.0 * 2 / 12, kRounding);
  EXPECT_NEAR(result.fused->cov_p_m2(0, 0), (25.0 * 1 + 16.0 * 4 + 9.0 * 9) / 144, kRounding);
  EXPECT_NEAR(result.fused->cov_p_m2(0, 1), 0, kRounding);
  EXPECT_EQ(result.fused->heading, HeadingKind::none);
}

TEST(BayesGate, OneSourceAloneIsTakenWhole) {
  const auto fix = fixWithHeading("gps", HeadingKind::course, 2.5, 0.1, 3);
  const auto result = gate(atOrigin(), {fix}, GateOptions());
  EXPECT_EQ(result.decision.rule, GateRule::weighted);
  EXPECT_EQ(result.decision.sources[0].weight, 1);
  EXPECT_EQ(result.fused->p_map_m, fix.p_map_m);
  EXPECT_EQ(result.fused->heading, HeadingKind::course);
  EXPECT_EQ(result.fused->heading_rad, 2.5);
}

TEST(BayesGate, BeyondDeltaIsRejectedAndTheOthersGoByTheirOwnRule) {
  const auto far = fixAt("far", 8.3, 0);
  const auto one_left = gate(atOrigin(), {far, fixAt("near", 4, 0)}, GateOptions());
  EXPECT_EQ(one_left.decision.rule, GateRule::rejected_some);
  EXPECT_FALSE(one_left.decision.alarm);
  EXPECT_FALSE(one_left.decision.sources[0].accepted);
  EXPECT_EQ(one_left.decision.sources[0].weight, 0);
  EXPECT_NEAR(one_left.decision.sources[0].delta, 8.3, kRounding);
  EXPECT_EQ(one_left.decision.sources[1].weight, 1);
  EXPECT_EQ(one_left.fused->source, "near");

  const auto rule_1 = gate(atOrigin(), {far, fixAt("gps_b", 0.1, 0), fixAt("gps_a", 0.2, 0)}, GateOptions());
  EXPECT_EQ(rule_1.decision.rule, GateRule::rejected_some);
  EXPECT_EQ(rule_1.fused->source, "gps_a");

  const auto rule_2 = gate(atOrigin(), {far, fixAt("a", 1, 0), fixAt("b", 3, 0)}, GateOptions());
  EXPECT_EQ(rule_2.decision.rule, GateRule::rejected_some);
  EXPECT_NEAR(rule_2.decision.sources[1].weight, 0.75, kRounding);
  EXPECT_NEAR(rule_2.decision.sources[2].weight, 0.25, kRounding);
  EXPECT_NEAR(rule_2.fused->p_map_m.x(), 1.5, kRounding);
}

TEST(BayesGate, AllBeyondDeltaRaisesTheAlarm) {
  const auto result = gate(atOrigin(), {fixAt("a", 5.001, 0), fixAt("b", 0, -9)}, GateOptions());
  EXPECT_EQ(result.decision.rule, GateRule::rejected_all);
  EXPECT_TRUE(result.decision.alarm);
  EXPECT_FALSE(result.fused);
  for (const auto& source : result.decision.sources) EXPECT_EQ(source.weight, 0);
}

TEST(BayesGate, TheLimitsThemselvesAreInside) {
  // Powers of two, so that Delta is the limit to the bit.
  GateOptions options;
  options.epsilon_m = 0.25;
  options.delta_m = 4;
  EXPECT_EQ(gate(atOrigin(), {fixAt("a", 0.25, 0)}, options).decision.rule, GateRule::primary);
  EXPECT_EQ(gate(atOrigin(), {fixAt("a", 4, 0)}, options).decision.rule, GateRule::weighted);
}

TEST(BayesGate, MetricDistanceWeighsDirectionsByTheCovariance) {
  // Sigma = diag(4, 1/4), s^2 = sqrt(det) = 1: 2 m along x count 2 / 2, 2 m along y count 2 / 0.5.
  PoseFix fix = fixAt("a", 2, 0);
  fix.cov_p_m2 << 4, 0, 0, 0.25;
  EXPECT_NEAR(gate(atOrigin(), {fix}, GateOptions()).decision.sources[0].delta, 1, kRounding);
  fix.p_map_m << 0, 2;
  EXPECT_NEAR(gate(atOrigin(), {fix}, GateOptions()).decision.sources[0].delta, 4, kRounding);
}

TEST(BayesGate, Chi2IsTheNormalisedInnovationOfWhatIsMeasured) {
  GateOptions options;
  options.metric = GateMetric::chi2;
  options.delta_false_alarm = 0.01;
  // S = 1 + 1 = 2 on x and y, 1 + 3 on the heading: 4/2 + 0 + 0.5^2/4.
  const auto body =
      gate(atOrigin(), {fixWithHeading("a", HeadingKind::body, 0.5, std::sqrt(3.0), 2)}, options);
  EXPECT_NEAR(body.decision.sources[0].delta, 2 + 0.0625, kRounding);
  EXPECT_NEAR(body.decision.sources[0].limit, 11.345, 5e-4);
  // Course: theta and b add their variances, 1 + 1 + 3.
  const auto course =
      gate(atOrigin(), {fixWithHeading("a", HeadingKind::course, 0.5, std::sqrt(3.0), 2)}, options);
  EXPECT_NEAR(course.decision.sources[0].delta, 2 + 0.05, kRounding);
  const auto none = gate(atOrigin(), {fixAt("a", 2, 0)}, options);
  EXPECT_NEAR(none.decision.sources[0].delta, 2, kRounding);
  EXPECT_NEAR(none.decision.sources[0].limit, 9.210, 5e-4);
}

TEST(BayesGate, Chi2WrapsTheHeading) {
  GateOptions options;
  options.metric = GateMetric::chi2;
  CarState predicted = atOrigin();
  predicted.mean(2) = kPi - 0.1;
  const auto result = gate(predicted, {fixWithHeading("a", HeadingKind::body, -kPi + 0.1, 1, 0)}, options);
  EXPECT_NEAR(result.decision.sources[0].delta, 0.2 * 0.2 / 2, kRounding);
}

TEST(BayesGate, HeadingsAreAveragedOnTheCircleAmongThoseThatHaveOne) {
  // Both headings at Delta = 1, the source without one too: weights 1/3 each, of the headings 1/2.
  const auto result = gate(atOrigin(),
                           {fixWithHeading("a", HeadingKind::body, kPi - 0.3, 0.3),
                            fixWithHeading("b", HeadingKind::body, -kPi + 0.1, 0.4), fixAt("c", 0, 1)},
                           GateOptions());
  EXPECT_EQ(result.fused->heading, HeadingKind::body);
  EXPECT_NEAR(result.fused->heading_rad, kPi - 0.1, kRounding);
  EXPECT_NEAR(result.fused->heading_sigma_rad, 0.25, kRounding);  // sqrt((0.15)^2 + (0.2)^2)
  EXPECT_NEAR(result.fused->p_map_m.x(), 2.0 / 3, kRounding);
}

TEST(BayesGate, CoursesAmongBodyHeadingsBecomeBodyHeadings) {
  CarState predicted = atOrigin();
  predicted.mean(3) = 0.2;
  predicted.covariance(3, 3) = 0.16;
  const auto mixed = gate(
      predicted,
      {fixWithHeading("a", HeadingKind::body, 0.1, 0.6), fixWithHeading("b", HeadingKind::course, 0.5, 0.3)},
      GateOptions());
  EXPECT_EQ(mixed.fused->heading, HeadingKind::body);
  EXPECT_NEAR(mixed.fused->heading_rad, 0.2, kRounding);  // of 0.1 and 0.5 - 0.2
  EXPECT_NEAR(mixed.fused->heading_sigma_rad, std::hypot(0.3, 0.25),
              kRounding);  // 0.6/2, sqrt(0.3^2 + 0.4^2)/2
  const auto courses = gate(predicted,
                            {fixWithHeading("a", HeadingKind::course, 0.1, 0.6),
                             fixWithHeading("b", HeadingKind::course, 0.5, 0.3)},
                            GateOptions());
  EXPECT_EQ(courses.fused->heading, HeadingKind::course);
  EXPECT_NEAR(courses.fused->heading_rad, 0.3, kRounding);
}

TEST(BayesGate, HeadingsThatContradictEachOtherAreLeftOut) {
  const auto result =
      gate(atOrigin(),
           {fixWithHeading("a", HeadingKind::body, 0, 0.1), fixWithHeading("b", HeadingKind::body, kPi, 0.1)},
           GateOptions());
  EXPECT_EQ(result.fused->heading, HeadingKind::none);
}

TEST(BayesGate, RefusesWhatTheBoundaryShouldHaveScreened) {
  const double nan = std::numeric_limits<double>::quiet_NaN(), inf = std::numeric_limits<double>::infinity();
  const auto refuses = [](const std::vector<PoseFix>& fixes) {
    EXPECT_THROW((void)gate(atOrigin(), fixes, GateOptions()), std::invalid_argument);
  };
  refuses({});
  refuses({fixAt("a", 0, 0), fixAt("a", 1, 0)});
  refuses({fixAt("a", nan, 0)});
  refuses({fixAt("a", 0, inf)});
  refuses({fixAt("a", 0, 0, 0)});
  refuses({fixAt("a", 0, 0, inf)});
  refuses({fixWithHeading("a", HeadingKind::body, nan, 1)});
  refuses({fixWithHeading("a", HeadingKind::body, 0, 0)});
  refuses({fixWithHeading("a", HeadingKind::course, 0, nan)});
  PoseFix fix = fixAt("a", 0, 0);
  fix.cov_p_m2 << 1, 2, 2, 1;
  refuses({fix});
  fix.cov_p_m2 << 1, 0.5, 0, 1;
  refuses({fix});
  fix.cov_p_m2 << -1, 0, 0, -1;
  refuses({fix});
}

TEST(BayesGate, WeightsOfSourcesAtDistanceZeroAreEqual) {
  EXPECT_THAT(blendWeights({0, 0, 0, 0}), ElementsAre(0.25, 0.25, 0.25, 0.25));
  EXPECT_THAT(blendWeights({0}), ElementsAre(1));
  EXPECT_THAT(blendWeights({7}), ElementsAre(1));
  EXPECT_THAT(blendWeights({1, 3}), ElementsAre(DoubleNear(0.75, kRounding), DoubleNear(0.25, kRounding)));
}

TEST(BayesGate, ProbabilityIsTheSigmoid) {
  EXPECT_EQ(conditionalProbability(0), 0.5);
  EXPECT_NEAR(conditionalProbability(std::log(3)), 0.25, kRounding);
  EXPECT_GT(conditionalProbability(700), 0);
}

TEST(ChiSquare, LimitsAreThoseOfTheTables) {  // printed to three decimals
  EXPECT_NEAR(chiSquareLimit(0.01, 2), 9.210, 5e-4);
  EXPECT_NEAR(chiSquareLimit(0.05, 2), 5.991, 5e-4);
  EXPECT_NEAR(chiSquareLimit(0.01, 3), 11.345, 5e-4);
  EXPECT_NEAR(chiSquareLimit(0.05, 3), 7.815, 5e-4);
  EXPECT_NEAR(chiSquareLimit(0.001, 3), 16.266, 5e-4);
  EXPECT_NEAR(chiSquareLimit(0.90, 3), 0.584, 5e-4);
  EXPECT_EQ(chiSquareLimit(1, 2), 0);
  EXPECT_EQ(chiSquareLimit(1, 3), 0);
}

TEST(ChiSquare, RefusesWhatHasNoLimit) {
  EXPECT_THROW((void)chiSquareLimit(0, 2), std::invalid_argument);
  EXPECT_THROW((void)chiSquareLimit(1.1, 2), std::invalid_argument);
  EXPECT_THROW((void)chiSquareLimit(std::nan(""), 3), std::invalid_argument);
  EXPECT_THROW((void)chiSquareLimit(0.1, 4), std::invalid_argument);
}

TEST(FusionFilter, StartsWhereItIsTold) {
  FusionOptions options;
  options.start_position_sigma_m = 2;
  options.start_heading_sigma_rad = 0.5;
  options.bias_sigma_rad = 0.1;
  const FusionFilter filter(startState({3, 4}, kPi + 1, options), options, GateOptions());
  const CarState state = filter.state();
  EXPECT_TRUE(state.mean.isApprox(Eigen::Vector4d(3, 4, 1 - kPi, 0), kRounding));
  EXPECT_TRUE(
      state.covariance.isApprox(Eigen::Vector4d(4, 4, 0.25, 0.01).asDiagonal().toDenseMatrix(), kRounding));
}

TEST(FusionFilter, DrivesAStraightAndAQuarterTurn) {
  FusionFilter filter(startState({0, 0}, 0, {}), {}, {});
  filter.predict(2, 10, 0);
  EXPECT_TRUE(filter.state().mean.isApprox(Eigen::Vector4d(20, 0, 0, 0), kRounding));
  for (int i = 0; i < 1000; ++i) filter.predict(0.001, 10, kPi / 2);
  // Radius v / w; the chord of a step is too long by (w T)^2 / 24 = 1e-7 of it.
  const double radius_m = 10 / (kPi / 2);
  EXPECT_NEAR(filter.state().mean(0), 20 + radius_m, 2e-6);
  EXPECT_NEAR(filter.state().mean(1), radius_m, 2e-6);
  EXPECT_NEAR(filter.state().mean(2), kPi / 2, 1e-9);
}

TEST(FusionFilter, DrivesAlongTheCourseAndForgetsIt) {
  FusionOptions options;
  options.bias_time_s = 2;
  FusionFilter filter({{0, 0, 0.3, 0.2}, Eigen::Matrix4d::Identity()}, options, {});
  filter.predict(1, 4, 0);
  const Eigen::Vector4d expected(4 * std::cos(0.5), 4 * std::sin(0.5), 0.3, 0.2 * std::exp(-0.5));
  EXPECT_TRUE(filter.state().mean.isApprox(expected, kRounding));
}

TEST(FusionFilter, TheVarianceOfTheBiasStopsAtItsStationaryValue) {
  FusionOptions options;
  options.bias_sigma_rad = 0.05;
  options.bias_time_s = 10;
  for (const double start_variance : {0.0, 1.0}) {
    Eigen::Matrix4d P = Eigen::Matrix4d::Identity();
    P(3, 3) = start_variance;
    FusionFilter filter({Eigen::Vector4d::Zero(), P}, options, {});
    filter.predict(5, 10, 0);
    EXPECT_NEAR(filter.state().covariance(3, 3), 0.0025 + (start_variance - 0.0025) * std::exp(-1.0),
                kRounding);
    filter.predict(1000, 10, 0);
    EXPECT_NEAR(filter.state().covariance(3, 3), 0.0025, kRounding);
  }
}

TEST(FusionFilter, ACourseTellsOfTheBiasWhatIsKnownOfTheHeading) {
  // theta known to 0.01, b to 0.1, course measured to 0.02: one scalar update on b with noise 0.01^2 +
  // 0.02^2.
  const Eigen::Vector4d variance(1, 1, 1e-4, 1e-2);
  FusionFilter filter({Eigen::Vector4d::Zero(), variance.asDiagonal().toDenseMatrix()}, {}, {});
  filter.correct({fixWithHeading("gps", HeadingKind::course, 0.06, 0.02, 0)});
  const double S = 1e-2 + 1e-4 + 4e-4;
  EXPECT_NEAR(filter.state().mean(3), 0.06 * 1e-2 / S, kRounding);
  EXPECT_NEAR(filter.state().mean(2), 0.06 * 1e-4 / S, kRounding);
  EXPECT_NEAR(filter.state().covariance(3, 3), 1e-2 - 1e-4 / S, kRounding);
}

TEST(FusionFilter, ABodyHeadingLeavesTheBiasAlone) {
  FusionFilter filter(startState({0, 0}, 0, {}), {}, {});
  const double variance_before = filter.state().covariance(3, 3);
  filter.correct({fixWithHeading("ins", HeadingKind::body, 0.06, 0.02, 0)});
  EXPECT_EQ(filter.state().mean(3), 0);
  EXPECT_EQ(filter.state().covariance(3, 3), variance_before);
}

TEST(FusionFilter, CorrectsAcrossTheCutOfTheAngle) {
  FusionFilter filter({{0, 0, kPi - 0.1, 0}, Eigen::Matrix4d::Identity()}, {}, {});
  filter.correct({fixWithHeading("ins", HeadingKind::body, -kPi + 0.3, 1, 0)});
  EXPECT_NEAR(filter.state().mean(2), -kPi + 0.1, kRounding);  // half way of 0.4, over the cut
}

TEST(FusionFilter, RejectedSourcesChangeNothing) {
  FusionFilter filter(startState({0, 0}, 0, {}), {}, {});
  const CarState before = filter.state();
  const GateDecision decision = filter.correct({fixAt("gps", 20, 0)});
  EXPECT_TRUE(decision.alarm);
  EXPECT_EQ(filter.state().mean, before.mean);
  EXPECT_EQ(filter.state().covariance, before.covariance);
}

TEST(FusionFilter, RefusesAStateOrMotionThatIsNone) {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  FusionFilter filter(startState({0, 0}, 0, {}), {}, {});
  const CarState before = filter.state();
  EXPECT_THROW(filter.predict(-0.1, 1, 0), std::invalid_argument);
  EXPECT_THROW(filter.predict(nan, 1, 0), std::invalid_argument);
  EXPECT_THROW(filter.predict(0.1, nan, 0), std::invalid_argument);
  EXPECT_THROW(filter.predict(0.1, 1, nan), std::invalid_argument);
  EXPECT_THROW(filter.correct({fixAt("gps", nan, 0)}), std::invalid_argument);
  EXPECT_EQ(filter.state().mean, before.mean);
  EXPECT_EQ(filter.state().covariance, before.covariance);

  const auto refuses = [](const CarState& start) {
    EXPECT_THROW(FusionFilter(start, {}, {}), std::invalid_argument);
  };
  refuses(startState({nan, 0}, 0, {}));
  refuses({Eigen::Vector4d::Zero(), -Eigen::Matrix4d::Identity()});
  Eigen::Matrix4d lopsided = Eigen::Matrix4d::Identity();
  lopsided(0, 1) = 0.1;
  refuses({Eigen::Vector4d::Zero(), lopsided});
}

TEST(FusionFilter, RefusesAGateWhoseLimitsAreCrossed) {
  const auto messageOf = [](const GateOptions& options) -> std::string {
    try {
      const FusionFilter filter(startState({0, 0}, 0, {}), {}, options);
    } catch (const InputError& error) {
      return error.what();
    }
    return "";
  };
  GateOptions options;
  options.epsilon_m = 6;
  EXPECT_THAT(messageOf(options), HasSubstr("[gate]: epsilon_m"));
  options = {};
  options.epsilon_false_alarm = 1e-6;
  EXPECT_THAT(messageOf(options), HasSubstr("[gate]: delta_false_alarm"));
  EXPECT_EQ(messageOf({}), "");
}

TEST(FusionOptions, EveryKeyIsListed) {
  const std::string text = iniText("gate", GateOptions()) + iniText("fusion", FusionOptions());
  for (const char* key : {"metric", "epsilon_m", "delta_m", "epsilon_false_alarm", "delta_false_alarm",
                          "primary_order", "speed_sigma_mps", "yaw_rate_sigma_rps", "bias_sigma_rad",
                          "bias_time_s", "start_position_sigma_m", "start_heading_sigma_rad"})
    EXPECT_THAT(text, HasSubstr("\n" + std::string(key) + " = "));
}

}  // namespace
}  // namespace raceloc
