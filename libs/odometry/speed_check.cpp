#include "odometry/speed_check.h"

#include <cmath>

namespace raceloc {

namespace {

constexpr double kForceError_mps2 = 0.5;         // bias of the sensor, a grade of 5 %
constexpr double kForceErrorWalk_mps2 = 0.3;     // in a second
constexpr double kForceNoise_mps2 = 0.5;         // white, at 100 Hz
constexpr double kHardestWithoutForce_mps2 = 8;  // a racing car brakes harder, but not for long
constexpr double kBeyondChance = 25;             // 5 sigma, squared
constexpr double kAgreement = 4;                 // 2 sigma, squared
constexpr int kAgreedForLong = 10;

}  // namespace

bool SpeedCheck::accept(double stamp_s, double wheel_mps, double wheel_sigma_mps,
                        std::optional<double> force_mps2, bool repeated) {
  const double variance = wheel_sigma_mps * wheel_sigma_mps;
  if (!x_last_s) {
    x_mean << wheel_mps, 0;
    x_covariance << variance, 0, 0, kForceError_mps2 * kForceError_mps2;
    x_last_s = stamp_s;
    return true;
  }
  predict(stamp_s - *x_last_s, force_mps2);
  x_last_s = stamp_s;
  const double off_mps = wheel_mps - x_mean(0);
  const double chance = off_mps * off_mps / (x_covariance(0, 0) + variance);
  x_agreed_in_a_row = chance < kAgreement ? x_agreed_in_a_row + 1 : 0;
  x_refusing = x_refusing ? x_agreed_in_a_row < kAgreedForLong : chance > kBeyondChance;
  if (x_refusing) return false;
  if (!repeated) update(wheel_mps, variance);
  return true;
}

void SpeedCheck::observe(double speed_mps, double sigma_mps) {
  if (x_last_s) update(speed_mps, sigma_mps * sigma_mps);
}

void SpeedCheck::predict(double step_s, std::optional<double> force_mps2) {
  Eigen::Matrix2d A = Eigen::Matrix2d::Identity();
  Eigen::Matrix2d noise = Eigen::Matrix2d::Zero();
  noise(1, 1) = kForceErrorWalk_mps2 * kForceErrorWalk_mps2 * step_s;
  if (force_mps2) {
    A(0, 1) = -step_s;
    x_mean(0) += step_s * (*force_mps2 - x_mean(1));
    noise(0, 0) = kForceNoise_mps2 * kForceNoise_mps2 * 0.01 * step_s;
  } else {
    // A speed that changes at an unknown constant rate until it is seen again, not a random walk.
    const double grown_mps = std::sqrt(x_covariance(0, 0)) + kHardestWithoutForce_mps2 * step_s;
    noise(0, 0) = grown_mps * grown_mps - x_covariance(0, 0);
  }
  x_covariance = A * x_covariance * A.transpose() + noise;
}

void SpeedCheck::update(double speed_mps, double variance) {
  const Eigen::Vector2d gain = x_covariance.col(0) / (x_covariance(0, 0) + variance);
  x_mean += gain * (speed_mps - x_mean(0));
  Eigen::Matrix2d rest = Eigen::Matrix2d::Identity();
  rest.col(0) -= gain;
  x_covariance = rest * x_covariance * rest.transpose() + variance * gain * gain.transpose();
}

}  // namespace raceloc
