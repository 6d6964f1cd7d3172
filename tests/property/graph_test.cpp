#include <gtest/gtest.h>

#include "graph/lidar_graph.h"
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
    Keyframe k{0.1 * i, T_odom_body, motion, std::nullopt,
               KeyAttitude{T.linear(), 1e-6 * Eigen::Matrix3d::Identity()}};
    if (with_gps)
      k.gps = KeyGps{T * lever_m + Eigen::Vector3d(rnd.normal(gps_sigma_m), rnd.normal(gps_sigma_m),
                                                   rnd.normal(gps_sigma_m)),
                     Eigen::Matrix3d::Identity() * std::max(1e-4, gps_sigma_m * gps_sigma_m), lever_m};
    truth.keyframes.push_back(k);
    truth.T_map_body.push_back(T);
  }
  return truth;
}

double worstError_m(const GraphSolution& solution, const std::vector<Pose>& truth) {
  double worst = 0;
  for (std::size_t i = 0; i < truth.size(); ++i)
    worst = std::max(worst, (solution.T_map_body[i].translation() - truth[i].translation()).norm());
  return worst;
}

TEST(LidarGraphProperty, WithoutNoiseItFindsTheTruth) {
  forAll(5, [](Random& rnd) {
    const Truth truth = lap(rnd, 0, 0, true);
    // The start is off by the tilt of the first pose (levelled alignment); the solver takes it out to its
    // tolerance.
    EXPECT_LT(worstError_m(solveLidarGraph(truth.keyframes, {}), truth.T_map_body), 1e-3);
  });
}

TEST(LidarGraphProperty, GpsTakesTheDriftOutOfTheOdometry) {
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
    const double error_m = worstError_m(solveLidarGraph(truth.keyframes, options), truth.T_map_body);
    EXPECT_LT(error_m, 0.2);  // 4 sigma of one fix
    EXPECT_LT(error_m, odometry_error_m);
  });
}

TEST(LidarGraphProperty, ARigidMoveOfTheFixesMovesTheMap) {
  Random rnd(11);
  const Truth truth = lap(rnd, 0.01, 0.03, true);
  const Pose T_new_map =
      poseFromRpy({1000, -300, 20}, 0, 0, 1.1);  // level: roll and pitch have their own factors
  Truth moved = truth;
  for (auto& k : moved.keyframes) {
    k.gps->p_map_antenna_m = T_new_map * k.gps->p_map_antenna_m;
    k.attitude->R_map_body = T_new_map.linear() * k.attitude->R_map_body;
  }
  const auto a = solveLidarGraph(truth.keyframes, {}), b = solveLidarGraph(moved.keyframes, {});
  for (std::size_t i = 0; i < a.T_map_body.size(); ++i)  // the solver's tolerance
    EXPECT_TRUE((T_new_map * a.T_map_body[i]).isApprox(b.T_map_body[i], 1e-6)) << i;
}

TEST(LidarGraphProperty, OneWildFixDoesNotBendTheMap) {
  Random rnd(12);
  Truth truth = lap(rnd, 0.001, 0.02, true);
  truth.keyframes[30].gps->p_map_antenna_m += Eigen::Vector3d(15, -8, 4);
  GraphOptions options;
  options.odometry_sigma_m = 0.005;
  EXPECT_LT(worstError_m(solveLidarGraph(truth.keyframes, options), truth.T_map_body), 0.1);
}

TEST(LidarGraph, WithoutGpsTheFirstPoseIsTheOrigin) {
  Random rnd(13);
  Truth truth = lap(rnd, 0, 0, false);
  for (auto& k : truth.keyframes) k.attitude.reset();
  GraphOptions loose;
  loose.level_sigma_deg = 1000;
  const auto solution = solveLidarGraph(truth.keyframes, loose);
  EXPECT_EQ(solution.T_map_body[0].matrix(), Pose::Identity().matrix());
  EXPECT_EQ(solution.gps_factors, 0U);
  EXPECT_TRUE(solution.T_map_body.back().isApprox(truth.keyframes.back().T_odom_body, 1e-3));
}

TEST(LidarGraph, RefusesFewerThanTwoKeyPoses) {
  EXPECT_THROW((void)solveLidarGraph({}, {}), std::invalid_argument);
}

TEST(AlignLevelProperty, UndoesALevelMove) {
  forAll(50, [](Random& rnd) {
    const Pose T = poseFromRpy(rnd.vectorWithin(500), 0, 0, rnd.uniform(-3, 3));
    std::vector<Eigen::Vector3d> from, to;
    for (int i = 0; i < 10; ++i) {
      from.push_back(rnd.vectorWithin(50));
      to.push_back(T * from.back());
    }
    EXPECT_TRUE(alignLevel(from, to).isApprox(T, 1e-9));
  });
}

}  // namespace
}  // namespace raceloc
