#include <gtest/gtest.h>

#include "graph/map_graphs.h"
#include "support/forall.h"

namespace raceloc {
namespace {

using test::forAll;
using test::Random;

struct Truth {
  std::vector<Keyframe> keyframes;
  std::vector<Pose> T_map_body;
};

/** A banked, climbing lap of key poses; odometry in its own frame, GPS with a lever arm. */
Truth lap(Random& rnd, double odometry_sigma, double gps_sigma_m, bool with_gps) {
  Truth truth;
  Pose T_odom_body = Pose::Identity();
  const Eigen::Vector3d lever_m(1.2, -0.3, 1.0);
  for (int i = 0; i < 60; ++i) {
    const double angle_rad = 2 * M_PI * i / 60;
    const Pose T =
        poseFromRpy({80 * std::cos(angle_rad), 50 * std::sin(angle_rad), 2 * std::sin(2 * angle_rad)},
                    0.1 * std::sin(angle_rad), 0.05, angle_rad + M_PI / 2);
    BodyMotion motion;
    if (i > 0) {
      motion.duration_s = 0.1;
      Vector6d noise;
      for (int k = 0; k < 6; ++k) noise(k) = rnd.normal(odometry_sigma);
      motion.T_start_end = truth.T_map_body.back().inverse() * T * se3Exp(noise);
      motion.covariance = Matrix6d::Identity() * (odometry_sigma * odometry_sigma + 1e-12);
      T_odom_body = T_odom_body * motion.T_start_end;
    }
    Keyframe k{0.1 * i, T_odom_body, motion};
    k.attitudes.push_back({T.linear(), 1e-6 * Eigen::Matrix3d::Identity()});
    if (with_gps) {
      const Eigen::Vector3d noise_m(rnd.normal(gps_sigma_m), rnd.normal(gps_sigma_m),
                                    rnd.normal(gps_sigma_m));
      k.gps.push_back({"gps", T * lever_m + noise_m,
                       Eigen::Matrix3d::Identity() * std::max(1e-4, gps_sigma_m * gps_sigma_m), lever_m});
    }
    truth.keyframes.push_back(k);
    truth.T_map_body.push_back(T);
  }
  return truth;
}

GraphSolution solved(GraphKind kind, const std::vector<Keyframe>& keyframes,
                     const GraphOptions& options = {}) {
  return solveGraph(kind, keyframes, {}, alignedOdometry(keyframes), options);
}

double worstError_m(const GraphSolution& solution, const std::vector<Pose>& truth) {
  double worst = 0;
  for (std::size_t i = 0; i < truth.size(); ++i)
    worst = std::max(worst, (solution.T_map_body[i].translation() - truth[i].translation()).norm());
  return worst;
}

TEST(MapGraphProperty, WithoutNoiseItFindsTheTruth) {
  forAll(5, [](Random& rnd) {
    const Truth truth = lap(rnd, 0, 0, true);
    // The start is off by the tilt of the first pose (levelled alignment); the solver takes it out to its
    // tolerance.
    EXPECT_LT(worstError_m(solved(GraphKind::joint, truth.keyframes), truth.T_map_body), 1e-3);
  });
}

TEST(MapGraphProperty, GpsTakesTheDriftOutOfTheOdometry) {
  forAll(5, [](Random& rnd) {
    const Truth truth = lap(rnd, 0.02, 0.05, true);
    GraphOptions options;
    options.odometry_sigma_m = 0.02;
    options.odometry_sigma_deg = 1.0;
    const double odometry_error_m = [&] {
      const Pose T_map_odom = truth.T_map_body[0];
      return ((T_map_odom * truth.keyframes.back().T_odom_body).translation() -
              truth.T_map_body.back().translation())
          .norm();
    }();
    const double error_m = worstError_m(solved(GraphKind::joint, truth.keyframes, options), truth.T_map_body);
    EXPECT_LT(error_m, 0.2);  // 4 sigma of one fix
    EXPECT_LT(error_m, odometry_error_m);
  });
}

TEST(MapGraphProperty, ALevelMoveOfAllInputsMovesTheSolution) {
  forAll(5, [](Random& rnd) {
    Truth truth = lap(rnd, 0.01, 0.03, true);
    for (std::size_t i = 0; i < truth.keyframes.size(); i += 2) {  // every other one has no INS
      truth.keyframes[i].attitudes.clear();
      truth.keyframes[i].level =
          KeyLevel{truth.T_map_body[i].linear().transpose() * Eigen::Vector3d::UnitZ(), 0.02};
    }
    const std::vector<LoopEdge> loops{{3, 50, truth.T_map_body[3].inverse() * truth.T_map_body[50],
                                       1e-4 * Matrix6d::Identity(), 0, 1, 2, 0}};
    // Level: a direction that is up must stay up.
    const Pose T_new_map = poseFromRpy(rnd.vectorWithin(1000), 0, 0, rnd.uniform(-3, 3));
    Truth moved = truth;
    for (auto& k : moved.keyframes) {
      k.gps[0].p_map_antenna_m = T_new_map * k.gps[0].p_map_antenna_m;
      k.gps[0].cov_map_m2 = T_new_map.linear() * k.gps[0].cov_map_m2 * T_new_map.linear().transpose();
      for (auto& attitude : k.attitudes) attitude.R_map_body = T_new_map.linear() * attitude.R_map_body;
    }
    const auto start = alignedOdometry(truth.keyframes), moved_start = alignedOdometry(moved.keyframes);
    for (const auto kind : {GraphKind::gps, GraphKind::lidar, GraphKind::joint}) {
      const auto a = solveGraph(kind, truth.keyframes, loops, start, {}),
                 b = solveGraph(kind, moved.keyframes, loops, moved_start, {});
      EXPECT_NEAR(a.cost, b.cost, 1e-8 * a.cost);
      for (std::size_t i = 0; i < a.T_map_body.size(); ++i)  // the solver's tolerance
        EXPECT_TRUE((T_new_map * a.T_map_body[i]).isApprox(b.T_map_body[i], 1e-6)) << i;
    }
  });
}

TEST(MapGraphProperty, OneWildFixDoesNotBendTheMap) {
  Random rnd(12);
  Truth truth = lap(rnd, 0.001, 0.02, true);
  truth.keyframes[30].gps[0].p_map_antenna_m += Eigen::Vector3d(15, -8, 4);
  GraphOptions options;
  options.odometry_sigma_m = 0.005;
  EXPECT_LT(worstError_m(solved(GraphKind::joint, truth.keyframes, options), truth.T_map_body), 0.1);
}

TEST(MapGraph, WithoutGpsTheFirstPoseIsTheOrigin) {
  Random rnd(13);
  Truth truth = lap(rnd, 0, 0, false);
  for (auto& k : truth.keyframes) k.attitudes.clear();
  GraphOptions loose;
  loose.level_sigma_deg = 1000;
  const auto solution = solved(GraphKind::joint, truth.keyframes, loose);
  EXPECT_EQ(solution.T_map_body[0].matrix(), Pose::Identity().matrix());
  EXPECT_EQ(gpsRmse(truth.keyframes, solution.T_map_body), 0);
  EXPECT_TRUE(solution.T_map_body.back().isApprox(truth.keyframes.back().T_odom_body, 1e-3));
}

TEST(MapGraph, WithoutGpsTheGpsGraphHoldsTheFirstPoseToo) {
  Random rnd(14);
  const Truth truth = lap(rnd, 0, 0, false);
  const auto start = alignedOdometry(truth.keyframes);
  EXPECT_EQ(solveGraph(GraphKind::gps, truth.keyframes, {}, start, {}).T_map_body[0].matrix(),
            start[0].matrix());
}

TEST(MapGraphProperty, TheGpsGraphBridgesAnOutageByReckonedMotion) {
  forAll(5, [](Random& rnd) {
    Truth truth = lap(rnd, 0.002, 0.02, true);
    for (std::size_t i = 1; i < truth.keyframes.size(); ++i) {
      Keyframe& k = truth.keyframes[i];
      k.reckoned = k.since_last;
      if (i < 20 || i >= 40) continue;
      k.gps.clear();  // an outage, and a tunnel whose walls look alike everywhere
      k.attitudes.clear();
      k.since_last.T_start_end.translation() *= 0.7;
    }
    // 2 mm a step add up to 1 cm over 20; 2 mrad a step bend some 130 m, held at both ends, by some 0.2 m.
    EXPECT_LT(worstError_m(solved(GraphKind::gps, truth.keyframes), truth.T_map_body), 0.5);
    for (auto& k : truth.keyframes) k.reckoned.reset();
    EXPECT_GT(worstError_m(solved(GraphKind::gps, truth.keyframes), truth.T_map_body), 1.0);
  });
}

/** A straight with a bank of `roll_rad`, one antenna: positions say nothing of the roll. */
Truth straight(Random& rnd, double roll_rad, double level_sigma_rad) {
  Truth truth;
  const Pose T_0 = poseFromRpy(rnd.vectorWithin(100), roll_rad, rnd.uniform(-0.05, 0.05), rnd.uniform(-3, 3));
  const Pose step = Pose(Eigen::Translation3d(2, 0, 0));
  const Eigen::Vector3d lever_m(0, 0, 1.2);
  Pose T_odom_body = Pose::Identity(), T = T_0;
  for (int i = 0; i < 100; ++i) {
    BodyMotion motion;
    if (i > 0) motion = {0.1, step, 1e-8 * Matrix6d::Identity()};
    Keyframe k{0.1 * i, T_odom_body, motion};
    k.gps.push_back({"gps",
                     T * lever_m + Eigen::Vector3d(rnd.normal(0.02), rnd.normal(0.02), rnd.normal(0.02)),
                     4e-4 * Eigen::Matrix3d::Identity(), lever_m});
    const Eigen::Vector3d up = T.linear().transpose() * Eigen::Vector3d::UnitZ();
    const Eigen::Vector3d off(rnd.normal(level_sigma_rad), rnd.normal(level_sigma_rad),
                              rnd.normal(level_sigma_rad));
    k.level = KeyLevel{(up + off).normalized(), level_sigma_rad};
    truth.keyframes.push_back(k);
    truth.T_map_body.push_back(T);
    T = T * step;
    T_odom_body = T_odom_body * step;
  }
  return truth;
}

double meanRoll_rad(const std::vector<Pose>& poses) {
  double sum = 0;
  for (const Pose& T : poses) sum += std::atan2(T.linear()(2, 1), T.linear()(2, 2));
  return sum / static_cast<double>(poses.size());
}

TEST(MapGraphProperty, TheAccelerometersLevelHoldsTheRollOnAStraight) {
  forAll(10, [](Random& rnd) {
    const double roll_rad = rnd.oneOf({-1, 1}) * rnd.uniform(0.1, 0.3);
    Truth truth = straight(rnd, roll_rad, kDegree);
    for (const auto kind : {GraphKind::gps, GraphKind::lidar, GraphKind::joint}) {
      const auto solution = solved(kind, truth.keyframes);
      const double error_rad = meanRoll_rad(solution.T_map_body) - meanRoll_rad(truth.T_map_body);
      EXPECT_LT(std::abs(error_rad), 0.4 * kDegree);  // 4 sigma of the mean of 100 times 1 deg
      if (kind == GraphKind::lidar) continue;
      EXPECT_LT(worstError_m(solution, truth.T_map_body), 0.1);  // 5 sigma of a fix
    }
    for (auto& k : truth.keyframes) k.level.reset();
    const auto unheld = solved(GraphKind::joint, truth.keyframes);
    EXPECT_GT(std::abs(meanRoll_rad(unheld.T_map_body) - roll_rad), 0.05);  // taken for level
  });
}

TEST(MapGraphProperty, TheLidarGraphIsBlindToGps) {
  forAll(5, [](Random& rnd) {
    const Truth truth = lap(rnd, 0.01, 0.02, true);
    Truth other = truth;
    for (auto& k : other.keyframes) {
      if (rnd.oneOf({true, false})) k.gps.clear();
      for (auto& gps : k.gps) gps.p_map_antenna_m += rnd.vectorWithin(50);
      k.attitudes.clear();
    }
    const auto start = alignedOdometry(truth.keyframes);
    const auto a = solveGraph(GraphKind::lidar, truth.keyframes, {}, start, {}),
               b = solveGraph(GraphKind::lidar, other.keyframes, {}, start, {});
    for (std::size_t i = 0; i < start.size(); ++i)
      EXPECT_EQ(a.T_map_body[i].matrix(), b.T_map_body[i].matrix());
  });
}

TEST(MapGraph, RefusesAStartOfAnotherLength) {
  Random rnd(15);
  const Truth truth = lap(rnd, 0, 0, true);
  EXPECT_THROW((void)solveGraph(GraphKind::joint, truth.keyframes, {}, {Pose::Identity()}, {}),
               std::invalid_argument);
}

TEST(MapGraph, RefusesFewerThanTwoKeyPoses) {
  EXPECT_THROW((void)solveGraph(GraphKind::joint, {}, {}, {}, {}), std::invalid_argument);
}

TEST(AlignedOdometryProperty, UndoesALevelMoveDriveByDrive) {
  forAll(10, [](Random& rnd) {
    Truth truth = lap(rnd, 0, 0, true);
    const Truth second = lap(rnd, 0, 0, true);
    const Pose T_new_map = poseFromRpy(rnd.vectorWithin(500), 0, 0, rnd.uniform(-3, 3));
    for (Keyframe k : second.keyframes) {
      for (auto& gps : k.gps) gps.p_map_antenna_m = T_new_map * gps.p_map_antenna_m;
      for (auto& attitude : k.attitudes) attitude.R_map_body = T_new_map.linear() * attitude.R_map_body;
      truth.keyframes.push_back(k);
    }
    for (const Pose& T : second.T_map_body) truth.T_map_body.push_back(T_new_map * T);
    const auto aligned = alignedOdometry(truth.keyframes);
    ASSERT_EQ(aligned.size(), truth.T_map_body.size());
    for (std::size_t i = 0; i < aligned.size(); ++i)  // rounding at 500 m
      EXPECT_TRUE(aligned[i].isApprox(truth.T_map_body[i], 1e-8)) << i;
  });
}

}  // namespace
}  // namespace raceloc
