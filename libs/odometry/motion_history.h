/** \file
 * Dead reckoning from gyro, wheel speed and steering, over any interval of the recent past. */
#pragma once

#include <array>
#include <optional>
#include <string>
#include <vector>

#include "cloud/deskew.h"
#include "core/options.h"
#include "core/samples.h"
#include "core/time_series.h"
#include "core/types.h"
#include "odometry/motion_calibration.h"
#include "odometry/preintegration.h"
#include "odometry/speed_check.h"
#include "odometry/suspension.h"

namespace raceloc {

/** Section [motion]. */
struct MotionOptions {
  double memory_s = 5.0;
  double max_gap_s = 0.5;
  double wheelbase_m = 2.97;
  double gyro_sigma_dps = 0.2;
  double vehicle_yaw_rate_sigma_dps = 0.5;
  double steering_sigma_deg = 0.2;
  double understeer_deg_per_mps2 = 0.2;
  double speed_sigma_mps = 0.5;
  double crosswise_sigma_mps = 0.8;
  double out_of_road_sigma_mps = 3.0;
  double unknown_tilt_rate_dps = 15;
  double drag_per_m = 6e-4;
  double downforce_per_m = 1.4e-3;
  double load_lag_s = 1.0;
  double fastest_heave_mps = 1.5;
  void describe(OptionList& keys);
};

/** The last seconds of what the car says of its motion.
 *
 * Rotation: the gyro, less its bias. About the body's z axis it is blended, by inverse variances, with the car's own
 * yaw rate and with the bicycle model v tan(steering) / wheelbase, whose variance grows with the lateral
 * acceleration; each may be absent, and any one of them carries the yaw rate alone; one that contradicts the gyro is
 * left out, as is the gyro when both of the others contradict it, unless all they say is one message that repeats.
 * Translation: wheel speed, less the slip that traction needs, along the rear axle's course, which lies off the
 * heading by side-slip; both are in proportion to the force that the tyres bear over their load. Never from
 * acceleration, but for how the body swings along its own z axis (Suspension); by what slow angle its course lies above
 * its x axis, scan matches teach. While the wheels are silent, the speed of the newest observe() goes on.
 * A gyro that repeats itself while the car moves, whole or on an axis that turns fast (saturated), and a wheel speed
 * that neither force nor scan matches can explain, are dropped and named; so is, for the swings, an IMU by which
 * the car would leave the road. Source: reading.md section 5. */
class MotionHistory {
 public:
  explicit MotionHistory(const MotionOptions& options, const CalibrationOptions& calibration = {});

  /** Samples come in order of time; one that is older than the newest of its kind, or not finite, is ignored. */
  void add(const MotionSample& sample);
  void add(const ImuSample& sample);

  /** Stamp up to which motion is known; none before the first speed. A source that is silent or frozen is not waited
   * for. */
  [[nodiscard]] std::optional<double> knownUntil_s() const;

  /** Rates averaged over [from, to]; held constant for at most max_gap_s beyond the samples. None when the
   * interval is not covered. `to_s` may equal `from_s`. */
  struct Rates {
    double speed_mps, yaw_rate_rps;
  };
  [[nodiscard]] std::optional<Rates> ratesBetween(double from_s, double to_s) const;

  /** Twist of the body, origin at the rear axle, at an instant. None when it is not covered. */
  [[nodiscard]] std::optional<BodyRates> ratesAt(double stamp_s) const;

  /** The body's motion from one instant to a later one. Rates are constant within the cells of a fixed grid of 5 ms,
   * so that an interval may be cut anywhere. None when the interval is not covered. */
  [[nodiscard]] std::optional<Preintegration> preintegrated(double from_s, double to_s) const;

  /** Poses over a sweep, for deskew(). None when it is not covered. */
  [[nodiscard]] std::optional<SweepPoses> sweep(double begin_s, double end_s) const;

  /** As preintegrated(); the covariance is of noise and calibration. */
  [[nodiscard]] std::optional<BodyMotion> between(double from_s, double to_s) const;

  /** What the accelerometer felt over an interval, in the body's axes at its begin, where R(t) leads from those at t.
   * */
  struct Impulse {
    Eigen::Vector3d impulse_mps;  ///< integral of R f
    Eigen::Matrix3d turned_s;     ///< integral of R
  };
  /** None when the interval is not covered, or the accelerometer was silent in it. */
  [[nodiscard]] std::optional<Impulse> impulse(double from_s, double to_s) const;
  [[nodiscard]] const Eigen::Vector3d& p_body_imu_m() const { return x_p_body_imu_m; }

  /** A motion that was measured by other means, or mostly so: teaches the calibration, checks the wheels and, while they
   * are silent, tells the speed. Nothing if `to_s` is not later than `from_s`. \param covariance of the right increment (rad, m),
   * positive definite */
  void observe(double from_s, double to_s, const Pose& T_from_to, const Matrix6d& covariance);

  [[nodiscard]] const MotionCalibration& calibration() const { return x_calibration; }

  /** Whether the wheels tell the speed at an instant, or did not long before. */
  [[nodiscard]] bool hasWheels(double stamp_s) const;

  /** Names of the sources that are dropped or silent now, and why; empty when all is well. */
  [[nodiscard]] std::vector<std::string> faults() const;

 private:
  /** What the tyres bear at an instant, per mass [m/s^2]: across the car, and along it on the driven axle; both over
   * the load in g. Without an accelerometer, what speed and yaw rate tell. */
  struct TyreForces {
    double along_mps2, across_mps2, load;
  };
  [[nodiscard]] TyreForces tyreForces(double stamp_s, double speed_mps, double yaw_rate_rps) const;
  using YawJacobian = Eigen::Matrix<double, 1, kCalibrations>;
  struct YawRate {
    double rate_rps, sigma_rps;
    YawJacobian J;
  };
  enum YawSource { kGyro, kVehicle, kBicycle, kYawSources };
  using YawRates = std::array<std::optional<YawRate>, kYawSources>;
  /** What each source says, without those that the others contradict. */
  [[nodiscard]] YawRates yawRates(double stamp_s, double speed_mps, double lateral_mps2) const;
  [[nodiscard]] static std::optional<YawRate> blended(const YawRates& rates);
  /** Calls `take(rates, step_s)` for the cells of an interval. \return whether all of it is covered */
  template <class Take>
  bool forCells(double from_s, double to_s, const Take& take) const;
  [[nodiscard]] std::optional<double> meanForce(double from_s, double to_s) const;

  MotionOptions x_options;
  MotionCalibration x_calibration;
  SpeedCheck x_speed_check;
  TimeSeries<Eigen::Vector3d> x_gyro_rps, x_force_mps2;
  TimeSeries<Eigen::Vector2d>
      x_speed;  ///< measured or, where it was refused or silent, likely [m/s]; its variance
  TimeSeries<double> x_vehicle_yaw_rate_rps, x_steering_rad;
  Suspension x_suspension;
  std::optional<double> x_last_imu_s, x_last_wheels_s, x_same_gyro_since_s;
  Eigen::Vector3d x_last_gyro_rps = Eigen::Vector3d::Zero(), x_p_body_imu_m = Eigen::Vector3d::Zero();
  int x_same_gyro = 0;
  std::optional<MotionSample> x_last_vehicle;
  double x_same_vehicle_since_s = 0;
  std::string x_imu_label, x_vehicle_label;
  bool x_wheels_refused = false, x_gyro_frozen = false;
};

}  // namespace raceloc
