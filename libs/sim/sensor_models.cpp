#include "sim/sensor_models.h"

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>

namespace raceloc {

namespace {

/** Numbers beyond those of any message: for what is drawn once. */
constexpr std::uint64_t kConstants = 1ULL << 50;

/** Three normal numbers, `first` and the two after it. */
Eigen::Vector3d normals(const Noise& noise, std::uint64_t first) {
  return {noise.normal(first), noise.normal(first + 1), noise.normal(first + 2)};
}

}  // namespace

// ---- LiDAR

LidarModel::LidarModel(const LidarOptions& options, std::string label, std::uint64_t seed)
    : x_options(options),
      x_label(std::move(label)),
      x_range_noise(seed, x_label + "/range"),
      x_intensity_noise(seed, x_label + "/intensity"),
      x_loss(seed, x_label + "/loss") {
  const auto& o = x_options;
  x_directions.reserve(static_cast<std::size_t>(o.beams) * static_cast<std::size_t>(o.columns));
  for (int column = 0; column < o.columns; ++column) {
    const double swept = (column + 0.5) / o.columns;
    const double azimuth_rad = kDegree * (o.azimuth_min_deg + (o.clockwise ? 1 - swept : swept) *
                                                                  (o.azimuth_max_deg - o.azimuth_min_deg));
    for (int beam = 0; beam < o.beams; ++beam) {
      const double share = o.beams > 1 ? static_cast<double>(beam) / (o.beams - 1) : 0.5;
      const double elevation_rad =
          kDegree * (o.elevation_min_deg + share * (o.elevation_max_deg - o.elevation_min_deg));
      x_directions.emplace_back(std::cos(elevation_rad) * std::cos(azimuth_rad),
                                std::cos(elevation_rad) * std::sin(azimuth_rad), std::sin(elevation_rad));
    }
  }
}

Scan LidarModel::sweep(const TrueMotion& motion, const World& world, const Traffic& traffic, double begin_s,
                       std::uint64_t number) const {
  const auto& o = x_options;
  const auto beams = static_cast<std::size_t>(o.beams), columns = static_cast<std::size_t>(o.columns);
  const Pose T_body_lidar = o.T_body_lidar();
  const auto timeOf = [&](std::size_t column) {
    return (static_cast<double>(column) + 0.5) / static_cast<double>(columns) / o.rate_hz;
  };
  struct Return {
    float range_m = 0, intensity = 0;  // range 0: none
  };
  std::vector<Return> returns(beams * columns);

  const auto castColumn = [&](std::size_t column, std::vector<Eigen::Vector3d>& directions_map,
                              std::vector<Hit>& hits) {
    const double time_s = begin_s + timeOf(column);
    const Pose T_map_lidar = motion.T_map_body(time_s) * T_body_lidar;
    const std::size_t first = column * beams;
    for (std::size_t beam = 0; beam < beams; ++beam)
      directions_map[beam] = T_map_lidar.linear() * x_directions[first + beam];
    world.cast(T_map_lidar.translation(), directions_map.data(), beams, o.max_range_m, hits.data());
    if (!traffic.empty()) {
      const auto boxes = traffic.at(time_s);
      for (std::size_t beam = 0; beam < beams; ++beam) {
        const BoxHit car = firstHit(boxes, T_map_lidar.translation(), directions_map[beam]);
        if (car.range_m > 0 && (hits[beam].range_m == 0 || car.range_m < hits[beam].range_m))
          hits[beam] = {car.range_m, reflectivityOf(Material::cladding) * static_cast<float>(car.cosine)};
      }
    }
    for (std::size_t beam = 0; beam < beams; ++beam) {
      const Hit& hit = hits[beam];
      if (hit.range_m < o.min_range_m || hit.range_m > o.max_range_m) continue;
      const std::uint64_t index = number * returns.size() + first + beam;
      const double reach = o.range_at_10_percent_m / hit.range_m;
      const double chance = (1 - o.dropout_share) * std::min(1.0, hit.brightness / 0.1 * reach * reach);
      if (x_loss.uniform(index) >= chance) continue;
      returns[first + beam] = {
          static_cast<float>(hit.range_m + o.range_bias_m + o.range_sigma_m * x_range_noise.normal(index)),
          static_cast<float>(
              std::clamp(hit.brightness + o.intensity_sigma * x_intensity_noise.normal(index), 0.0, 1.0))};
    }
  };
  tbb::parallel_for(tbb::blocked_range<std::size_t>(0, columns, 16),
                    [&](const tbb::blocked_range<std::size_t>& part) {
                      std::vector<Eigen::Vector3d> directions_map(beams);
                      std::vector<Hit> hits(beams);
                      for (std::size_t column = part.begin(); column < part.end(); ++column)
                        castColumn(column, directions_map, hits);
                    });

  Scan scan{kStartStamp_s + begin_s + o.clock_offset_s, x_label, T_body_lidar, {}, {}, {}};
  const auto count = static_cast<std::size_t>(
      std::count_if(returns.begin(), returns.end(), [](const Return& r) { return r.range_m > 0; }));
  scan.cloud.reserve(count);
  scan.time_s.reserve(count);
  scan.ring.reserve(count);
  for (std::size_t i = 0; i < returns.size(); ++i) {
    if (!(returns[i].range_m > 0)) continue;
    scan.cloud.push((returns[i].range_m * x_directions[i]).cast<float>(), returns[i].intensity);
    scan.time_s.push_back(static_cast<float>(timeOf(i / beams)));
    scan.ring.push_back(static_cast<float>(i % beams));
  }
  return scan;
}

// ---- GPS

GpsModel::GpsModel(const GpsOptions& options, std::string label, std::uint64_t seed)
    : x_options(options),
      x_label(std::move(label)),
      x_noise(seed, x_label),
      x_drift_m(options.drift_sigma_m * normals(x_noise, kConstants)) {}

GpsModel::Output GpsModel::measure(const TrueMotion& motion, double time_s, std::uint64_t number) {
  const auto& o = x_options;
  constexpr std::uint64_t kNumbers = 12;
  const std::uint64_t first = kNumbers * number;
  // A first-order Gauss-Markov process: its variance stays drift_sigma^2.
  const double kept = number == 0 ? 1 : std::exp(-1 / (o.rate_hz * o.drift_time_s));
  x_drift_m = kept * x_drift_m + std::sqrt(1 - kept * kept) * o.drift_sigma_m * normals(x_noise, first);
  const Eigen::Vector3d sigma_m(o.horizontal_sigma_m, o.horizontal_sigma_m, o.vertical_sigma_m);
  const Eigen::Vector3d error_m = x_drift_m + sigma_m.cwiseProduct(normals(x_noise, first + 3));
  const Eigen::Vector3d variance_m2 =
      o.covariance_factor * (sigma_m.cwiseAbs2().array() + o.drift_sigma_m * o.drift_sigma_m).matrix();

  const Pose T_map_body = motion.T_map_body(time_s);
  const double stamp_s = kStartStamp_s + time_s + o.clock_offset_s;
  Output out{{stamp_s, x_label, T_map_body * o.p_body_m() + error_m, variance_m2.asDiagonal(), o.p_body_m(),
              o.fix_quality},
             std::nullopt};
  if (o.heading != Heading::none) {
    const Eigen::Vector3d v =
        motion.velocity_map_mps(time_s, o.p_body_m()) + o.velocity_sigma_mps * normals(x_noise, first + 6);
    out.fix.velocity = GroundVelocity{v.head<2>().norm(), std::atan2(v.y(), v.x())};
  }
  if (o.heading == Heading::body) {
    const Eigen::Vector3d sigma_rad =
        kDegree * Eigen::Vector3d(o.attitude_sigma_deg, o.attitude_sigma_deg, o.heading_sigma_deg);
    Vector6d turn = Vector6d::Zero();
    turn.head<3>() = sigma_rad.cwiseProduct(normals(x_noise, first + 9));
    InsPose pose{stamp_s, x_label, T_map_body * se3Exp(turn), Matrix6d::Zero()};
    pose.T_map_body.translation() += error_m;
    pose.covariance.topLeftCorner<3, 3>() =
        o.covariance_factor * Eigen::Matrix3d(sigma_rad.cwiseAbs2().asDiagonal());
    const Eigen::Matrix3d R =
        pose.T_map_body.linear();  // the translation of a right increment is in the body's axes
    pose.covariance.bottomRightCorner<3, 3>() = R.transpose() * variance_m2.asDiagonal() * R;
    out.pose = pose;
  }
  return out;
}

// ---- IMU and vehicle

ImuModel::ImuModel(const ImuOptions& options, std::string label, std::uint64_t seed)
    : x_options(options),
      x_label(std::move(label)),
      x_noise(seed, x_label),
      x_gyro_bias_rps(kDegree * options.gyro_bias_sigma_dps * normals(x_noise, kConstants)),
      x_force_bias_mps2(options.force_bias_sigma_mps2 * normals(x_noise, kConstants + 3)) {}

ImuSample ImuModel::measure(const TrueMotion& motion, double time_s, std::uint64_t number) const {
  const auto& o = x_options;
  const auto limited = [](const Eigen::Vector3d& v, double limit) {
    return Eigen::Vector3d(v.cwiseMax(-limit).cwiseMin(limit));
  };
  return {kStartStamp_s + time_s + o.clock_offset_s, x_label,
          limited(motion.gyro_body_rps(time_s) + x_gyro_bias_rps +
                      kDegree * o.gyro_sigma_dps * normals(x_noise, 6 * number),
                  kDegree * o.gyro_limit_dps),
          limited(motion.specificForce_body_mps2(time_s, o.p_body_m()) + x_force_bias_mps2 +
                      o.force_sigma_mps2 * normals(x_noise, 6 * number + 3),
                  o.force_limit_mps2),
          o.p_body_m()};
}

VehicleModel::VehicleModel(const VehicleOptions& options, std::string label, std::uint64_t seed)
    : x_options(options),
      x_label(std::move(label)),
      x_noise(seed, x_label),
      x_speed_scale(1 + options.speed_scale_sigma * x_noise.normal(kConstants)),
      x_yaw_rate_bias_rps(kDegree * options.yaw_rate_bias_sigma_dps * x_noise.normal(kConstants + 1)),
      x_steering_offset_rad(kDegree * options.steering_offset_sigma_deg * x_noise.normal(kConstants + 2)) {}

MotionSample VehicleModel::measure(const TrueMotion& motion, double time_s, std::uint64_t number) const {
  const auto& o = x_options;
  const RaceCarState state = motion.state(time_s);
  const Eigen::Vector3d noise = normals(x_noise, 3 * number);
  return {kStartStamp_s + time_s + o.clock_offset_s, x_label,
          std::max(0.0, state.forward_mps * (1 + state.wheel_slip) * x_speed_scale +
                            o.speed_sigma_mps * noise.x()),
          motion.gyro_body_rps(time_s).z() + x_yaw_rate_bias_rps + kDegree * o.yaw_rate_sigma_dps * noise.y(),
          state.steering_rad + x_steering_offset_rad + kDegree * o.steering_sigma_deg * noise.z()};
}

}  // namespace raceloc
