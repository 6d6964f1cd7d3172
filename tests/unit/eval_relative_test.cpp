#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "eval/breakdown.h"
#include "eval/relative_errors.h"
#include "support/trajectories.h"

namespace raceloc::test {
namespace {

using ::testing::ElementsAre;
using ::testing::IsEmpty;
using ::testing::SizeIs;

TEST(Drift, OfOnePercentScaleIsOnePercent) {
  auto estimate = straight("estimate");
  for (auto& pose : estimate.trajectory.poses) pose.T_map_body.translation() *= 1.01;
  EvalOptions options;
  options.segment_lengths_m = {20, 33.5, 100, 101};  // 33.5 m is no multiple of the metre between poses
  const Evaluation e = evaluate(straight("truth"), estimate, options);
  ASSERT_THAT(e.relative, SizeIs(4));
  for (std::size_t i = 0; i < 3; ++i) {
    EXPECT_NEAR(e.relative[i].translation_percent, 1, 1e-9) << e.relative[i].length_m;
    EXPECT_NEAR(e.relative[i].rotation_deg_per_m, 0, 1e-9);
  }
  EXPECT_EQ(e.relative[3].segments, 0U);  // longer than the path
}

TEST(Drift, OfAYawRateIsThatRate) {
  const double rad_per_m = 0.002;
  const auto turning = [&](double t_s) {
    StampedPose pose = onStraight(t_s);
    pose.T_map_body.linear() = poseFromRpy({0, 0, 0}, 0, 0, rad_per_m * 10 * t_s).linear();
    return pose;
  };
  const Evaluation e = evaluate(straight("truth"), sampled("estimate", 0, 10, 0.1, turning), {});
  for (const auto& relative : e.relative)
    EXPECT_NEAR(relative.rotation_deg_per_m, rad_per_m * 180 / M_PI, 1e-9) << relative.length_m;
}

TEST(Drift, CountsEverySegmentThatFits) {
  EvalOptions options;
  options.segment_lengths_m = {19, 79};  // poses are 2 m apart: reached after 20 and 80 of 100 m
  const auto poses = sampled("file", 0, 10, 0.2, onStraight);
  const Evaluation e = evaluate(poses, poses, options);
  ASSERT_THAT(e.relative, SizeIs(2));
  EXPECT_EQ(e.relative[0].segments, 41U);
  EXPECT_EQ(e.relative[1].segments, 11U);
}

Evaluation withSteps(const TrajectoryFile& truth, const TrajectoryFile& estimate,
                     std::vector<RpeStep> steps) {
  EvalOptions options;
  options.rpe_steps = std::move(steps);
  return evaluate(truth, estimate, options);
}

constexpr RpeStep kOneSecond{RpeStep::Unit::seconds, 1}, kTenMetres{RpeStep::Unit::metres, 10};

TEST(Rpe, OfAnOffsetIsZero) {
  const auto off = moved(straight("e"), poseFromRpy({3, -4, 1}, 0, 0, 0));
  for (const RelativePoseError& rpe : withSteps(straight("t"), off, {kOneSecond, kTenMetres}).rpe) {
    EXPECT_EQ(rpe.pairs, 10U);
    EXPECT_NEAR(rpe.translation_m.max, 0, kRounding_m);
    EXPECT_NEAR(rpe.rotation_deg.max, 0, 1e-6);  // acos-free, but the quaternion of the identity to 1e-8 rad
  }
}

TEST(Rpe, OfOnePercentScaleIsOnePercentOfTheStep) {
  auto estimate = straight("e");
  for (auto& pose : estimate.trajectory.poses) pose.T_map_body.translation() *= 1.01;
  const Evaluation e = withSteps(straight("t"), estimate, {kOneSecond, {RpeStep::Unit::metres, 25}});
  EXPECT_NEAR(e.rpe[0].translation_m.rmse, 0.1, kRounding_m);  // 10 m/s: 10 m a step
  EXPECT_NEAR(e.rpe[0].translation_m.std, 0, kRounding_m);
  EXPECT_EQ(e.rpe[1].pairs, 4U);
  EXPECT_NEAR(e.rpe[1].translation_m.mean, 0.25, kRounding_m);
}

TEST(Rpe, OfOneJumpIsInOneStepOnly) {
  auto estimate = straight("e");  // from 4.5 s on, 0.3 m to the left: in the step from 4 to 5 s
  for (auto& pose : estimate.trajectory.poses)
    if (pose.stamp_s > 4.45) pose.T_map_body.translation().y() += 0.3;
  const Evaluation e = withSteps(straight("t"), estimate, {kOneSecond});
  EXPECT_EQ(e.rpe[0].pairs, 10U);
  EXPECT_NEAR(e.rpe[0].translation_m.max, 0.3, kRounding_m);
  EXPECT_NEAR(e.rpe[0].translation_m.mean, 0.03, kRounding_m);
  EXPECT_NEAR(e.rpe[0].translation_m.rmse, 0.3 / std::sqrt(10), kRounding_m);
  EXPECT_NEAR(e.rpe[0].translation_m.median, 0, kRounding_m);
}

TEST(Rpe, StepsEndAtTheFirstPoseThatIsFarEnough) {
  const auto sparse = sampled("file", 0, 9.9, 0.3, onStraight);  // 34 poses: 1 s takes four intervals, 1.2 s
  EXPECT_EQ(withSteps(sparse, sparse, {kOneSecond}).rpe[0].pairs, 8U);
  EXPECT_EQ(withSteps(sparse, sparse, {{RpeStep::Unit::seconds, 100}}).rpe[0].pairs, 0U);
}

TEST(Laps, EndWhereTheTruthComesByItsStart) {
  const auto circle = sampled("c", 0, 80, 0.1, [](double t_s) { return onCircle(t_s); });
  const Evaluation e = evaluate(circle, circle, {});
  const double lap_m = 2 * M_PI * 50;  // to a pose, 1 m
  ASSERT_THAT(e.lap_starts_m, SizeIs(3));
  EXPECT_NEAR(e.lap_starts_m[1], lap_m, 0.6);
  EXPECT_NEAR(e.lap_starts_m[2], 2 * lap_m, 0.6);
  EXPECT_THAT(e.by_lap, SizeIs(3));
  EXPECT_NEAR(static_cast<double>(e.by_lap[0].poses), lap_m, 1.01);
}

TEST(Laps, AreNotFoundOnAStraightOrOnTheWayBack) {
  EXPECT_THAT(lapStarts(evaluate(straight("t"), straight("e"), {}).poses), ElementsAre(0.0));
  const auto there_and_back = sampled("b", 0, 40, 0.1, [](double t_s) {
    const bool is_back = t_s > 20;  // past the start again, but the other way
    return StampedPose{t_s,
                       poseFromRpy({is_back ? 400 - 10 * t_s : 10 * t_s, 0, 0}, 0, 0, is_back ? M_PI : 0)};
  });
  const Evaluation e = evaluate(there_and_back, there_and_back, {});
  EXPECT_THAT(e.lap_starts_m, ElementsAre(0.0));
  EXPECT_THAT(e.by_lap, IsEmpty());
}

TEST(Sectors, HoldTheErrorsOfTheirPartOfTheWay) {
  auto estimate = straight("e");  // 100 m; 0.2 m to the left in the second half
  for (auto& pose : estimate.trajectory.poses)
    if (pose.stamp_s > 5.05) pose.T_map_body.translation().y() += 0.2;
  EvalOptions options;
  options.sectors = 2;
  const Evaluation e = evaluate(straight("t"), estimate, options);
  ASSERT_THAT(e.by_sector, SizeIs(2));
  EXPECT_EQ(e.by_sector[0].poses + e.by_sector[1].poses, 101U);
  EXPECT_NEAR(e.by_sector[0].lateral_rmse_m, 0, kRounding_m);
  EXPECT_NEAR(e.by_sector[1].plane_max_m, 0.2, kRounding_m);
  EXPECT_NEAR(e.by_sector[1].longitudinal_rmse_m, 0, kRounding_m);
  const auto n = static_cast<double>(e.by_sector[1].poses);  // 50 or 51: the pose at 50 m is good
  EXPECT_NEAR(e.by_sector[1].lateral_rmse_m, 0.2 * std::sqrt(50 / n), kRounding_m);
}

TEST(Sectors, OfALapGatherAllLaps) {
  EvalOptions options;
  options.sectors = 4;
  // Two laps and a bit; the error is 0.1 m on the first quarter of the second lap only.
  const auto bad_quarter = [](double t_s) {
    const double lap_s = 10 * M_PI;
    return onCircle(t_s, t_s > lap_s + 0.5 && t_s < 1.25 * lap_s - 0.5 ? 0.1 : 0);
  };
  const Evaluation e = evaluate(sampled("t", 0, 66, 0.1, [](double t_s) { return onCircle(t_s); }),
                                sampled("e", 0, 66, 0.1, bad_quarter), options);
  ASSERT_THAT(e.by_sector, SizeIs(4));
  EXPECT_NEAR(e.by_sector[0].plane_max_m, 0.1, kRounding_m);
  for (std::size_t k = 1; k < 4; ++k) EXPECT_NEAR(e.by_sector[k].plane_max_m, 0, kRounding_m) << k;
}

TEST(Speeds, AreSortedIntoTheirBins) {
  // 5 m/s for 10 s, then 25 m/s; ahead by 0.5 m when fast.
  const auto at = [](double t_s, double ahead_m) {
    const double x_m = t_s < 10 ? 5 * t_s : 50 + 25 * (t_s - 10);
    return StampedPose{t_s, poseFromRpy({x_m + (t_s > 10.05 ? ahead_m : 0), 0, 0}, 0, 0, 0)};
  };
  const Evaluation e = evaluate(sampled("t", 0, 20, 0.1, [&](double t_s) { return at(t_s, 0); }),
                                sampled("e", 0, 20, 0.1, [&](double t_s) { return at(t_s, 0.5); }), {});
  ASSERT_THAT(e.by_speed, SizeIs(3));  // and one pose in between, at 15 m/s
  EXPECT_EQ(e.by_speed[0].name, "0 .. 10 m/s");
  EXPECT_EQ(e.by_speed[0].poses, 100U);
  EXPECT_EQ(e.by_speed[1].poses, 1U);
  EXPECT_EQ(e.by_speed[2].poses, 100U);
  EXPECT_NEAR(e.by_speed[0].longitudinal_rmse_m, 0, kRounding_m);
  EXPECT_NEAR(e.by_speed[2].longitudinal_rmse_m, 0.5, kRounding_m);
}

}  // namespace
}  // namespace raceloc::test
