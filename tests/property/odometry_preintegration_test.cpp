#include <gtest/gtest.h>

#include "odometry/preintegration.h"
#include "support/forall.h"

namespace raceloc {
namespace {

using test::forAll;
using test::Random;

BodyRates ratesOf(Random& rnd) {
  BodyRates rates;
  rates.twist << rnd.normal(0.2), rnd.normal(0.2), rnd.normal(0.5), rnd.uniform(0, 80), rnd.normal(2),
      rnd.normal(1);
  for (int i = 0; i < 6; ++i) rates.noise_density(i) = rnd.uniform(1e-6, 1e-3);
  for (int i = 0; i < 6; ++i)
    for (int k = 0; k < kCalibrations; ++k) rates.J_calibration(i, k) = rnd.normal(1);
  return rates;
}

/** Euler's method in R^3 and on rotation matrices: no exponential of SE(3), and steps of 1 us. */
TEST(PreintegrationProperty, IsWhatDenseIntegrationGives) {
  forAll(10, [](Random& rnd) {
    Preintegration quick;
    Eigen::Matrix3d R = Eigen::Matrix3d::Identity();
    Eigen::Vector3d p = Eigen::Vector3d::Zero();
    for (int k = 0; k < 10; ++k) {
      const BodyRates rates = ratesOf(rnd);
      quick.append(rates, 0.01);
      constexpr int fine = 10000;
      const double dt = 0.01 / fine;
      const Eigen::Vector3d w = rates.twist.head<3>();
      const Eigen::Matrix3d dR = Eigen::AngleAxisd(w.norm() * dt, w.normalized()).toRotationMatrix();
      for (int i = 0; i < fine; ++i) {
        p += R * rates.twist.tail<3>() * dt;
        R = R * dR;
      }
    }
    EXPECT_NEAR(quick.duration_s, 0.1, 1e-12);
    EXPECT_LT((quick.T_start_end.linear() - R).norm(), 1e-10);
    // Euler lags by half a step: 0.5 us of 80 m/s, turned by up to 1 rad/s * 0.1 s.
    EXPECT_LT((quick.T_start_end.translation() - p).norm(), 1e-5);
  });
}

TEST(PreintegrationProperty, JacobianIsTheSlopeByCalibration) {
  forAll(20, [](Random& rnd) {
    std::vector<BodyRates> all;
    for (int k = 0; k < 20; ++k) all.push_back(ratesOf(rnd));
    const auto integrated = [&](const CalibrationVector& change) {
      Preintegration p;
      for (BodyRates rates : all) {
        rates.twist += rates.J_calibration * change;
        p.append(rates, 0.005);
      }
      return p;
    };
    const Preintegration at = integrated(CalibrationVector::Zero());
    for (int k = 0; k < kCalibrations; ++k) {
      constexpr double h = 1e-5;
      const CalibrationVector change = h * CalibrationVector::Unit(k);
      const Vector6d slope = (se3Log(at.T_start_end.inverse() * integrated(change).T_start_end) -
                              se3Log(at.T_start_end.inverse() * integrated(-change).T_start_end)) /
                             (2 * h);
      // Of central differences h^2, of the Jacobian's series (0.005 s * 1 rad/s)^4.
      EXPECT_LT((slope - at.J_calibration.col(k)).norm(), 1e-7 * (1 + slope.norm())) << k;
      EXPECT_LT(se3Log(at.corrected(change).inverse() * integrated(change).T_start_end).norm(), 1e-8);
    }
  });
}

TEST(PreintegrationProperty, CovarianceIsThatOfManyNoisyRuns) {
  Random rnd(7);
  std::vector<BodyRates> all;
  for (int k = 0; k < 20; ++k) all.push_back(ratesOf(rnd));
  Preintegration at;
  for (const BodyRates& rates : all) at.append(rates, 0.005);
  constexpr int runs = 4000;
  Matrix6d sum = Matrix6d::Zero();
  for (int run = 0; run < runs; ++run) {
    Preintegration noisy;
    for (BodyRates rates : all) {
      for (int i = 0; i < 6; ++i) rates.twist(i) += rnd.normal(std::sqrt(rates.noise_density(i) / 0.005));
      noisy.append(rates, 0.005);
    }
    const Vector6d error = se3Log(at.T_start_end.inverse() * noisy.T_start_end);
    sum += error * error.transpose() / runs;
  }
  // A variance from 4000 runs has a sigma of 2.2 %; 5 sigmas.
  for (int i = 0; i < 6; ++i)
    for (int j = 0; j < 6; ++j)
      EXPECT_NEAR(sum(i, j), at.covariance(i, j),
                  0.11 * std::sqrt(at.covariance(i, i) * at.covariance(j, j)));
}

TEST(PreintegrationProperty, GoesOnWhereItWasCut) {
  forAll(20, [](Random& rnd) {
    const BodyRates rates = ratesOf(rnd);
    const double duration_s = rnd.uniform(0.001, 0.02), cut_s = duration_s * rnd.uniform(0, 1);
    Preintegration whole, parts;
    whole.append(rates, duration_s);
    parts.append(rates, cut_s);
    parts.append(rates, duration_s - cut_s);
    EXPECT_LT(se3Log(whole.T_start_end.inverse() * parts.T_start_end).norm(), 1e-12);
    EXPECT_TRUE(whole.J_calibration.isApprox(parts.J_calibration, 1e-6));
  });
}

}  // namespace
}  // namespace raceloc
