/** \file
 * What receivers say of a car whose motion is known: circles in the plane, exact fixes of an antenna anywhere on it. */
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "pipeline/receivers.h"
#include "support/forall.h"

namespace raceloc {
namespace {

using test::forAll;
using test::Random;

constexpr double kPeriod_s = 0.05;
constexpr int kSeeds = 100;
constexpr double kRounding_m = 1e-12;  // of doubles up to 100 m

/** A car on a circle: heading 0 and place (0, 0) at time 0. */
struct Circle {
  double speed_mps, yaw_rate_rps, slip_rad;
  Eigen::Vector3d p_body_antenna_m;

  explicit Circle(Random& rnd)
      : speed_mps(rnd.uniform(5, 70)),
        yaw_rate_rps(rnd.uniform(0.01, 0.5) * rnd.oneOf({-1., 1.})),
        slip_rad(rnd.uniform(-0.03, 0.03)),
        p_body_antenna_m(rnd.vectorWithin(2)) {}

  /** The rear axle goes along the tangent; the heading is the course less the slip. */
  [[nodiscard]] Pose at(double t_s) const {
    const double radius_m = speed_mps / yaw_rate_rps, course_rad = yaw_rate_rps * t_s;
    return poseFromRpy({radius_m * std::sin(course_rad), radius_m * (1 - std::cos(course_rad)), 0}, 0, 0,
                       course_rad - slip_rad);
  }
  [[nodiscard]] GpsFix fixAt(double t_s, double sigma_m = 0.01) const {
    return {t_s,
            "gps_left",
            at(t_s) * p_body_antenna_m,
            sigma_m * sigma_m * Eigen::Matrix3d::Identity(),
            p_body_antenna_m,
            4};
  }
  [[nodiscard]] CarMotion motionAt(double t_s) const { return {at(t_s).linear(), yaw_rate_rps, slip_rad}; }
};

InsPose insOf(const Circle& circle, double t_s, double heading_sigma_rad) {
  Matrix6d covariance = Matrix6d::Identity();
  covariance(2, 2) = heading_sigma_rad * heading_sigma_rad;
  return {t_s, "gps_left", circle.at(t_s), covariance};
}

TEST(ReceiversProperty, TheCourseOfTwoFixesIsTheHeadingThatTheCarHas) {
  forAll(kSeeds, [](Random& rnd) {
    const Circle circle(rnd);
    Receivers receivers{LocalizerPolicy{}};
    (void)receivers.take(circle.fixAt(1), circle.motionAt(1));
    const double t_s = 1 + kPeriod_s;
    const auto fix = receivers.take(circle.fixAt(t_s), circle.motionAt(t_s));
    ASSERT_TRUE(fix);
    EXPECT_EQ(fix->heading, HeadingKind::course);
    // Exact on a circle but for the rounding of its radius, of 7 km at most, over the turn between two fixes.
    EXPECT_NEAR(wrapAngle(fix->heading_rad - yawOf(circle.at(t_s))), 0, 1e-12);
    const Eigen::Vector2d p_map_m =
        circle.at(t_s).translation().head<2>() + Eigen::Rotation2Dd(yawOf(circle.at(t_s))) * fix->p_body_m;
    EXPECT_LT((p_map_m - fix->p_map_m).norm(), kRounding_m);
    // The errors of both fixes across the chord, and what the policy adds.
    const double noise_rad = std::sqrt(2.) * 0.01 / (circle.speed_mps * kPeriod_s);
    EXPECT_NEAR(fix->heading_sigma_rad, std::hypot(LocalizerPolicy{}.course_sigma_deg * kDegree, noise_rad),
                1e-4 * noise_rad);  // by which a chord is shorter than its arc
  });
}

TEST(ReceiversProperty, TheLeverLiesInThePlaneAsTheCarLeans) {
  forAll(kSeeds, [](Random& rnd) {
    const Pose T_map_body = poseFromRpy(rnd.vectorWithin(100), rnd.uniform(-0.4, 0.4), rnd.uniform(-0.2, 0.2),
                                        rnd.uniform(-3, 3));
    const Eigen::Vector3d p_body_m = rnd.vectorWithin(2);
    Receivers receivers{LocalizerPolicy{}};
    const auto fix =
        receivers.take(GpsFix{1, "gps_left", T_map_body * p_body_m, Eigen::Matrix3d::Identity(), p_body_m, 4},
                       {T_map_body.linear(), 0, 0});
    ASSERT_TRUE(fix);
    EXPECT_EQ(fix->heading, HeadingKind::none);
    const Eigen::Vector2d p_map_m =
        T_map_body.translation().head<2>() + Eigen::Rotation2Dd(yawOf(T_map_body)) * fix->p_body_m;
    EXPECT_LT((p_map_m - fix->p_map_m).norm(), kRounding_m);
  });
}

TEST(ReceiversProperty, AnInsOfTheSameEpochIsTheHeadingAndNoBetterThanAnyIs) {
  forAll(kSeeds, [](Random& rnd) {
    const Circle circle(rnd);
    Receivers receivers{LocalizerPolicy{}};
    (void)receivers.take(circle.fixAt(1), circle.motionAt(1));
    const double t_s = 1 + kPeriod_s, claimed_rad = rnd.oneOf({1e-6, 0.01});
    receivers.take(insOf(circle, t_s, claimed_rad));
    const auto fix = receivers.take(circle.fixAt(t_s), {std::nullopt, 0, 0});
    ASSERT_TRUE(fix);
    EXPECT_EQ(fix->heading, HeadingKind::body);
    EXPECT_DOUBLE_EQ(fix->heading_rad, yawOf(circle.at(t_s)));
    EXPECT_DOUBLE_EQ(fix->heading_sigma_rad, std::max(claimed_rad, 1e-3));
    ASSERT_TRUE(receivers.place());
    EXPECT_LT((receivers.place()->T_map_body.matrix() - circle.at(t_s).matrix()).norm(), kRounding_m);
  });
}

TEST(Receivers, BeforeTheStartAFixWithoutAHeadingSaysNothing) {
  Random rnd(1);
  const Circle circle(rnd);
  const CarMotion unknown{std::nullopt, 0, 0};
  Receivers receivers{LocalizerPolicy{}};
  EXPECT_FALSE(receivers.take(circle.fixAt(1), unknown));  // the first of all
  EXPECT_FALSE(receivers.place());
  constexpr double kLater_s = 3;  // too long ago to make a chord of
  EXPECT_FALSE(receivers.take(circle.fixAt(kLater_s), unknown));
  EXPECT_TRUE(receivers.take(circle.fixAt(kLater_s + kPeriod_s), unknown));
  ASSERT_TRUE(receivers.place());
  EXPECT_EQ(receivers.place()->receiver, "gps_left");
  EXPECT_EQ(receivers.place()->first_fix_s, kLater_s + kPeriod_s);
}

/** Of the second of two fixes of so large an error. */
HeadingKind headingOfTwoFixes(const Circle& circle, double sigma_m) {
  Receivers receivers{LocalizerPolicy{}};
  (void)receivers.take(circle.fixAt(1, sigma_m), circle.motionAt(1));
  return receivers.take(circle.fixAt(1 + kPeriod_s, sigma_m), circle.motionAt(1 + kPeriod_s)).value().heading;
}

TEST(Receivers, ACarThatIsTooSlowHasNoCourse) {
  Random rnd(1);
  Circle circle(rnd);
  constexpr double kSure_m = 1e-4;  // so that nothing but the speed speaks against it
  EXPECT_EQ(headingOfTwoFixes(circle, kSure_m), HeadingKind::course);
  circle.speed_mps = 0.5 * LocalizerPolicy{}.min_course_speed_mps;
  EXPECT_EQ(headingOfTwoFixes(circle, kSure_m), HeadingKind::none);
}

TEST(Receivers, FixesThatAreWorthLessThanTheirChordHaveNoCourse) {
  Random rnd(1);
  const Circle circle(rnd);
  EXPECT_EQ(headingOfTwoFixes(circle, circle.speed_mps * kPeriod_s), HeadingKind::none);
}

TEST(Receivers, WhatComesLateIsHeardButIsNotThePlace) {
  Random rnd(1);
  const Circle circle(rnd);
  Receivers receivers{LocalizerPolicy{}};
  const double early_s = 1, late_s = 1 + kPeriod_s;
  receivers.take(insOf(circle, late_s, 0.01));
  ASSERT_TRUE(receivers.take(circle.fixAt(late_s), circle.motionAt(late_s)));
  receivers.take(insOf(circle, early_s, 0.01));
  const auto fix = receivers.take(circle.fixAt(early_s), circle.motionAt(early_s));
  ASSERT_TRUE(fix);
  EXPECT_EQ(fix->heading, HeadingKind::body);
  EXPECT_EQ(receivers.place()->stamp_s, late_s);
}

TEST(Receivers, NoneIsBelievedToBeBetterThanThePolicySays) {
  Random rnd(1);
  const Circle circle(rnd);
  Receivers receivers{LocalizerPolicy{}};
  const auto fix = receivers.take(circle.fixAt(1, 1e-4), circle.motionAt(1));
  ASSERT_TRUE(fix);
  const double least_m2 = std::pow(LocalizerPolicy{}.gps_min_sigma_m, 2);
  EXPECT_GE(fix->cov_p_m2(0, 0), least_m2);
  EXPECT_GE(fix->cov_p_m2(1, 1), least_m2);
}

}  // namespace
}  // namespace raceloc
