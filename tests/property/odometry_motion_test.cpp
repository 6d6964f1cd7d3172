#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "odometry/motion_history.h"
#include "support/forall.h"
#include "support/plain_car.h"

namespace raceloc {
namespace {

using test::forAll;
using test::plainCalibration;
using test::plainMotion;
using test::Random;
using ::testing::Contains;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Not;

/** A car at constant speed on a flat circle, sampled at 100 Hz. */
struct Cruise {
  double speed_mps = 50, yaw_rate_rps = 0.1;

  [[nodiscard]] ImuSample imu(double stamp_s, Random& rnd) const {
    return {stamp_s,
            "imu",
            {rnd.normal(1e-3), rnd.normal(1e-3), yaw_rate_rps + rnd.normal(1e-3)},
            {rnd.normal(0.1), speed_mps * yaw_rate_rps + rnd.normal(0.1), kGravity_mps2 + rnd.normal(0.1)},
            {0, 0, 0}};
  }
  [[nodiscard]] MotionSample wheels(double stamp_s, double wheel_mps) const {
    return {stamp_s, "vehicle", wheel_mps, yaw_rate_rps, std::nullopt};
  }
};

TEST(MotionHistory, DropsAFrozenGyroAndNamesIt) {
  Random rnd(1);
  const Cruise straight{50, 0}, bend{50, 0.3};
  MotionHistory history(plainMotion(), plainCalibration());
  ImuSample frozen = straight.imu(0, rnd);
  for (int i = 0; i <= 200; ++i) {
    const double t = 0.01 * i;
    const Cruise& now = t < 1 ? straight : bend;
    frozen.stamp_s = t;
    history.add(t < 1 ? straight.imu(t, rnd) : frozen);  // the bend begins when the gyro dies
    history.add(now.wheels(t, 50));
    if (i == 90) {
      EXPECT_THAT(history.faults(), IsEmpty());
    }
  }
  EXPECT_THAT(history.faults(), ElementsAre(HasSubstr("imu: gyro frozen")));
  EXPECT_EQ(history.knownUntil_s(), 2.0);                                // nobody waits for it
  EXPECT_NEAR(history.ratesBetween(1.2, 2.0)->yaw_rate_rps, 0.3, 0.01);  // the car's own
  history.add(bend.imu(2.01, rnd));
  EXPECT_THAT(history.faults(), IsEmpty());
}

TEST(MotionHistory, DropsASaturatedGyroAndNamesIt) {
  Random rnd(1);
  const Cruise spin{20, 4};  // rad/s, of a gyro that ends at 2
  MotionHistory history(plainMotion(), plainCalibration());
  for (int i = 0; i <= 50; ++i) {
    ImuSample imu = spin.imu(0.01 * i, rnd);
    imu.gyro_body_rps.z() = std::min(2.0, imu.gyro_body_rps.z());
    history.add(imu);
    history.add(spin.wheels(0.01 * i, 20));
  }
  EXPECT_THAT(history.faults(), ElementsAre(HasSubstr("saturated")));
  EXPECT_NEAR(history.ratesBetween(0.2, 0.5)->yaw_rate_rps, 4, 0.01);  // the car's own
}

struct WheelFault {
  const char* name;
  double factor;
};
class MotionHistoryWithWheelFault : public ::testing::TestWithParam<WheelFault> {};

TEST_P(MotionHistoryWithWheelFault, GoesOnAtTheLikelySpeedAndNamesIt) {
  forAll(10, [&](Random& rnd) {
    const Cruise car{rnd.uniform(15, 70), rnd.uniform(-0.2, 0.2)};
    MotionHistory history(plainMotion(), plainCalibration());
    const auto drive = [&](int from, int to, double factor) {
      for (int i = from; i < to; ++i) {
        history.add(car.imu(0.01 * i, rnd));
        history.add(car.wheels(0.01 * i, factor * car.speed_mps + rnd.normal(0.05)));
      }
    };
    drive(0, 200, 1);
    EXPECT_THAT(history.faults(), IsEmpty());
    drive(200, 250, GetParam().factor);
    EXPECT_THAT(history.faults(), ElementsAre(HasSubstr("vehicle: wheel speed")));
    // Half a second by a force whose error is not known to better than 0.5 m/s^2.
    EXPECT_NEAR(history.ratesBetween(2.0, 2.49)->speed_mps, car.speed_mps, 0.5);
    drive(250, 300, 1);
    EXPECT_THAT(history.faults(), IsEmpty());
    EXPECT_NEAR(history.ratesBetween(2.8, 2.99)->speed_mps, car.speed_mps, 0.1);
  });
}

INSTANTIATE_TEST_SUITE_P(That, MotionHistoryWithWheelFault,
                         ::testing::Values(WheelFault{"locks", 0}, WheelFault{"spins", 1.2}),
                         [](const auto& fault) { return std::string(fault.param.name); });

TEST(MotionHistory, RefusesASpeedThatFreezesWhenTheCarBrakes) {
  forAll(10, [](Random& rnd) {
    const Cruise car{rnd.uniform(50, 70), 0};
    const double braking_mps2 = rnd.uniform(3, 10);
    MotionHistory history(plainMotion(), plainCalibration());
    MotionSample wheels = car.wheels(0, 0);
    for (int i = 0; i <= 400; ++i) {
      const double t = 0.01 * i;
      ImuSample imu = car.imu(t, rnd);
      if (t > 2) imu.specific_force_body_mps2.x() -= braking_mps2;
      history.add(imu);
      if (t <= 2) wheels.speed_mps = car.speed_mps + rnd.normal(0.05);
      wheels.stamp_s = t;
      history.add(wheels);
      if (i == 200) {
        EXPECT_THAT(history.faults(), IsEmpty());
      }
    }
    EXPECT_THAT(history.faults(), ElementsAre(HasSubstr("vehicle: wheel speed")));
    // Two seconds by a force whose error is not known to better than 0.5 m/s^2.
    EXPECT_NEAR(history.ratesAt(4)->twist(3), car.speed_mps - 2 * braking_mps2, 1);
  });
}

TEST(MotionHistory, BelievesTheGyroAgainstOneFrozenMessage) {
  forAll(10, [](Random& rnd) {
    const Cruise straight{rnd.uniform(3, 15), 0}, bend{straight.speed_mps, rnd.uniform(-0.8, 0.8)};
    MotionHistory history(plainMotion(), plainCalibration());
    MotionSample frozen{0, "vehicle", straight.speed_mps, 0, 0.0};  // yaw rate and steering
    for (int i = 0; i <= 200; ++i) {
      frozen.stamp_s = 0.01 * i;
      history.add((frozen.stamp_s < 1 ? straight : bend).imu(frozen.stamp_s, rnd));
      history.add(frozen);
    }
    // Where it does not contradict the gyro, 5 sigma of both, it is averaged with it.
    EXPECT_NEAR(history.ratesBetween(1.2, 2)->yaw_rate_rps, bend.yaw_rate_rps, 0.05);
  });
}

TEST(MotionHistory, DoesNotTireOfRefusingWheelsThatSpinForLong) {
  Random rnd(4);
  const Cruise car{28, 0};
  MotionHistory history(plainMotion(), plainCalibration());
  const Matrix6d covariance = 0.01 * Matrix6d::Identity();  // scan matches of 0.1 m, ten a second
  for (int i = 0; i <= 1200; ++i) {
    const double t = 0.01 * i;
    history.add(car.imu(t, rnd));
    history.add(car.wheels(t, t < 2 ? car.speed_mps : 1.2 * car.speed_mps));
    if (i % 10 != 0 || i < 10) continue;
    Vector6d moved = Vector6d::Zero();
    moved(3) = 0.1 * car.speed_mps + rnd.normal(0.1);
    history.observe(t - 0.1, t, se3Exp(moved), covariance);
  }
  EXPECT_THAT(history.faults(), ElementsAre(HasSubstr("wheel speed")));
  EXPECT_NEAR(history.ratesBetween(11, 12)->speed_mps, car.speed_mps, 2);  // 5.6 too fast by the wheels
}

TEST(MotionHistory, LeavesOutAGyroThatBothOthersContradict) {
  Random rnd(3);
  const Cruise car{30, 0.2};
  MotionOptions options = plainMotion();
  options.understeer_deg_per_mps2 = 0;
  MotionHistory history(options, plainCalibration());
  for (int i = 0; i <= 100; ++i) {
    ImuSample imu = car.imu(0.01 * i, rnd);
    imu.gyro_body_rps.z() -= 1.5;  // more than the steering's offset, yet unknown, could explain
    history.add(imu);
    MotionSample wheels = car.wheels(0.01 * i, car.speed_mps + rnd.normal(0.05));  // no two alike
    wheels.steering_rad = std::atan(options.wheelbase_m * car.yaw_rate_rps / car.speed_mps);
    history.add(wheels);
  }
  EXPECT_NEAR(history.ratesBetween(0.2, 0.8)->yaw_rate_rps, car.yaw_rate_rps, 1e-3);  // 0.05 of 30 m/s
}

/** Tells the history where the car was, as a scan match would. */
void observe(MotionHistory& history, const Cruise& car, double from_s, double to_s) {
  const double duration_s = to_s - from_s;
  history.observe(from_s, to_s, arc(car.speed_mps * duration_s, car.yaw_rate_rps * duration_s),
                  1e-4 * Matrix6d::Identity());
}

TEST(MotionHistory, GoesOnAtTheObservedSpeedWhereThereNeverWereWheels) {
  Random rnd(1);
  const Cruise car;
  MotionHistory history(plainMotion(), plainCalibration());
  for (int i = 0; i <= 100; ++i) {
    history.add(car.imu(0.01 * i, rnd));
    if (i == 50) observe(history, car, 0.4, 0.5);
  }
  EXPECT_THAT(history.faults(), IsEmpty());  // nobody misses what was never there
  EXPECT_FALSE(history.hasWheels(1.0));
  EXPECT_EQ(history.knownUntil_s(), 1.0);
  const auto motion = history.between(0.5, 0.6);
  ASSERT_TRUE(motion);
  EXPECT_NEAR((motion->T_start_end.translation() - arc(5, 0.01).translation()).norm(), 0, 0.01);
  EXPECT_NEAR(std::sqrt(motion->covariance(3, 3)), 0.3, 0.03);  // 30 m/s^2 missed for 0.1 s after 0.1 s
  EXPECT_FALSE(history.between(0.5, 1.1));                      // older than max_gap_s
}

TEST(MotionHistory, NamesWheelsAndImuThatFellSilent) {
  Random rnd(1);
  const Cruise car;
  MotionHistory wheels_dead(plainMotion(), plainCalibration()), imu_dead = wheels_dead;
  for (int i = 0; i <= 200; ++i) {
    const double t = 0.01 * i;
    wheels_dead.add(car.imu(t, rnd));
    imu_dead.add(car.wheels(t, 50));
    if (t <= 1) {
      wheels_dead.add(car.wheels(t, 50));
      imu_dead.add(car.imu(t, rnd));
    }
    if (i > 0 && i % 10 == 0) observe(wheels_dead, car, t - 0.1, t);
  }
  EXPECT_THAT(wheels_dead.faults(), ElementsAre("vehicle: silent"));
  EXPECT_THAT(imu_dead.faults(), ElementsAre("imu: silent"));
  EXPECT_EQ(wheels_dead.knownUntil_s(), 2.0);
  EXPECT_EQ(imu_dead.knownUntil_s(), 2.0);
  EXPECT_NEAR(wheels_dead.ratesBetween(1.9, 2.0)->speed_mps, 50, 1e-6);
  EXPECT_NEAR(imu_dead.ratesBetween(1.9, 2.0)->yaw_rate_rps, 0.1, 1e-9);
  wheels_dead.add(car.wheels(2.01, 50));
  EXPECT_THAT(wheels_dead.faults(), IsEmpty());
}

TEST(MotionHistory, BelievesWheelsThatComeBackAfterTheCarHasBraked) {
  Random rnd(1);
  MotionHistory history(plainMotion(), plainCalibration());
  constexpr double kBraking_mps2 = 9;
  for (int i = 0; i <= 400; ++i) {
    const double t = 0.01 * i;
    const bool braking = t > 1 && t <= 3;
    const Cruise car{60 - kBraking_mps2 * std::clamp(t - 1, 0.0, 2.0), 0};
    ImuSample imu = car.imu(t, rnd);
    imu.specific_force_body_mps2.x() -= braking ? kBraking_mps2 : 0;
    history.add(imu);
    if (t <= 1 || t > 3.5) history.add(car.wheels(t, car.speed_mps + rnd.normal(0.05)));
    if (i > 0 && i % 10 == 0) observe(history, car, t - 0.1, t);
    if (t > 3.5) {
      ASSERT_THAT(history.faults(), IsEmpty()) << t;
    }
  }
  EXPECT_NEAR(history.ratesBetween(3.9, 4.0)->speed_mps, 42, 0.1);
}

TEST(MotionHistory, IgnoresWhatIsNoNumberAndWhatIsOld) {
  MotionHistory history(plainMotion(), plainCalibration());
  for (int i = 0; i <= 10; ++i) history.add(MotionSample{0.1 * i, "vehicle", 20, 0.1});
  const auto before = history.ratesBetween(0.1, 0.9);
  history.add(MotionSample{0.5, "vehicle", 99, 9});
  history.add(MotionSample{1.1, "vehicle", std::nan(""), 0});
  history.add(ImuSample{1.1, "imu", {0, 0, std::nan("")}, {0, 0, kGravity_mps2}, {0, 0, 0}});
  EXPECT_EQ(history.knownUntil_s(), 1.0);
  EXPECT_EQ(history.ratesBetween(0.1, 0.9)->speed_mps, before->speed_mps);
}

/** A body that pitches and heaves on its springs, on a flat and straight road. */
struct Swinging {
  explicit Swinging(Random& rnd)
      : speed_mps(rnd.uniform(30, 70)),
        pitch_rad(rnd.uniform(0.1, 0.3) * kDegree),
        pitch_hz(rnd.uniform(2, 5)),
        heave_m(rnd.uniform(0.005, 0.02)),
        heave_hz(rnd.uniform(1.5, 4)),
        p_body_imu_m(rnd.vectorWithin(1.5)) {}

  [[nodiscard]] Pose at(double stamp_s) const {
    return poseFromRpy({speed_mps * stamp_s, 0, heave_m * std::sin(2 * M_PI * heave_hz * stamp_s)}, 0,
                       pitch_rad * std::sin(2 * M_PI * pitch_hz * stamp_s), 0);
  }
  [[nodiscard]] ImuSample imu(double stamp_s, Random& rnd) const {
    constexpr double h = 1e-4;  // of the derivatives: their error is below 1e-3 m/s^2
    const Pose T = at(stamp_s);
    const auto imuAt_m = [&](double t_s) { return Eigen::Vector3d(at(t_s) * p_body_imu_m); };
    const Eigen::Vector3d acceleration_mps2 =
        (imuAt_m(stamp_s + h) - 2 * imuAt_m(stamp_s) + imuAt_m(stamp_s - h)) / (h * h);
    const Eigen::Vector3d gyro_rps = se3Log(at(stamp_s - h).inverse() * at(stamp_s + h)).head<3>() / (2 * h);
    return {stamp_s, "imu", gyro_rps + rnd.vectorWithin(1e-3),
            T.linear().transpose() * (acceleration_mps2 + Eigen::Vector3d(0, 0, kGravity_mps2)) +
                rnd.vectorWithin(0.1),
            p_body_imu_m};
  }
  [[nodiscard]] MotionSample wheels(double stamp_s) const {
    return {stamp_s, "vehicle", speed_mps, 0, std::nullopt};
  }
  /** What a sweep from then on is predicted to move along z, less what it does. */
  [[nodiscard]] double error_m(const MotionHistory& history, double stamp_s) const {
    constexpr double kSweep_s = 0.1;
    return history.preintegrated(stamp_s, stamp_s + kSweep_s)->T_start_end.translation().z() -
           (at(stamp_s).inverse() * at(stamp_s + kSweep_s)).translation().z();
  }

  double speed_mps, pitch_rad, pitch_hz, heave_m, heave_hz;
  Eigen::Vector3d p_body_imu_m;
};

/** In a sweep the body moves along z by up to 60 mm. What is slower than 0.07 Hz is held back, which bends a swing at
 * 1.5 Hz by a twentieth: 3 mm. The noise of gyro and accelerometer adds up to 0.02 m/s over the 3 s that are
 * remembered. */
constexpr double kFollowed_m = 5e-3;

TEST(MotionHistory, FollowsABodyThatPitchesAndHeaves) {
  forAll(20, [](Random& rnd) {
    const Swinging car(rnd);
    MotionHistory history(plainMotion(), plainCalibration());
    for (int i = 0; i <= 800; ++i) {
      history.add(car.imu(0.01 * i, rnd));
      history.add(car.wheels(0.01 * i));
    }
    for (double t = 6; t < 7.9; t += 0.05) EXPECT_NEAR(car.error_m(history, t), 0, kFollowed_m) << t;
  });
}

TEST(MotionHistory, DoesNotTellASwingThatItDidNotFeel) {
  forAll(20, [](Random& rnd) {
    const Swinging car(rnd);
    const double silent_s = rnd.uniform(0.05, 0.5);
    MotionHistory history(plainMotion(), plainCalibration());
    for (int i = 0; i <= 800; ++i) {
      const double t = 0.01 * i;
      if (t < 4 || t > 4 + silent_s) history.add(car.imu(t, rnd));
      history.add(car.wheels(t));
      EXPECT_THAT(history.faults(), Not(Contains(HasSubstr("contradicts")))) << t;
    }
    EXPECT_LT(std::abs(history.ratesAt(4 + silent_s / 2)->twist(5)), silent_s > 0.09 ? 1e-12 : 1);
    for (double t = 7; t < 7.9; t += 0.05)  // a start is remembered for longer
      EXPECT_NEAR(car.error_m(history, t), 0, 2 * kFollowed_m) << t;
  });
}

/** A turn at constant speed on a bank into which the car leans. */
struct Banked {
  double speed_mps, yaw_rate_rps, bank_rad;

  [[nodiscard]] Eigen::Vector3d up() const { return {0, -std::sin(bank_rad), std::cos(bank_rad)}; }
  [[nodiscard]] Eigen::Vector3d gyro_rps() const { return yaw_rate_rps * up(); }
  [[nodiscard]] Eigen::Vector3d force_mps2() const {
    return kGravity_mps2 * up() + gyro_rps().cross(Eigen::Vector3d(speed_mps, 0, 0));
  }
  [[nodiscard]] MotionSample wheels(double stamp_s) const {
    return {stamp_s, "vehicle", speed_mps, gyro_rps().z(), std::nullopt};
  }
};

TEST(MotionHistory, ABankIsNoHeave) {
  forAll(20, [](Random& rnd) {
    const double speed_mps = rnd.uniform(20, 80);
    const Banked turn{speed_mps, rnd.uniform(5, 20) / speed_mps, rnd.uniform(0, 20) * kDegree};
    const Eigen::Vector3d gyro_bias_rps = rnd.vectorWithin(0.1 * kDegree), bias_mps2 = rnd.vectorWithin(0.1);
    const int wheels_from = rnd.integer(0, 100);
    MotionHistory history(plainMotion(), plainCalibration());
    for (int i = 0; i <= 1000; ++i) {
      const double t = 0.01 * i;
      history.add(ImuSample{t,
                            "imu",
                            turn.gyro_rps() + gyro_bias_rps + rnd.vectorWithin(1e-3),
                            turn.force_mps2() + bias_mps2 + rnd.vectorWithin(0.1),
                            {0, 0, 0}});
      if (i >= wheels_from) history.add(turn.wheels(t));
      EXPECT_THAT(history.faults(), Not(Contains(HasSubstr("contradicts")))) << t;
    }
    // No more than the biases push in a second: turning, they are no constant force at rest.
    EXPECT_NEAR(history.ratesAt(9.9)->twist(5), 0, 0.1 + 0.1 * kDegree * speed_mps);
  });
}

TEST(MotionHistory, AnAccelerometerThatEndsBeforeTheBankDoesIsNamedAndMovesLittle) {
  const Banked turn{70, 0.25, 20 * kDegree};
  MotionHistory history(plainMotion(), plainCalibration());
  Random rnd(1);
  for (int i = 0; i <= 800; ++i) {
    const double t = 0.01 * i;
    const bool in_turn = t >= 4;
    Eigen::Vector3d force_mps2 = in_turn ? turn.force_mps2() : Eigen::Vector3d(kGravity_mps2 * turn.up());
    force_mps2.z() = std::min(12.0, force_mps2.z());  // 15 in the turn
    const Eigen::Vector3d gyro_rps = in_turn ? turn.gyro_rps() : Eigen::Vector3d::Zero();
    history.add(ImuSample{
        t, "imu", gyro_rps + rnd.vectorWithin(1e-3), force_mps2 + rnd.vectorWithin(0.1), {0, 0, 0}});
    history.add(MotionSample{t, "vehicle", turn.speed_mps, gyro_rps.z(), std::nullopt});
    if (in_turn) continue;
    EXPECT_THAT(history.faults(), IsEmpty()) << t;
  }
  EXPECT_THAT(history.faults(), ElementsAre("imu: gyro or accelerometer contradicts the road"));
  // 3 m/s^2 are missing: after half a second, or a whole, since it is held to the road meanwhile, they make the 1.5 m/s
  // that are not believed.
  double moved_m = 0;
  for (int i = 400; i < 790; ++i) moved_m += 0.01 * history.ratesAt(0.01 * i)->twist(5);
  EXPECT_LT(std::abs(moved_m), 1 * 0.5 * 1.5);
}

TEST(MotionHistory, SlipDoesNotSwingWithTheSprings) {
  const double speed_mps = 60, yaw_rate_rps = 0.15;
  const auto driven = [&](double swing_mps2) {
    MotionHistory history(plainMotion(), {});
    for (int i = 0; i <= 400; ++i) {
      const double t = 0.01 * i;
      const double out_of_road_mps2 = kGravity_mps2 + swing_mps2 * std::sin(2 * M_PI * 3.1 * t);
      history.add(ImuSample{
          t, "imu", {1e-5 * i, 0, yaw_rate_rps}, {0, speed_mps * yaw_rate_rps, out_of_road_mps2}, {0, 0, 0}});
      history.add(MotionSample{t, "vehicle", speed_mps, yaw_rate_rps, std::nullopt});
    }
    return history;
  };
  const MotionHistory smooth = driven(0), rough = driven(5);
  // Without a swing a sweep goes 0.09 m to the side; a load that swings by a half would swing that by as much. With a
  // lag of 1 s, a swing at 3.1 Hz has a twentieth of it left.
  for (double t = 3; t < 3.9; t += 0.03)
    EXPECT_NEAR(rough.preintegrated(t, t + 0.1)->T_start_end.translation().y(),
                smooth.preintegrated(t, t + 0.1)->T_start_end.translation().y(), 3e-3)
        << t;
}

TEST(MotionHistory, SlipFollowsALoadThatStays) {
  MotionHistory history(plainMotion(), {});
  const double speed_mps = 60, yaw_rate_rps = 0.15;
  double before_mps = 0;
  for (int i = 0; i <= 1000; ++i) {
    const double t = 0.01 * i;
    if (i == 400) before_mps = history.ratesAt(3.9)->twist(4);
    history.add(ImuSample{t,
                          "imu",
                          {1e-5 * i, 0, yaw_rate_rps},
                          {0, speed_mps * yaw_rate_rps, (i < 400 ? 1 : 2) * kGravity_mps2},
                          {0, 0, 0}});
    history.add(MotionSample{t, "vehicle", speed_mps, yaw_rate_rps, std::nullopt});
  }
  EXPECT_NEAR(history.ratesAt(9.9)->twist(4), before_mps / 2,
              0.01 * std::abs(before_mps));  // exp(-6) is left
}

/** Truth by a calibration, measured with noise: what is learnt is within its own sigmas. */
TEST(MotionCalibrationProperty, LearnsWhatIsWrongWithTheSources) {
  forAll(20, [](Random& rnd) {
    MotionCalibration learnt({});
    const CalibrationVector start = learnt.mean();
    const CalibrationVector sigma = learnt.covariance().diagonal().cwiseSqrt();
    CalibrationVector truth = start;
    for (int k = 0; k < kCalibrations; ++k) truth(k) += rnd.normal(sigma(k));
    Matrix6d noise = Matrix6d::Zero();
    noise.diagonal() << 1e-6, 1e-6, 1e-6, 1e-3, 1e-3, 1e-3;
    int believed = 0;
    for (int scan = 0; scan < 300; ++scan) {
      BodyRates rates;
      rates.twist << 0, 0, rnd.normal(0.2), rnd.uniform(20, 70), 0, 0;
      rates.noise_density.setConstant(1e-8);
      for (int k = 0; k < 3; ++k) rates.J_calibration(k, k) = -1;
      const double forward_mps = rates.twist(3);
      rates.J_calibration(3, kWheelScale) = forward_mps;
      rates.J_calibration(3, kTraction) = -rnd.uniform(-8, 8) * forward_mps;
      rates.J_calibration(4, kSideslip) = -rnd.uniform(-15, 15) * forward_mps;
      rates.J_calibration(5, kRise) = forward_mps;
      rates.twist += rates.J_calibration * (learnt.mean() - start);  // as the sources are read now
      Preintegration motion;
      for (int i = 0; i < 20; ++i) motion.append(rates, 0.005);
      BodyRates true_rates = rates;
      true_rates.twist += rates.J_calibration * (truth - learnt.mean());
      Preintegration true_motion;
      for (int i = 0; i < 20; ++i) true_motion.append(true_rates, 0.005);
      Vector6d error;
      for (int i = 0; i < 6; ++i) error(i) = rnd.normal(std::sqrt(noise(i, i)));
      believed += learnt.observe(motion, true_motion.T_start_end * se3Exp(error), noise) ? 1 : 0;
    }
    EXPECT_GT(believed, 295);  // 1 of 1000 is beyond chance
    const CalibrationVector left = learnt.covariance().diagonal().cwiseSqrt();
    // The rise wanders by 0.1 deg in a second, and a scan tells it to 0.03 m in 0.1 s at 20 m/s or more, 0.9 deg: what
    // is left of its 0.3 deg is sqrt(0.1 * sqrt(0.1 s) * 0.9) = 0.17 deg.
    for (const int k : {kGyroBiasX, kGyroBiasY, kGyroBiasZ, kWheelScale, kTraction, kSideslip, kRise}) {
      EXPECT_LT(left(k), (k == kRise ? 0.6 : 0.3) * sigma(k)) << k;
      EXPECT_LT(std::abs(learnt.mean()(k) - truth(k)), 5 * left(k))
          << k;  // and the random walk that did not happen
    }
    EXPECT_NEAR(learnt.mean()(kSteeringOffset), start(kSteeringOffset), 1e-12);  // nothing told
  });
}

TEST(MotionCalibration, DoesNotLearnFromAContradiction) {
  MotionCalibration learnt({});
  BodyRates rates;
  rates.twist(3) = 50;
  rates.J_calibration(3, kWheelScale) = 50;
  Preintegration motion;
  motion.append(rates, 0.1);
  const CalibrationVector before = learnt.mean();
  const Pose jumped = motion.T_start_end * Eigen::Translation3d(0, 3, 0);
  EXPECT_FALSE(learnt.observe(motion, jumped, 1e-3 * Matrix6d::Identity()));
  EXPECT_EQ(learnt.mean(), before);
}

}  // namespace
}  // namespace raceloc
