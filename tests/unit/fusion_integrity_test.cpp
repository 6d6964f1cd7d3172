/** \file
 * What an estimate is worth, worked out by hand. */
#include <gmock/gmock.h>

#include "fusion/integrity.h"
#include "fusion/recovery.h"

namespace raceloc {
namespace {

using ::testing::HasSubstr;

/** Heading north: the car's left is the map's west. Sigmas 0.1 m east, 0.2 m north, 0.01 rad. */
EstimatorState heldBy(const std::vector<std::string>& sources) {
  const Eigen::Vector4d variance(0.01, 0.04, 1e-4, 1e-4);
  EstimatorState state = beginAt(10, {{0, 0, M_PI / 2, 0}, variance.asDiagonal()});
  for (const auto& source : sources) {
    SourceRecord record{};
    record.source = source;
    record.stamp_s = 10;
    record.residual_m = record.own_residual_m = record.mean_m = Eigen::Vector2d::Zero();
    record.cov_m2 = 0.01 * Eigen::Matrix2d::Identity();
    record.contradiction = record.noise = record.scatter = 1;
    record.confirms = true;
    state.records.push_back(record);
  }
  return state;
}
Integrity assessed(const EstimatorState& state, std::optional<double> gap_m = 5.0) {
  return assess(state, gap_m, {}, {});
}

TEST(Integrity, TwoSourcesThatConfirmAreOk) {
  const Integrity i = assessed(heldBy({"gps_left", "scan_match"}));
  EXPECT_EQ(i.state, LocalizationState::ok);
  EXPECT_EQ(i.cause, "");
  EXPECT_NEAR(i.protection.lateral_m, 5 * 0.1, 1e-12);
  EXPECT_NEAR(i.protection.longitudinal_m, 5 * 0.2, 1e-12);
  EXPECT_NEAR(i.protection.heading_rad, 5 * 0.01, 1e-12);
  EXPECT_NEAR(i.alert_limit_m, 5 - 1, 1e-12);
}

TEST(Integrity, WhatConfirmingSourcesAreOffWidensTheLevels) {
  EstimatorState state = heldBy({"gps_left", "scan_match"});
  state.records[0].mean_m = {0.07, -0.03};
  state.records[1].mean_m = {-0.02, 0.05};
  const Integrity i = assessed(state);
  EXPECT_NEAR(i.protection.lateral_m, 5 * 0.1 + 0.07, 1e-12);
  EXPECT_NEAR(i.protection.longitudinal_m, 5 * 0.2 + 0.05, 1e-12);
}

TEST(Integrity, TheWayWithoutASourceWidensTheLevels) {
  EstimatorState state = heldBy({"gps_left", "scan_match"});
  state.alone_m = 70;
  const Integrity i = assessed(state);
  EXPECT_NEAR(i.protection.lateral_m, 5 * 0.1 + 0.7, 1e-12);
  EXPECT_NEAR(i.protection.longitudinal_m, 5 * 0.2 + 0.7, 1e-12);
}

TEST(Integrity, EachStateHasItsCauseWithFigureAndLimit) {
  EXPECT_EQ(assessed(heldBy({"gps_left"})).state, LocalizationState::degraded);

  EstimatorState left = heldBy({"gps_left", "gps_right", "scan_match"});
  left.records[1].left = true;
  left.records[1].left_by_m = 3;
  left.records[1].left_limit_m = 0.5;
  const Integrity drifting = assessed(left);
  EXPECT_EQ(drifting.state, LocalizationState::degraded);
  EXPECT_THAT(drifting.cause, HasSubstr("gps_right left the others"));
  EXPECT_EQ(drifting.measured, 3);
  EXPECT_EQ(drifting.limit, 0.5);

  EstimatorState odd = heldBy({"gps_left", "gps_right", "scan_match"});
  odd.records[0].confirms = odd.records[0].supported = false;
  EXPECT_EQ(assessed(odd).state, LocalizationState::degraded);
  EXPECT_THAT(assessed(odd).cause, HasSubstr("gps_left agrees neither with another source"));

  EstimatorState silent = heldBy({"gps_left", "gps_right", "scan_match"});
  silent.records[2].stamp_s = 9.2;
  EXPECT_THAT(assessed(silent).cause, HasSubstr("scan_match is silent"));
  EXPECT_NEAR(assessed(silent).measured, 0.8, 1e-12);

  EstimatorState alone = heldBy({"gps_left", "gps_right"});
  alone.confirmed_s = 9.5;
  EXPECT_EQ(assessed(alone).state, LocalizationState::dead_reckoning);
  EXPECT_NEAR(assessed(alone).measured, 0.5, 1e-12);
}

TEST(Integrity, AnErrorThatMayReachTheWallIsLost) {
  const EstimatorState state = heldBy({"gps_left", "scan_match"});
  EXPECT_EQ(assessed(state, 1.6).state, LocalizationState::ok);
  const Integrity i = assessed(state, 1.4);  // 0.4 m beside the car, 0.5 m protected
  EXPECT_EQ(i.state, LocalizationState::lost);
  EXPECT_NEAR(i.measured, 0.5, 1e-12);
  EXPECT_NEAR(i.limit, 0.4, 1e-12);
  EXPECT_EQ(assessed(state, std::nullopt).alert_limit_m, IntegrityOptions{}.alert_limit_m);
  EXPECT_EQ(assessed(state, 0.5).alert_limit_m, 0);
}

TEST(Separation, IsInSigmasOfWhatClaimsAndTheOptionAllow) {
  const ReliabilityOptions options;  // 0.5 m are 3 sigmas of sources that claim to be perfect
  const Eigen::Matrix2d perfect = Eigen::Matrix2d::Zero();
  EXPECT_NEAR(separation({0.3, -0.4}, perfect, options), 3, 1e-12);
  Eigen::Matrix2d weak_along_x = perfect;
  weak_along_x(0, 0) = 100 - 0.25 / 9;  // 10 m, with the option's share
  EXPECT_NEAR(separation({5, 0}, weak_along_x, options), 0.5, 1e-12);
  EXPECT_NEAR(separation({0, 0.5}, weak_along_x, options), 3, 1e-12);
}

TEST(ContradictionByAll, IsTheMeanOfThoseThatAreOffAlike) {
  EstimatorState state = heldBy({"a", "b"});
  auto& records = state.records;
  const auto put = [&](SourceRecord& record, const Eigen::Vector2d& off_m, double nis) {
    record.own_residual_m = off_m;
    record.nis = nis;
  };
  put(records[0], {0.4, 0}, 8);
  put(records[1], {0.5, 0.1}, 16);
  EXPECT_EQ(contradictionByAll(records, 10, {}), (4 + 8) / 2.0);
  put(records[1], {0.1, 0.1}, 0.4);
  EXPECT_EQ(contradictionByAll(records, 10, {}), 1) << "one of them is near the estimate";
  put(records[1], {-0.4, 0}, 16);
  EXPECT_EQ(contradictionByAll(records, 10, {}), 1) << "they contradict each other as well";
  put(records[1], {0.5, 0.1}, 16);
  for (const auto& spoil : std::vector<void (*)(SourceRecord&)>{
           [](SourceRecord& r) { r.left = true; }, [](SourceRecord& r) { r.leapt = true; },
           [](SourceRecord& r) { r.scatter = 2 * kMostScatter; }, [](SourceRecord& r) { r.stamp_s = 9; }}) {
    EstimatorState one = state;
    spoil(one.records[1]);
    EXPECT_EQ(contradictionByAll(one.records, 10, {}), 1) << "one alone";
  }
}

TEST(TwoKeys, AreThePairOfFreshSourcesThatAgreesBest) {
  EstimatorState state = heldBy({"a", "b", "c", "d"});
  auto& records = state.records;
  for (std::size_t i = 0; i < records.size(); ++i)
    records[i].own_residual_m = {20.0 * static_cast<double>(i), 0};
  EXPECT_FALSE(twoKeys(records, 10, {}));

  records[3].own_residual_m = records[1].own_residual_m + Eigen::Vector2d(0.3, 0);
  auto keys = twoKeys(records, 10, {});
  ASSERT_TRUE(keys);
  EXPECT_EQ(keys->first, 1);
  EXPECT_EQ(keys->second, 3);

  records[2].own_residual_m = records[1].own_residual_m + Eigen::Vector2d(0.2, 0);
  keys = twoKeys(records, 10, {});  // 2 is nearest to 3
  ASSERT_TRUE(keys);
  EXPECT_EQ(keys->first, 2);
  EXPECT_EQ(keys->second, 3);

  records[2].stamp_s = 9.4;  // silent for longer than fresh_s
  keys = twoKeys(records, 10, {});
  ASSERT_TRUE(keys);
  EXPECT_EQ(keys->first, 1);

  records[1].stamp_s = 9.9;  // and what has run away since is brought to one time
  records[1].rate_mps = {10, 0};
  EXPECT_FALSE(twoKeys(records, 10, {}));
}

}  // namespace
}  // namespace raceloc
