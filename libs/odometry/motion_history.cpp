#include "odometry/motion_history.h"

#include <cmath>

namespace raceloc {

namespace {

/** Cells of constant rates. */
constexpr double kCell_s = 0.005;

/** A gyro that gives the same three numbers for so many samples and so long is frozen, if the car moves; one that
 * gives the same number on an axis, and more than a car turns for long, is saturated. */
constexpr int kFrozenSamples = 10;
constexpr double kFrozen_s = 0.1, kMoving_mps = 1, kSaturable_rps = 1;

bool isStuck(const Eigen::Vector3d& now_rps, const Eigen::Vector3d& before_rps) {
  const auto same = now_rps.array() == before_rps.array();
  return same.all() || (same && now_rps.array().abs() > kSaturable_rps).any();
}

/** What an observed speed misses when it goes on. */
constexpr double kHardestBraking_mps2 = 30;

}  // namespace

void MotionOptions::describe(OptionList& keys) {
  keys.add("memory_s", memory_s, between(1, 60), "how long the sources of motion are remembered [s]");
  keys.add("max_gap_s", max_gap_s, between(0, 5), "a source is held this long when samples are missing [s]");
  keys.add("wheelbase_m", wheelbase_m, above(0), "between the axles [m]");
  keys.add("gyro_sigma_dps", gyro_sigma_dps, above(0), "error of the gyro, white at 100 Hz [deg/s]");
  keys.add("vehicle_yaw_rate_sigma_dps", vehicle_yaw_rate_sigma_dps, above(0),
           "error of the car's own yaw rate, white at 100 Hz [deg/s]");
  keys.add("steering_sigma_deg", steering_sigma_deg, above(0),
           "error of the steering, of the road wheels [deg]");
  keys.add("understeer_deg_per_mps2", understeer_deg_per_mps2, atLeast(0),
           "what slip may add to the steering, against the lateral force [deg per m/s^2]");
  keys.add("speed_sigma_mps", speed_sigma_mps, above(0), "error of the wheel speed, white at 100 Hz [m/s]");
  keys.add("crosswise_sigma_mps", crosswise_sigma_mps, above(0),
           "error of the velocity across the car and out of the road, white at 100 Hz [m/s]");
  keys.add("out_of_road_sigma_mps", out_of_road_sigma_mps, above(0),
           "error of no velocity out of the road, white at 100 Hz, to which the accelerometer is held; "
           "larger: slower "
           "swings of the body are followed, and the accelerometer's drift too [m/s]");
  keys.add("unknown_tilt_rate_dps", unknown_tilt_rate_dps, above(0),
           "roll and pitch rates without a gyro, white at 100 Hz [deg/s]");
  keys.add("drag_per_m", drag_per_m, atLeast(0), "deceleration by drag over the speed squared [1/m]");
  keys.add("downforce_per_m", downforce_per_m, atLeast(0),
           "downforce on the rear axle per mass that it carries, over the speed squared [1/m]");
  keys.add("load_lag_s", load_lag_s, above(0), "slip follows the load of the tyres with this lag [s]");
  keys.add("fastest_heave_mps", fastest_heave_mps, above(0),
           "an accelerometer by which the body swings faster is not believed of it for half a minute [m/s]");
}

MotionHistory::MotionHistory(const MotionOptions& options, const CalibrationOptions& calibration)
    : x_options(options),
      x_calibration(calibration),
      x_gyro_rps(options.memory_s, options.max_gap_s),
      x_force_mps2(options.memory_s, options.max_gap_s),
      x_speed(options.memory_s, options.max_gap_s),
      x_vehicle_yaw_rate_rps(options.memory_s, options.max_gap_s),
      x_steering_rad(options.memory_s, options.max_gap_s),
      x_suspension({options.memory_s, options.max_gap_s, options.load_lag_s, options.crosswise_sigma_mps,
                    options.out_of_road_sigma_mps, options.fastest_heave_mps}) {}

void MotionHistory::add(const MotionSample& sample) {
  if (!std::isfinite(sample.speed_mps) || !std::isfinite(sample.yaw_rate_rps)) return;
  if (x_last_wheels_s && sample.stamp_s <= *x_last_wheels_s) return;
  const auto force_mps2 = x_last_wheels_s ? meanForce(*x_last_wheels_s, sample.stamp_s) : std::nullopt;
  x_last_wheels_s = sample.stamp_s;
  // The driven wheels slip by a percent.
  const double sigma_mps = std::hypot(x_options.speed_sigma_mps, 0.01 * sample.speed_mps);
  const TyreForces tyres = tyreForces(sample.stamp_s, sample.speed_mps, sample.yaw_rate_rps);
  const CalibrationVector& c = x_calibration.mean();
  const double scale = 1 + c(kWheelScale) - c(kTraction) * tyres.along_mps2;
  const bool same_speed = x_last_vehicle && sample.speed_mps == x_last_vehicle->speed_mps;
  x_wheels_refused =
      !x_speed_check.accept(sample.stamp_s, scale * sample.speed_mps, sigma_mps, force_mps2, same_speed);
  const bool same = same_speed && sample.yaw_rate_rps == x_last_vehicle->yaw_rate_rps &&
                    sample.steering_rad == x_last_vehicle->steering_rad;
  if (!same) x_same_vehicle_since_s = sample.stamp_s;
  x_last_vehicle = sample;
  // What is refused is filled in as measured: the calibration's scale applies to it as well.
  x_speed.add(sample.stamp_s,
              x_wheels_refused
                  ? Eigen::Vector2d(x_speed_check.speed_mps() / scale, std::pow(x_speed_check.sigma_mps(), 2))
                  : Eigen::Vector2d(sample.speed_mps, std::pow(x_options.speed_sigma_mps, 2)));
  x_vehicle_yaw_rate_rps.add(sample.stamp_s, sample.yaw_rate_rps);
  if (sample.steering_rad && std::isfinite(*sample.steering_rad))
    x_steering_rad.add(sample.stamp_s, *sample.steering_rad);
  x_vehicle_label = sample.label;
}

void MotionHistory::add(const ImuSample& sample) {
  if (!sample.gyro_body_rps.allFinite() || !sample.specific_force_body_mps2.allFinite()) return;
  if (x_last_imu_s && sample.stamp_s <= *x_last_imu_s) return;
  const bool same = x_last_imu_s && isStuck(sample.gyro_body_rps, x_last_gyro_rps);
  x_last_imu_s = sample.stamp_s;
  x_imu_label = sample.label;
  x_p_body_imu_m = sample.p_body_imu_m;
  if (!same) {
    x_same_gyro = 0;
    x_same_gyro_since_s = sample.stamp_s;
  }
  x_last_gyro_rps = sample.gyro_body_rps;
  ++x_same_gyro;
  const auto speed = x_speed.at(sample.stamp_s);
  x_gyro_frozen = x_same_gyro > kFrozenSamples && sample.stamp_s - *x_same_gyro_since_s > kFrozen_s &&
                  speed && speed->x() > kMoving_mps;
  if (x_gyro_frozen) {  // what it said since then was no measurement either
    x_gyro_rps.dropSince(*x_same_gyro_since_s);
    x_force_mps2.dropSince(*x_same_gyro_since_s);
    x_suspension.dropSince(*x_same_gyro_since_s);
    return;
  }
  x_gyro_rps.add(sample.stamp_s, sample.gyro_body_rps);
  x_force_mps2.add(sample.stamp_s, sample.specific_force_body_mps2);
  std::optional<HeaveVelocity::OnRoad> road;
  if (const auto rates = ratesAt(sample.stamp_s))
    road = {rates->twist(3), rates->twist(4), std::sqrt(rates->noise_density(3) / kSample_s)};
  x_suspension.add(sample, road);
}

bool MotionHistory::hasWheels(double stamp_s) const {
  return x_last_wheels_s && stamp_s - *x_last_wheels_s <= x_options.max_gap_s;
}

std::vector<std::string> MotionHistory::faults() const {
  std::vector<std::string> faults;
  if (x_gyro_frozen) faults.push_back(x_imu_label + ": gyro frozen or saturated");
  if (x_suspension.contradictsRoad())
    faults.push_back(x_imu_label + ": gyro or accelerometer contradicts the road");
  if (x_wheels_refused) faults.push_back(x_vehicle_label + ": wheel speed contradicts the car's motion");
  if (x_last_imu_s && x_last_wheels_s) {
    if (*x_last_wheels_s - *x_last_imu_s > x_options.max_gap_s) faults.push_back(x_imu_label + ": silent");
    if (!hasWheels(*x_last_imu_s)) faults.push_back(x_vehicle_label + ": silent");
  }
  return faults;
}

std::optional<double> MotionHistory::knownUntil_s() const {
  if (x_speed.samples().empty()) return std::nullopt;
  const double speed_s = x_speed.samples().back().stamp_s;
  if (x_gyro_frozen || x_gyro_rps.samples().empty()) return speed_s;
  const double gyro_s = x_gyro_rps.samples().back().stamp_s;
  if (!hasWheels(gyro_s)) return gyro_s;
  return speed_s - gyro_s < x_options.max_gap_s ? std::min(speed_s, gyro_s) : speed_s;
}

std::optional<double> MotionHistory::meanForce(double from_s, double to_s) const {
  const auto begin = x_force_mps2.at(from_s), end = x_force_mps2.at(to_s);
  if (!begin || !end) return std::nullopt;
  double sum = 0;
  int count = 0;
  const auto samples = x_force_mps2.samples();
  for (auto it = samples.end(); it != samples.begin() && (--it)->stamp_s > from_s;)
    if (it->stamp_s <= to_s) sum += it->value.x(), ++count;
  return count > 0 ? sum / count : 0.5 * (begin->x() + end->x());
}

MotionHistory::YawRates MotionHistory::yawRates(double stamp_s, double speed_mps, double lateral_mps2) const {
  const CalibrationVector& c = x_calibration.mean();
  constexpr double kYawAcceleration_rps2 = 1;  // what a held rate may have missed
  const auto sigma = [](double at_best_rps, double held_s) {
    return std::hypot(at_best_rps, kYawAcceleration_rps2 * held_s);
  };
  YawRates rates;
  if (const auto gyro = x_gyro_rps.at(stamp_s)) {
    rates[kGyro] = {gyro->z() - c(kGyroBiasZ),
                    sigma(kDegree * x_options.gyro_sigma_dps, x_gyro_rps.held_s(stamp_s)),
                    YawJacobian::Zero()};
    rates[kGyro]->J(kGyroBiasZ) = -1;
  }
  if (const auto own = x_vehicle_yaw_rate_rps.at(stamp_s))
    rates[kVehicle] = {
        *own, sigma(kDegree * x_options.vehicle_yaw_rate_sigma_dps, x_vehicle_yaw_rate_rps.held_s(stamp_s)),
        YawJacobian::Zero()};
  if (const auto steering = x_steering_rad.at(stamp_s)) {
    const double per_rad = speed_mps / x_options.wheelbase_m;
    const double tangent = std::tan(*steering - c(kSteeringOffset));
    const double slip_rad = kDegree * x_options.understeer_deg_per_mps2 * lateral_mps2;
    const double sigma_rad = std::hypot(kDegree * x_options.steering_sigma_deg, slip_rad);
    constexpr double kStanding_rps = 1e-3;  // at rest the model is exact, but nothing is so exact
    rates[kBicycle] = {per_rad * tangent, std::hypot(per_rad * sigma_rad, kStanding_rps),
                       YawJacobian::Zero()};
    rates[kBicycle]->J(kSteeringOffset) = -per_rad * (1 + tangent * tangent);
  }
  const auto contradict = [&](YawSource a, YawSource b) {
    if (!rates[a] || !rates[b]) return false;
    const Eigen::Matrix<double, 1, kCalibrations> J = rates[a]->J - rates[b]->J;
    const double variance = std::pow(rates[a]->sigma_rps, 2) + std::pow(rates[b]->sigma_rps, 2) +
                            J.dot(J * x_calibration.covariance());
    constexpr double kBeyondChance = 25;  // 5 sigma, squared
    return std::pow(rates[a]->rate_rps - rates[b]->rate_rps, 2) > kBeyondChance * variance;
  };
  const bool vehicle_off = contradict(kGyro, kVehicle), bicycle_off = contradict(kGyro, kBicycle);
  const bool one_voice = x_last_vehicle && x_last_vehicle->stamp_s - x_same_vehicle_since_s > kFrozen_s;
  if (vehicle_off && bicycle_off && !one_voice && !contradict(kVehicle, kBicycle)) {
    rates[kGyro].reset();
  } else {
    if (vehicle_off) rates[kVehicle].reset();
    if (bicycle_off || contradict(kVehicle, kBicycle)) rates[kBicycle].reset();
  }
  return rates;
}

std::optional<MotionHistory::YawRate> MotionHistory::blended(const YawRates& rates) {
  double information = 0;
  YawRate sum{0, 0, YawJacobian::Zero()};
  for (const auto& rate : rates) {
    if (!rate) continue;
    const double weight = 1 / (rate->sigma_rps * rate->sigma_rps);
    information += weight;
    sum.rate_rps += weight * rate->rate_rps;
    sum.J += weight * rate->J;
  }
  if (information == 0) return std::nullopt;
  return YawRate{sum.rate_rps / information, std::sqrt(1 / information), sum.J / information};
}

MotionHistory::TyreForces MotionHistory::tyreForces(double stamp_s, double speed_mps,
                                                    double yaw_rate_rps) const {
  const auto force = x_force_mps2.at(stamp_s);
  const double squared = speed_mps * speed_mps;
  const double weight_mps2 =
      std::max(0.5 * kGravity_mps2, x_suspension.load_mps2(stamp_s).value_or(kGravity_mps2));
  const double load = (weight_mps2 + x_options.downforce_per_m * squared) / kGravity_mps2;
  const double pull_mps2 = (force ? force->x() : 0) + x_options.drag_per_m * squared;
  constexpr double kBrakesOnDrivenAxle = 0.5;  // the engine's pull is all on it
  return {(pull_mps2 < 0 ? kBrakesOnDrivenAxle : 1) * pull_mps2 / load,
          (force ? force->y() : speed_mps * yaw_rate_rps) / load, load};
}

std::optional<BodyRates> MotionHistory::ratesAt(double stamp_s) const {
  const auto speed = x_speed.at(stamp_s);
  if (!speed) return std::nullopt;
  const CalibrationVector& c = x_calibration.mean();
  // The bicycle's variance needs the lateral force before the yaw rate that may have to give it.
  const auto guess = blended(yawRates(stamp_s, speed->x(), 0));
  if (!guess) return std::nullopt;
  const TyreForces tyres = tyreForces(stamp_s, speed->x(), guess->rate_rps);
  const bool by_wheels = hasWheels(stamp_s);
  const double per_measured = by_wheels ? 1 + c(kWheelScale) - c(kTraction) * tyres.along_mps2 : 1;
  const double forward_mps = per_measured * speed->x();
  const YawRate yaw = *blended(yawRates(stamp_s, forward_mps, tyres.across_mps2 * tyres.load));

  BodyRates rates;
  const auto gyro = x_gyro_rps.at(stamp_s);
  if (gyro) {
    rates.twist.head<2>() = gyro->head<2>() - c.segment<2>(kGyroBiasX);
    rates.J_calibration(0, kGyroBiasX) = rates.J_calibration(1, kGyroBiasY) = -1;
  }
  const double slip_rad = -c(kSideslip) * tyres.across_mps2;
  const Eigen::Vector3d along(1, slip_rad, c(kRise));
  rates.twist.tail<3>() = forward_mps * along + Eigen::Vector3d(0, 0, x_suspension.heave_mps(stamp_s));
  rates.twist(2) = yaw.rate_rps;
  rates.J_calibration.row(2) = yaw.J;
  if (by_wheels) {
    rates.J_calibration.block<3, 1>(3, kWheelScale) = speed->x() * along;
    rates.J_calibration.block<3, 1>(3, kTraction) = -tyres.along_mps2 * speed->x() * along;
  }
  rates.J_calibration(4, kSideslip) = -tyres.across_mps2 * forward_mps;
  rates.J_calibration(5, kRise) = forward_mps;
  // White noise of samples at 100 Hz; a gyro that is read less often misses how the body shakes in between.
  constexpr double kMissesAll_s = 0.1;
  const double missed = gyro ? std::min(1.0, std::pow(x_gyro_rps.spacing_s(stamp_s) / kMissesAll_s, 2)) : 1;
  const double tilt = std::pow(kDegree * x_options.gyro_sigma_dps, 2) +
                      missed * std::pow(kDegree * x_options.unknown_tilt_rate_dps, 2);
  const double crosswise = std::pow(x_options.crosswise_sigma_mps, 2);
  rates.noise_density << tilt, tilt, yaw.sigma_rps * yaw.sigma_rps, speed->y(), crosswise, crosswise;
  rates.noise_density *= kSample_s;
  return rates;
}

template <class Take>
bool MotionHistory::forCells(double from_s, double to_s, const Take& take) const {
  if (!ratesAt(from_s) || !ratesAt(to_s)) return false;
  auto cell = static_cast<std::int64_t>(std::floor(from_s / kCell_s));
  for (double at_s = from_s; at_s < to_s; ++cell) {
    const double end_s = std::min(to_s, static_cast<double>(cell + 1) * kCell_s);
    if (end_s <= at_s) continue;  // stamps are large: a cell's end may round to its begin
    const auto rates = ratesAt((static_cast<double>(cell) + 0.5) * kCell_s);
    if (!rates) return false;
    take(*rates, end_s - at_s);
    at_s = end_s;
  }
  return true;
}

std::optional<Preintegration> MotionHistory::preintegrated(double from_s, double to_s) const {
  Preintegration motion;
  const bool covered =
      forCells(from_s, to_s, [&](const BodyRates& rates, double step_s) { motion.append(rates, step_s); });
  return covered ? std::optional(motion) : std::nullopt;
}

std::optional<MotionHistory::Rates> MotionHistory::ratesBetween(double from_s, double to_s) const {
  Vector6d sum = Vector6d::Zero();
  double duration_s = 0;
  const bool covered = forCells(from_s, to_s, [&](const BodyRates& rates, double step_s) {
    sum += step_s * rates.twist;
    duration_s += step_s;
  });
  if (!covered) return std::nullopt;
  const Vector6d mean = duration_s > 0 ? Vector6d(sum / duration_s) : ratesAt(from_s)->twist;
  return Rates{mean(3), mean(2)};
}

std::optional<MotionHistory::Impulse> MotionHistory::impulse(double from_s, double to_s) const {
  Impulse felt{Eigen::Vector3d::Zero(), Eigen::Matrix3d::Zero()};
  Eigen::Matrix3d R = Eigen::Matrix3d::Identity();
  double at_s = from_s;
  bool silent = false;
  const bool covered = forCells(from_s, to_s, [&](const BodyRates& rates, double step_s) {
    Vector6d half = Vector6d::Zero();
    half.head<3>() = 0.5 * step_s * rates.twist.head<3>();
    const Eigen::Matrix3d R_half = se3Exp(half).linear();
    const Eigen::Matrix3d R_mid = R * R_half;
    const auto force_mps2 = x_force_mps2.at(at_s + 0.5 * step_s);
    silent = silent || !force_mps2;
    if (force_mps2) felt.impulse_mps += step_s * (R_mid * *force_mps2);
    felt.turned_s += step_s * R_mid;
    R = R_mid * R_half;
    at_s += step_s;
  });
  return covered && !silent ? std::optional(felt) : std::nullopt;
}

std::optional<SweepPoses> MotionHistory::sweep(double begin_s, double end_s) const {
  SweepPoses poses;
  poses.front().setIdentity();
  const double step_s = (end_s - begin_s) / kSweepSteps;
  for (int k = 0; k < kSweepSteps; ++k) {
    const auto step = preintegrated(begin_s + k * step_s, begin_s + (k + 1) * step_s);
    if (!step) return std::nullopt;
    const auto begin = static_cast<std::size_t>(k);
    poses[begin + 1] = poses[begin] * step->T_start_end;
  }
  return poses;
}

std::optional<BodyMotion> MotionHistory::between(double from_s, double to_s) const {
  const auto motion = preintegrated(from_s, to_s);
  if (!motion) return std::nullopt;
  const CalibrationJacobian& J = motion->J_calibration;
  return BodyMotion{motion->duration_s, motion->T_start_end,
                    motion->covariance + J * x_calibration.covariance() * J.transpose()};
}

void MotionHistory::observe(double from_s, double to_s, const Pose& T_from_to, const Matrix6d& covariance) {
  const double duration_s = to_s - from_s;
  if (!(duration_s > 0)) return;
  const auto motion = preintegrated(from_s, to_s);
  if (motion && !x_wheels_refused) x_calibration.observe(*motion, T_from_to, covariance);
  const double speed_mps = se3Log(T_from_to)(3) / duration_s;
  if (hasWheels(to_s)) {
    // The check stands at the last wheel speed: what came after would count twice when it goes on.
    if (*x_last_wheels_s >= to_s) x_speed_check.observe(speed_mps, std::sqrt(covariance(3, 3)) / duration_s);
    return;
  }
  // As white noise at 100 Hz, which it is not, it moves the end of the next interval as far.
  const double missed_mps = kHardestBraking_mps2 * duration_s;
  x_speed.add(to_s, {speed_mps, missed_mps * missed_mps * duration_s / kSample_s});
}

}  // namespace raceloc
