#include "sim/faults.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "core/labels.h"

namespace raceloc {

namespace {

/** Fixes and INS poses of one receiver in the same microsecond are of the same time. */
std::int64_t microseconds(double stamp_s) { return std::llround(stamp_s * 1e6); }

bool isGps(const Sample& sample) {
  return std::holds_alternative<GpsFix>(sample) || std::holds_alternative<InsPose>(sample);
}

void moveBy(Sample& sample, const Eigen::Vector3d& error_m) {
  if (auto* fix = std::get_if<GpsFix>(&sample)) fix->p_map_antenna_m += error_m;
  if (auto* ins = std::get_if<InsPose>(&sample)) ins->T_map_body.translation() += error_m;
}

/** A round covariance is the same in map and body, so fix and INS pose claim the same. */
void claim(Sample& sample, double variance_m2) {
  const Eigen::Matrix3d cov_m2 = variance_m2 * Eigen::Matrix3d::Identity();
  if (auto* fix = std::get_if<GpsFix>(&sample)) fix->cov_map_m2 = cov_m2;
  if (auto* ins = std::get_if<InsPose>(&sample)) {
    ins->covariance.bottomRows<3>().setZero();  // no correlation with the rotation: stays semidefinite
    ins->covariance.rightCols<3>().setZero();
    ins->covariance.bottomRightCorner<3, 3>() = cov_m2;
  }
}

void goFloat(Sample& sample, double variance_m2) {
  const Eigen::Matrix3d cov_m2 = variance_m2 * Eigen::Matrix3d::Identity();
  if (auto* fix = std::get_if<GpsFix>(&sample)) {
    fix->fix_quality = 5;
    fix->cov_map_m2 += cov_m2;
  }
  if (auto* ins = std::get_if<InsPose>(&sample)) ins->covariance.bottomRightCorner<3, 3>() += cov_m2;
}

void flipHeading(Sample& sample) {
  if (auto* fix = std::get_if<GpsFix>(&sample))
    if (fix->velocity) fix->velocity->course_rad = wrapAngle(fix->velocity->course_rad + M_PI);
  if (auto* ins = std::get_if<InsPose>(&sample)) {
    ins->T_map_body.linear().leftCols<2>() *= -1;  // half a turn about the body's z, to the bit
    const Vector6d sign = (Vector6d() << -1, -1, 1, -1, -1, 1).finished();  // of the increment's new axes
    ins->covariance = sign.asDiagonal() * ins->covariance * sign.asDiagonal();
  }
}

/** Keeps point i if `kept(i)`, in all arrays that the scan has. */
template <class Kept>
void filter(Scan& scan, Kept kept) {
  std::vector<std::size_t> indices;
  for (std::size_t i = 0; i < scan.cloud.size(); ++i)
    if (kept(i)) indices.push_back(i);
  auto& c = scan.cloud;
  for (auto* values : {&c.x, &c.y, &c.z, &c.intensity, &scan.time_s, &scan.ring}) {
    if (values->empty()) continue;
    for (std::size_t k = 0; k < indices.size(); ++k) (*values)[k] = (*values)[indices[k]];
    values->resize(indices.size());
  }
}

/** Drops of water or dirt: at a range of their own on the ray of the point that they hide. */
void spray(Scan& scan, const Fault& fault, const Noise& noise) {
  auto& c = scan.cloud;
  for (std::size_t i = 0; i < c.size(); ++i) {
    const double range_m = c.point(i).cast<double>().norm();
    if (noise.uniform(2 * i) >= fault.spray_share || !(range_m > 0)) continue;  // NaN too
    const double drop_m = fault.min_m + (fault.max_m - fault.min_m) * noise.uniform(2 * i + 1);
    for (auto* values : {&c.x, &c.y, &c.z})
      (*values)[i] = static_cast<float>((*values)[i] * (drop_m / range_m));
  }
}

void blockSector(Scan& scan, const Fault& fault) {
  const auto turned_deg = [](double angle_deg) { return angle_deg < 0 ? angle_deg + 360 : angle_deg; };
  const double width_deg = turned_deg(fault.sector_to_deg - fault.sector_from_deg);
  filter(scan, [&](std::size_t i) {
    const double azimuth_deg = std::atan2(scan.cloud.y[i], scan.cloud.x[i]) * 180 / M_PI;
    return !(turned_deg(azimuth_deg - fault.sector_from_deg) <= width_deg);
  });
}

void reverseTimes(Scan& scan) {
  if (scan.time_s.empty()) return;
  const auto [first, last] = std::minmax_element(scan.time_s.begin(), scan.time_s.end());
  const float sum_s = *first + *last;
  for (float& t_s : scan.time_s) t_s = sum_s - t_s;
}

void change(Scan& scan, const Fault& fault, const Noise& noise) {
  switch (fault.kind) {
    case FaultKind::lidar_thinned:
      return filter(scan, [&](std::size_t i) { return noise.uniform(i) >= fault.lost_share; });
    case FaultKind::lidar_spray:
      return spray(scan, fault, noise);
    case FaultKind::lidar_sector_blocked:
      return blockSector(scan, fault);
    case FaultKind::lidar_times_scaled:
      for (float& t_s : scan.time_s) t_s = static_cast<float>(t_s * fault.time_factor);
      return;
    case FaultKind::lidar_times_reversed:
      return reverseTimes(scan);
    case FaultKind::lidar_times_absent:
      return scan.time_s.clear();
    case FaultKind::lidar_nan:
      for (std::size_t i = 0; i < scan.cloud.size(); ++i)
        if (noise.uniform(i) < fault.nan_share)
          scan.cloud.x[i] = scan.cloud.y[i] = scan.cloud.z[i] = std::numeric_limits<float>::quiet_NaN();
      return;
    case FaultKind::lidar_ground_only:
      return filter(scan, [&](std::size_t i) {
        return (scan.T_body_lidar * scan.cloud.point(i).cast<double>()).z() < fault.height_m;
      });
    default:
      return;
  }
}

void change(ImuSample& imu, const Fault& fault) {
  const auto limit = [](Eigen::Vector3d& v, double most) { v = v.cwiseMax(-most).cwiseMin(most); };
  if (fault.kind == FaultKind::imu_bias_step) {
    imu.gyro_body_rps += Eigen::Vector3d((kDegree * fault.gyro_x_dps), (kDegree * fault.gyro_y_dps),
                                         (kDegree * fault.gyro_z_dps));
    imu.specific_force_body_mps2 +=
        Eigen::Vector3d(fault.accelerometer_x_mps2, fault.accelerometer_y_mps2, fault.accelerometer_z_mps2);
  } else if (fault.kind == FaultKind::imu_saturated) {
    limit(imu.gyro_body_rps, (kDegree * fault.gyro_limit_dps));
    limit(imu.specific_force_body_mps2, fault.accelerometer_limit_mps2);
  }
}

void change(MotionSample& motion, const Fault& fault) {
  if (fault.kind == FaultKind::wheel_lock) motion.speed_mps = 0;
  if (fault.kind == FaultKind::wheel_spin) motion.speed_mps *= fault.spin_factor;
  if (fault.kind == FaultKind::steering_offset && motion.steering_rad)
    *motion.steering_rad += (kDegree * fault.offset_deg);
}

bool loses(FaultKind kind, const Sample& sample) {
  return (kind == FaultKind::gps_outage && isGps(sample)) ||
         (kind == FaultKind::lidar_off && std::holds_alternative<Scan>(sample));
}

bool freezes(FaultKind kind, const Sample& sample) {
  return (kind == FaultKind::gps_frozen && isGps(sample)) ||
         (kind == FaultKind::imu_frozen && std::holds_alternative<ImuSample>(sample)) ||
         (kind == FaultKind::vehicle_frozen && std::holds_alternative<MotionSample>(sample));
}

/** Direction of travel, from the message alone. */
std::optional<double> courseOf(const Sample& sample) {
  if (const auto* ins = std::get_if<InsPose>(&sample)) return yawOf(ins->T_map_body);
  const auto& velocity = std::get<GpsFix>(sample).velocity;
  return velocity ? std::optional(velocity->course_rad) : std::nullopt;
}

}  // namespace

FaultInjector::FaultInjector(std::vector<Fault> faults, double log_start_s, std::uint64_t seed)
    : x_faults(std::move(faults)), x_log_start_s(log_start_s), x_seed(seed) {}

bool FaultInjector::acts(const Fault& fault, const std::string& label, double stamp_s) const {
  const double since_start_s = stamp_s - x_log_start_s;
  return since_start_s >= fault.from_s && since_start_s < fault.end_s() && matchesLabel(fault.labels, label);
}

bool FaultInjector::touches(const std::string& label, double stamp_s) const {
  return std::any_of(x_faults.begin(), x_faults.end(),
                     [&](const auto& fault) { return acts(fault, label, stamp_s); });
}

Noise FaultInjector::noise(const Fault& fault, const std::string& device, std::int64_t count) const {
  return Noise(x_seed, fault.section + "/" + device + "/" + std::to_string(count));
}

std::vector<Delivery> FaultInjector::apply(Delivery delivery) {
  const std::string label = labelOf(delivery.sample);
  const double stamp_s = stampOf(delivery.sample);
  if (const auto* motion = std::get_if<MotionSample>(&delivery.sample))
    if (!x_motion || motion->stamp_s > x_motion->stamp_s) x_motion = *motion;

  std::vector<Delivery> deliveries;
  deliveries.push_back(std::move(delivery));
  for (const auto& fault : x_faults) {
    if (!acts(fault, label, stamp_s)) continue;
    if (loses(fault.kind, deliveries.front().sample)) return {};
    if (fault.kind == FaultKind::message_duplicated) {
      deliveries.push_back(deliveries.front());
      deliveries.back().arrival_s += fault.again_after_s;
    }
    for (auto& d : deliveries) change(fault, d, stamp_s);
  }
  return deliveries;
}

Eigen::Vector3d FaultInjector::drift_m(const Fault& fault, const Sample& sample, double stamp_s) {
  const auto [entry, is_first] = x_drifts.try_emplace({fault.section, labelOf(sample)});
  Drift& drift = entry->second;
  if (!is_first && microseconds(stamp_s) <= microseconds(drift.stamp_s)) return drift.error_m;
  const double dt_s = is_first ? 0 : stamp_s - drift.stamp_s;
  drift.stamp_s = stamp_s;
  if (x_motion)
    drift.lateral_mps2 += (x_motion->speed_mps * x_motion->yaw_rate_rps - drift.lateral_mps2) *
                          -std::expm1(-dt_s / fault.time_constant_s);

  const auto* fix = std::get_if<GpsFix>(&sample);
  if (const auto course_rad = courseOf(sample)) {
    drift.left << -std::sin(*course_rad), std::cos(*course_rad), 0;
  } else if (drift.p_fix_m) {
    const Eigen::Vector3d step_m = fix->p_map_antenna_m - *drift.p_fix_m;
    if (step_m.head<2>().norm() > 0) drift.left = Eigen::Vector3d(-step_m.y(), step_m.x(), 0).normalized();
  }
  if (fix) drift.p_fix_m = fix->p_map_antenna_m;
  return drift.error_m = fault.gain_m_per_mps2 * drift.lateral_mps2 * drift.left;
}

void FaultInjector::changeGps(const Fault& fault, Sample& sample, double stamp_s) {
  const auto normals = [&](const std::string& device, std::int64_t count) {
    const Noise n = noise(fault, device, count);
    return Eigen::Vector3d(n.normal(0), n.normal(1), n.normal(2));
  };
  const std::string& label = labelOf(sample);
  const double on_for_s = stamp_s - x_log_start_s - fault.from_s;
  switch (fault.kind) {
    case FaultKind::gps_noise:
      return moveBy(sample, fault.sigma_m * normals(fault.shared ? "" : label, microseconds(stamp_s)));
    case FaultKind::gps_step:
      return moveBy(sample, {fault.east_m, fault.north_m, fault.up_m});
    case FaultKind::gps_ramp: {
      const double direction_rad = (kDegree * fault.direction_deg);
      return moveBy(sample, fault.rate_mps * on_for_s *
                                Eigen::Vector3d(std::cos(direction_rad), std::sin(direction_rad), 0));
    }
    case FaultKind::gps_vibration:
      return moveBy(sample, drift_m(fault, sample, stamp_s));
    case FaultKind::gps_covariance:
      return claim(sample, fault.claimed_sigma_m * fault.claimed_sigma_m);
    case FaultKind::gps_rtk_flapping: {
      const auto phase = static_cast<std::int64_t>(on_for_s / fault.period_s);
      if (phase % 2 == 1) return;  // fixed, as it came
      moveBy(sample, fault.float_sigma_m * normals(label, phase));
      return goFloat(sample, fault.float_sigma_m * fault.float_sigma_m);
    }
    case FaultKind::gps_heading_flip:
      return flipHeading(sample);
    default:
      return;
  }
}

void FaultInjector::change(const Fault& fault, Delivery& delivery, double stamp_s) {
  auto& sample = delivery.sample;
  const std::string& label = labelOf(sample);
  if (fault.kind == FaultKind::message_late) delivery.arrival_s += fault.delay_s;
  if (fault.kind == FaultKind::message_shuffled)
    delivery.arrival_s += fault.window_s * noise(fault, label, microseconds(stamp_s)).uniform(0);
  if (fault.kind == FaultKind::stamp_jump) std::visit([&](auto& s) { s.stamp_s += fault.jump_s; }, sample);

  if (freezes(fault.kind, sample)) {
    const std::string stream = label + "/" + std::to_string(sample.index());  // fixes and INS poses apart
    const double own_stamp_s = stampOf(sample);
    sample = x_frozen.try_emplace({fault.section, stream}, sample).first->second;
    std::visit([&](auto& s) { s.stamp_s = own_stamp_s; }, sample);
  } else if (isGps(sample)) {
    changeGps(fault, sample, stamp_s);
  } else if (auto* scan = std::get_if<Scan>(&sample)) {
    raceloc::change(*scan, fault, noise(fault, label, microseconds(stamp_s)));
  } else if (auto* imu = std::get_if<ImuSample>(&sample)) {
    raceloc::change(*imu, fault);
  } else if (auto* motion = std::get_if<MotionSample>(&sample)) {
    raceloc::change(*motion, fault);
  }
}

}  // namespace raceloc
