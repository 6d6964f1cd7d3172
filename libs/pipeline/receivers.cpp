#include "pipeline/receivers.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <utility>

namespace raceloc {

namespace {

/** Adds what a receiver does not tell of: it is never believed to be better than sigma on any axis. */
Eigen::Matrix2d floored(const Eigen::Matrix2d& covariance, double sigma_m) {
  return covariance + sigma_m * sigma_m * Eigen::Matrix2d::Identity();
}

/** The lever arm as it lies in the plane, in the axes of the heading. */
Eigen::Vector2d planarLever(const Eigen::Matrix3d& R_map_body, const Eigen::Vector3d& p_body_m) {
  Pose T = Pose::Identity();
  T.linear() = R_map_body;
  return Eigen::Rotation2Dd(-yawOf(T)) * (R_map_body * p_body_m).head<2>();
}

Eigen::Matrix3d levelAt(double heading_rad) {
  return poseFromRpy(Eigen::Vector3d::Zero(), 0, 0, heading_rad).linear();
}

}  // namespace

void Receivers::take(const InsPose& pose) { x_receivers[pose.label].ins = pose; }

std::optional<PoseFix> Receivers::take(const GpsFix& fix, const CarMotion& car) {
  constexpr double kSameEpoch_s = 0.005;
  constexpr double kBestHeading_rad = 1e-3;  // no INS is better, whatever it claims
  Receiver& receiver = x_receivers[fix.label];
  const std::optional<GpsFix> previous = std::exchange(receiver.previous, fix);
  PoseFix of_car{fix.label, fix.p_map_antenna_m.head<2>(),
                 floored(fix.cov_map_m2.topLeftCorner<2, 2>(), x_gps_min_sigma_m)};
  Eigen::Matrix3d R_map_body = car.R_map_body.value_or(Eigen::Matrix3d::Identity());
  if (receiver.ins && std::abs(receiver.ins->stamp_s - fix.stamp_s) < kSameEpoch_s) {
    R_map_body = receiver.ins->T_map_body.linear();
    of_car.heading = HeadingKind::body;
    of_car.heading_rad = yawOf(receiver.ins->T_map_body);
    of_car.heading_sigma_rad = std::max(kBestHeading_rad, std::sqrt(receiver.ins->covariance(2, 2)));
  } else if (const auto course = previous ? courseOf(fix, *previous, car) : std::nullopt) {
    of_car.heading = HeadingKind::course;
    of_car.heading_rad = course->course_rad;
    of_car.heading_sigma_rad = course->sigma_rad;
    if (!car.R_map_body) R_map_body = levelAt(course->course_rad);
  }
  if (!car.R_map_body && of_car.heading == HeadingKind::none) return std::nullopt;
  of_car.p_body_m = planarLever(R_map_body, fix.p_body_antenna_m);
  if (of_car.heading != HeadingKind::none) keepPlace(fix, of_car, receiver);
  return of_car;
}

/** The antenna goes round the rear axle while the car turns (omega x r); the course is that of the axle, and half of
 * the turn ahead of the chord between the fixes. */
std::optional<Receivers::Course> Receivers::courseOf(const GpsFix& fix, const GpsFix& previous,
                                                     const CarMotion& car) const {
  constexpr double kMemory_s = 1.5, kWorthless_rad = 0.3;
  const double duration_s = fix.stamp_s - previous.stamp_s;
  if (!(duration_s > 0) || duration_s >= kMemory_s) return std::nullopt;
  const double turn_rad = car.yaw_rate_rps * duration_s;
  Eigen::Vector2d moved_m = (fix.p_map_antenna_m - previous.p_map_antenna_m).head<2>();
  if (car.R_map_body) {
    const Eigen::Matrix3d& R_map_body = *car.R_map_body;
    const Eigen::Matrix3d R_map_previous =
        R_map_body * Eigen::AngleAxisd(-turn_rad, Eigen::Vector3d::UnitZ());
    moved_m -= ((R_map_body - R_map_previous) * fix.p_body_antenna_m).head<2>();
  }
  const double speed_mps = moved_m.norm() / duration_s;
  const Eigen::Vector2d across = Eigen::Vector2d(-moved_m.y(), moved_m.x()).normalized();
  const Eigen::Matrix3d both_m2 = fix.cov_map_m2 + previous.cov_map_m2;
  const double noise_rad = std::sqrt(across.dot(both_m2.topLeftCorner<2, 2>() * across)) / moved_m.norm();
  if (!(speed_mps > x_min_course_speed_mps) || !(noise_rad < kWorthless_rad)) return std::nullopt;
  return Course{wrapAngle(std::atan2(moved_m.y(), moved_m.x()) + 0.5 * turn_rad - car.slip_rad),
                std::hypot(x_course_sigma_deg * kDegree, noise_rad)};
}

void Receivers::keepPlace(const GpsFix& fix, const PoseFix& of_car, const Receiver& receiver) {
  if (x_place && fix.stamp_s < x_place->stamp_s) return;  // it came late
  Pose T = Pose::Identity();
  T.linear() =
      of_car.heading == HeadingKind::body ? receiver.ins->T_map_body.linear() : levelAt(of_car.heading_rad);
  T.translation() = fix.p_map_antenna_m - T.linear() * fix.p_body_antenna_m;
  const double first_fix_s = x_place ? x_place->first_fix_s : fix.stamp_s;
  x_place = Place{first_fix_s, fix.stamp_s, fix.label, T, of_car.cov_p_m2};
}

}  // namespace raceloc
