#include <gtest/gtest.h>

#include "odometry/levelling.h"
#include "support/forall.h"
#include "support/plain_car.h"

namespace raceloc {
namespace {

using test::forAll;
using test::plainCalibration;
using test::plainMotion;
using test::Random;

constexpr double kStep_s = 0.1;
/** A car on a banked circle, as its sensors feel it. The speed goes up all the time. */
struct BankedTurn {
  double roll_rad, pitch_rad, radius_m, start_mps, gain_mps2;
  Eigen::Vector3d bias_mps2, p_body_imu_m;

  [[nodiscard]] double speed_mps(double t_s) const { return start_mps + gain_mps2 * t_s; }
  [[nodiscard]] Pose T_map_body(double t_s) const {
    const double yaw_rad = (start_mps * t_s + 0.5 * gain_mps2 * t_s * t_s) / radius_m;
    return poseFromRpy({radius_m * std::sin(yaw_rad), -radius_m * std::cos(yaw_rad), 0}, roll_rad, pitch_rad,
                       yaw_rad);
  }
  [[nodiscard]] ImuSample imu(double t_s) const {
    constexpr double h_s = 1e-3;
    const auto place_m = [&](double at_s) { return Eigen::Vector3d(T_map_body(at_s) * p_body_imu_m); };
    const Eigen::Vector3d acceleration_mps2 =
        (place_m(t_s + h_s) - 2 * place_m(t_s) + place_m(t_s - h_s)) / (h_s * h_s);
    const Eigen::Matrix3d R_body_map = T_map_body(t_s).linear().transpose();
    return {t_s, "imu", R_body_map * Eigen::Vector3d(0, 0, speed_mps(t_s) / radius_m),
            R_body_map * (acceleration_mps2 + kGravity_mps2 * Eigen::Vector3d::UnitZ()) + bias_mps2,
            p_body_imu_m};
  }
};

BankedTurn anyTurn(Random& rnd) {
  const double side = rnd.oneOf({-1.0, 1.0});
  return {side * rnd.uniform(0, 24) * kDegree,
          rnd.uniform(-4, 4) * kDegree,
          -side * rnd.uniform(150, 400),
          rnd.uniform(20, 60),
          rnd.uniform(-1, 3),
          rnd.vectorWithin(0.1),
          rnd.vectorWithin(1.5)};
}

struct Driven {
  MotionHistory history{plainMotion(), plainCalibration()};
  Levelling levelling{LevelOptions{}};
};

/** Odometry of `duration_s` of a turn, each motion off by `sigma_m` an axis. */
void drive(const BankedTurn& turn, double begin_s, double duration_s, Random& rnd, Driven& driven,
           bool accelerometer = true) {
  constexpr double kSigma_m = 0.01;
  const Eigen::Matrix3d R_odom_map = turn.T_map_body(0).linear().transpose();
  for (double from_s = begin_s; from_s < begin_s + duration_s - 1e-9; from_s += kStep_s) {
    for (int i = 1; i <= 10; ++i) {
      const double t_s = from_s + 0.1 * kStep_s * i;
      if (accelerometer) driven.history.add(turn.imu(t_s));
      driven.history.add(MotionSample{t_s, "vehicle", turn.speed_mps(t_s), turn.imu(t_s).gyro_body_rps.z()});
    }
    BodyMotion motion{kStep_s, turn.T_map_body(from_s).inverse() * turn.T_map_body(from_s + kStep_s), {}};
    motion.T_start_end.translation() += Eigen::Vector3d(rnd.normal(), rnd.normal(), rnd.normal()) * kSigma_m;
    motion.covariance.setZero();
    motion.covariance.diagonal().tail<3>().setConstant(kSigma_m * kSigma_m);
    driven.levelling.add(from_s, R_odom_map * turn.T_map_body(from_s).linear(), motion, driven.history);
  }
}

double error_rad(const BankedTurn& turn, const Driven& driven, double now_s) {
  const Eigen::Matrix3d R_map_body = turn.T_map_body(now_s).linear();
  const auto level = driven.levelling.level(turn.T_map_body(0).linear().transpose() * R_map_body);
  if (!level) return M_PI;
  return std::acos(std::min(1.0, level->up_body.dot(R_map_body.transpose() * Eigen::Vector3d::UnitZ())));
}

TEST(LevellingProperty, FindsUpInABankedTurnWhileTheCarGainsSpeed) {
  forAll(20, [](Random& rnd) {
    const BankedTurn turn = anyTurn(rnd);
    Driven driven;
    drive(turn, 0, 10, rnd, driven);
    const Eigen::Matrix3d R = turn.T_map_body(0).linear().transpose() * turn.T_map_body(10).linear();
    // 1 deg: the bias of up to 0.17 m/s^2 in all, unlearnt. 4 sigma: the worst of 20.
    EXPECT_LT(error_rad(turn, driven, 10), std::min(1 * kDegree, 4 * driven.levelling.level(R)->sigma_rad));
  });
}

TEST(LevellingProperty, RollAndPitchAreThoseOfTheBody) {
  forAll(200, [](Random& rnd) {
    const double roll_rad = rnd.uniform(-1, 1), pitch_rad = rnd.uniform(-1, 1);
    const Pose T = poseFromRpy(Eigen::Vector3d::Zero(), roll_rad, pitch_rad, rnd.uniform(-3, 3));
    const Level level{T.linear().transpose() * Eigen::Vector3d::UnitZ(), 0};
    EXPECT_NEAR(level.roll_rad(), roll_rad, 1e-12);
    EXPECT_NEAR(level.pitch_rad(), pitch_rad, 1e-12);
  });
}

TEST(LevellingProperty, TheImuSitsWhereItSits) {
  Random rnd(1);
  BankedTurn turn{0, 0, 150, 60, 0.5, Eigen::Vector3d::Zero(), {0, 0, 0}};
  Driven here;
  drive(turn, 0, 5, rnd, here);
  turn.p_body_imu_m = {1.5, 0.5,
                       -1};  // felt there: 0.24 m/s^2 more, a tilt of 0.5 deg after 5 s if it counted
  Driven there;
  drive(turn, 0, 5, rnd, there);
  EXPECT_LT(error_rad(turn, there, 5), 0.35 * kDegree);
  EXPECT_LT(error_rad(turn, here, 5), 0.35 * kDegree);
}

TEST(LevellingProperty, WithoutAnAccelerometerNothingIsLevel) {
  Random rnd(1);
  const BankedTurn turn = anyTurn(rnd);
  Driven driven;
  drive(turn, 0, 3, rnd, driven, false);
  EXPECT_FALSE(driven.levelling.level(Eigen::Matrix3d::Identity()));
}

TEST(LevellingProperty, WhatWasLevelStaysSoWhileTheAccelerometerIsSilent) {
  Random rnd(2);
  const BankedTurn turn = anyTurn(rnd);
  Driven driven;
  drive(turn, 0, 10, rnd, driven);
  const Eigen::Matrix3d R = Eigen::Matrix3d::Identity();
  const double sigma_rad = driven.levelling.level(R)->sigma_rad;
  drive(turn, 10, 5, rnd, driven, false);
  ASSERT_TRUE(driven.levelling.level(R));
  EXPECT_GT(driven.levelling.level(R)->sigma_rad, sigma_rad);
  drive(turn, 15, 5, rnd, driven);
  EXPECT_LT(error_rad(turn, driven, 20), 1 * kDegree);
}

}  // namespace
}  // namespace raceloc
