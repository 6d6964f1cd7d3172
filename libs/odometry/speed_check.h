/** \file
 * Whether the wheels turn as fast as the car moves. */
#pragma once

#include <Eigen/Core>
#include <cmath>
#include <optional>

namespace raceloc {

/** The speed that force and scan matches make likely: a Kalman filter over speed and the error of the force along the
 * car (bias, grade). A wheel speed beyond chance (locked, spinning, frozen) is refused; wheels that were refused are
 * believed again only when they have agreed well for a while, because what is likely becomes vague without them. A
 * number that repeats is no new measurement: a frozen speed would pull what is likely along with it. */
class SpeedCheck {
 public:
  /** The next wheel speed, in order of time. \param force_mps2 along the car, mean since the last one; none: unknown
   * \param repeated the same number as the one before
   * \return whether it may be believed; a refused one leaves the filter as it was */
  bool accept(double stamp_s, double wheel_mps, double wheel_sigma_mps, std::optional<double> force_mps2,
              bool repeated);

  /** A speed by other means, of an instant not long before the last wheel speed. */
  void observe(double speed_mps, double sigma_mps);

  [[nodiscard]] double speed_mps() const { return x_mean(0); }
  [[nodiscard]] double sigma_mps() const { return std::sqrt(x_covariance(0, 0)); }

 private:
  void predict(double step_s, std::optional<double> force_mps2);
  void update(double speed_mps, double variance);

  std::optional<double> x_last_s;
  bool x_refusing = false;
  int x_agreed_in_a_row = 0;
  Eigen::Vector2d x_mean = Eigen::Vector2d::Zero();  ///< speed [m/s], force's error [m/s^2]
  Eigen::Matrix2d x_covariance = Eigen::Matrix2d::Zero();
};

}  // namespace raceloc
