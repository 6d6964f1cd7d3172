#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "eval/trajectory_errors.h"
#include "support/forall.h"

namespace raceloc::test {
namespace {

/** A drive over some 200 m with bends, hills and an uneven clock. */
TrajectoryFile drive(Random& rnd) {
  TrajectoryFile file{"drive", 0, {}};
  Pose T = rnd.pose(1, 100);
  double stamp_s = 1e6;
  for (int i = 0; i < 200; ++i) {
    file.trajectory.poses.push_back({stamp_s, T});
    stamp_s += rnd.uniform(0.05, 0.15);
    Vector6d step;
    step << rnd.vectorWithin(0.05), rnd.uniform(0.5, 1.5), 0, 0;
    T = T * se3Exp(step);
  }
  return file;
}

TrajectoryFile moved(TrajectoryFile file, const Pose& T) {
  for (auto& pose : file.trajectory.poses) pose.T_map_body = T * pose.T_map_body;
  return file;
}

TrajectoryFile noisy(TrajectoryFile file, Random& rnd) {
  for (auto& pose : file.trajectory.poses) pose.T_map_body = pose.T_map_body * rnd.pose(0.05, 0.5);
  return file;
}

constexpr double kRounding = 1e-9;  // double at 1 km, [m] and [deg]

void expectSame(const Statistics& a, const Statistics& b, double tolerance) {
  EXPECT_NEAR(a.rmse, b.rmse, tolerance);
  EXPECT_NEAR(a.mean, b.mean, tolerance);
  EXPECT_NEAR(a.median, b.median, tolerance);
  EXPECT_NEAR(a.std, b.std, tolerance);
  EXPECT_NEAR(a.max, b.max, tolerance);
}

TEST(EvalProperty, ARigidMoveOfBothChangesNoDistanceAndNoDrift) {
  forAll(50, [](Random& rnd) {
    const auto truth = drive(rnd);
    const auto estimate = noisy(truth, rnd);
    const Pose T = rnd.pose(M_PI, 1000);
    const Evaluation before = evaluate(truth, estimate, {});
    const Evaluation after = evaluate(moved(truth, T), moved(estimate, T), {});
    expectSame(before.position_3d_m, after.position_3d_m, kRounding);
    for (std::size_t i = 0; i < before.relative.size(); ++i) {
      EXPECT_EQ(before.relative[i].segments, after.relative[i].segments);
      EXPECT_NEAR(before.relative[i].translation_percent, after.relative[i].translation_percent, kRounding);
      EXPECT_NEAR(before.relative[i].rotation_deg_per_m, after.relative[i].rotation_deg_per_m, kRounding);
    }
  });
}

TEST(EvalProperty, ATurnAboutTheVerticalChangesNoErrorAtAll) {
  forAll(50, [](Random& rnd) {
    const auto truth = drive(rnd);
    const auto estimate = noisy(truth, rnd);
    const Pose T = poseFromRpy(rnd.vectorWithin(1000), 0, 0, rnd.uniform(-M_PI, M_PI));
    const Evaluation before = evaluate(truth, estimate, {});
    const Evaluation after = evaluate(moved(truth, T), moved(estimate, T), {});
    expectSame(before.lateral_m, after.lateral_m, kRounding);
    expectSame(before.longitudinal_m, after.longitudinal_m, kRounding);
    expectSame(before.height_m, after.height_m, kRounding);
    expectSame(before.heading_deg, after.heading_deg, kRounding);
  });
}

TEST(EvalProperty, AlignmentUndoesARigidMove) {
  forAll(50, [](Random& rnd) {
    const auto truth = drive(rnd);
    const Pose T = rnd.pose(M_PI, 1000);
    EvalOptions options;
    options.align = Alignment::se3;
    const Evaluation e = evaluate(truth, moved(truth, T), options);
    EXPECT_NEAR(e.position_3d_m.max, 0, kRounding);
    EXPECT_NEAR(e.heading_deg.max, 0,
                1e-6);  // the turn follows from positions known to 1e-12 of 1 km, over 1 deg
    EXPECT_TRUE((e.T_map_estimate_frame * T).isApprox(Pose::Identity(), kRounding));
  });
}

TEST(EvalProperty, AlignedAxesUndoAConstantTurnOfTheBodyToo) {
  forAll(50, [](Random& rnd) {
    const auto truth = drive(rnd);
    Pose mount = Pose::Identity();
    mount.linear() = rnd.pose(1, 0).linear();
    auto estimate = moved(truth, rnd.pose(M_PI, 1000));
    for (auto& pose : estimate.trajectory.poses) pose.T_map_body = pose.T_map_body * mount;
    EvalOptions options;
    options.align = Alignment::se3;
    const Evaluation moved_only = evaluate(truth, estimate, options);
    options.align = Alignment::axes;
    const Evaluation e = evaluate(truth, estimate, options);
    constexpr double kTurn = 1e-6;  // as above
    EXPECT_TRUE((mount.linear() * e.R_estimate_truth_body).isIdentity(kTurn));
    EXPECT_NEAR(e.heading_deg.max, 0, kTurn / kDegree);
    for (const RelativeError& r : e.relative) EXPECT_NEAR(r.translation_percent, 0, 100 * kTurn);
    expectSame(moved_only.position_3d_m, e.position_3d_m, kRounding);
  });
}

TEST(EvalProperty, AlignmentNeverMakesTheRmseLarger) {
  forAll(50, [](Random& rnd) {
    const auto truth = drive(rnd);
    const auto estimate = noisy(truth, rnd);
    EvalOptions options;
    const double free_m = evaluate(truth, estimate, options).position_3d_m.rmse;
    options.align = Alignment::se3;
    EXPECT_LE(evaluate(truth, estimate, options).position_3d_m.rmse, free_m + kRounding);
  });
}

TEST(EvalProperty, SplitsAddUpToTheDistance) {
  forAll(50, [](Random& rnd) {
    const auto truth = drive(rnd);
    for (const PoseError& p : evaluate(truth, noisy(truth, rnd), {}).poses) {
      EXPECT_NEAR(std::hypot(p.lateral_m, p.longitudinal_m), p.position_plane_m, kRounding);
      EXPECT_NEAR(std::hypot(p.position_plane_m, p.height_m), p.position_3d_m, kRounding);
    }
  });
}

TEST(EvalProperty, StatisticsKeepTheirRelations) {
  forAll(200, [](Random& rnd) {
    std::vector<double> values(static_cast<std::size_t>(rnd.integer(1, 50)));
    for (double& v : values) v = rnd.normal(10);
    const Statistics s = statisticsOf(values);
    EXPECT_NEAR(s.rmse * s.rmse, s.mean * s.mean + s.std * s.std, 1e-9);  // values to 1e3 squared
    EXPECT_LE(s.rmse, s.max + 1e-12);
    std::reverse(values.begin(), values.end());
    EXPECT_EQ(statisticsOf(values).median, s.median);
  });
}

TEST(EvalProperty, EveryEstimatePoseIsCountedOnce) {
  forAll(50, [](Random& rnd) {
    auto truth = drive(rnd);
    auto& poses = truth.trajectory.poses;
    const auto first = poses.begin() + rnd.integer(20, 100);
    poses.erase(first, first + rnd.integer(0, 40));  // up to some 4 s without truth
    auto estimate = drive(rnd);
    const double shift_s = rnd.uniform(-5, 5);
    for (auto& pose : estimate.trajectory.poses) pose.stamp_s += shift_s;
    const Evaluation e = evaluate(truth, estimate, {});
    EXPECT_EQ(e.poses.size() + e.outside_truth + e.in_gaps, estimate.trajectory.poses.size());
    for (std::size_t i = 1; i < e.poses.size(); ++i) EXPECT_LT(e.poses[i - 1].stamp_s, e.poses[i].stamp_s);
  });
}

}  // namespace
}  // namespace raceloc::test
