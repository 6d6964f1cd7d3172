#include "odometry/levelling.h"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>

namespace raceloc {

namespace {

constexpr double kUnknown_mps = 100;      // any speed of a car
constexpr double kBiasWalk_share = 0.01;  // of its first sigma, in a second

Eigen::Matrix3d diagonal(double variance) { return variance * Eigen::Matrix3d::Identity(); }

}  // namespace

void LevelOptions::describe(OptionList& keys) {
  keys.add("accelerometer_sigma_mps2", accelerometer_sigma_mps2, above(0),
           "error of the accelerometer, white at 100 Hz, vibrations included [m/s^2]");
  keys.add("accelerometer_bias_mps2", accelerometer_bias_mps2, above(0),
           "constant error of the accelerometer, sigma of each axis [m/s^2]");
  keys.add("start_tilt_deg", start_tilt_deg, between(0.1, 45), "roll and pitch at the start, sigma [deg]");
  keys.add("tilt_walk_deg", tilt_walk_deg, above(0), "how the odometry's attitude drifts [deg in a second]");
}

Levelling::Levelling(const LevelOptions& o) : x_options(o) {
  x_mean << Eigen::Vector3d::Zero(), 0, 0, -kGravity_mps2, Eigen::Vector3d::Zero();
  const double tilt_mps2 = kGravity_mps2 * kDegree * o.start_tilt_deg;
  x_covariance.block<3, 3>(kVelocity, kVelocity) = diagonal(kUnknown_mps * kUnknown_mps);
  x_covariance.block<3, 3>(kGravity, kGravity) = diagonal(tilt_mps2 * tilt_mps2);
  x_covariance.block<3, 3>(kBias, kBias) = diagonal(std::pow(o.accelerometer_bias_mps2, 2));
}

template <int N>
void Levelling::update(const Eigen::Matrix<double, N, 1>& z, const Eigen::Matrix<double, N, kStates>& H,
                       const Eigen::Matrix<double, N, N>& R) {
  const Eigen::Matrix<double, N, N> S = H * x_covariance * H.transpose() + R;
  const Eigen::Matrix<double, kStates, N> K = S.ldlt().solve(H * x_covariance).transpose();
  const StateMatrix rest = StateMatrix::Identity() - K * H;
  x_mean += K * (z - H * x_mean);
  x_covariance = rest * x_covariance * rest.transpose() + K * R * K.transpose();
}

void Levelling::add(double from_s, const Eigen::Matrix3d& R_odom_from, const BodyMotion& motion,
                    const MotionHistory& history) {
  if (!(motion.duration_s > 0)) return;
  // The mean velocity over an interval is that of its middle.
  const Vector6d twist = se3Log(motion.T_start_end) / motion.duration_s;
  const Vector6d half = 0.5 * motion.duration_s * twist;
  const Instant now{from_s + 0.5 * motion.duration_s, R_odom_from * se3Exp(half).linear()};

  const auto felt = x_last ? history.impulse(x_last->stamp_s, now.stamp_s) : std::nullopt;
  if (felt) {
    const double dt_s = now.stamp_s - x_last->stamp_s;
    const Eigen::Matrix3d& R = x_last->R_odom_body;
    StateMatrix F = StateMatrix::Identity();
    F.block<3, 3>(kVelocity, kGravity) = diagonal(dt_s);
    F.block<3, 3>(kVelocity, kBias) = -R * felt->turned_s;
    x_mean = F * x_mean;
    x_mean.segment<3>(kVelocity) += R * felt->impulse_mps;
    x_covariance = F * x_covariance * F.transpose();
    const double per_sample = std::pow(x_options.accelerometer_sigma_mps2, 2) * kSample_s;
    x_covariance.block<3, 3>(kVelocity, kVelocity) += diagonal(per_sample * dt_s);
    x_felt_s += dt_s;
  } else {
    x_covariance.middleRows<3>(kVelocity).setZero();
    x_covariance.middleCols<3>(kVelocity).setZero();
    x_covariance.block<3, 3>(kVelocity, kVelocity) = diagonal(kUnknown_mps * kUnknown_mps);
  }
  const double since_s = x_last ? now.stamp_s - x_last->stamp_s : 0;
  x_covariance.block<3, 3>(kGravity, kGravity) +=
      diagonal(std::pow(kGravity_mps2 * kDegree * x_options.tilt_walk_deg, 2) * since_s);
  x_covariance.block<3, 3>(kBias, kBias) +=
      diagonal(std::pow(kBiasWalk_share * x_options.accelerometer_bias_mps2, 2) * since_s);

  Eigen::Matrix<double, 3, kStates> H = Eigen::Matrix<double, 3, kStates>::Zero();
  H.block<3, 3>(0, kVelocity).setIdentity();
  const Eigen::Vector3d velocity_body_mps = twist.tail<3>() + twist.head<3>().cross(history.p_body_imu_m());
  const Eigen::Matrix3d error = 2 * motion.covariance.bottomRightCorner<3, 3>() /
                                (motion.duration_s * motion.duration_s);  // both ends of the motion have it
  update<3>(now.R_odom_body * velocity_body_mps, H, now.R_odom_body * error * now.R_odom_body.transpose());

  // The length of gravity is known; along its estimate, as long as that is tilted by less than this.
  constexpr double kGravityVaries_mps2 = 0.02;  // over the earth
  const Eigen::Vector3d g = x_mean.segment<3>(kGravity);
  const double tilted_mps2 = x_covariance.block<3, 3>(kGravity, kGravity).trace() / (2 * kGravity_mps2);
  Eigen::Matrix<double, 1, kStates> along = Eigen::Matrix<double, 1, kStates>::Zero();
  along.segment<3>(kGravity) = g.normalized();
  update<1>(Eigen::Matrix<double, 1, 1>(kGravity_mps2), along,
            Eigen::Matrix<double, 1, 1>(std::pow(kGravityVaries_mps2 + tilted_mps2, 2)));
  x_last = now;
}

std::optional<Level> Levelling::level(const Eigen::Matrix3d& R_odom_body) const {
  constexpr double kFirst_s = 1;
  if (x_felt_s < kFirst_s) return std::nullopt;
  const Eigen::Vector3d up_odom = -x_mean.segment<3>(kGravity).normalized();
  const Eigen::Matrix3d across = Eigen::Matrix3d::Identity() - up_odom * up_odom.transpose();
  const Eigen::Matrix3d C = across * x_covariance.block<3, 3>(kGravity, kGravity) * across;
  const double worst = Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d>(C).eigenvalues()(2);
  return Level{R_odom_body.transpose() * up_odom, std::sqrt(std::max(0.0, worst)) / kGravity_mps2};
}

}  // namespace raceloc
