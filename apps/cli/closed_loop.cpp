#include "cli/closed_loop.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <memory>

#include "cli/loop_localizer.h"
#include "cli/loop_paths.h"
#include "cloud/deskew.h"
#include "core/labels.h"
#include "sim/faults.h"
#include "sim/path_tracker.h"
#include "sim/scenery.h"
#include "sim/wall_gap.h"
#include "wall/tracked_path.h"

namespace raceloc {

namespace {

constexpr double kTick_s = 0.01;             // of the control loop
constexpr std::uint64_t kStepsPerTick = 10;  // of the car
constexpr std::uint64_t kTicksBack = 1;      // sensors measure then: the true motion must be known around it
constexpr double kMeasured_s = kTicksBack * kTick_s;
constexpr std::uint64_t kTicksPerScan = 10;
constexpr double kScan_s = kTicksPerScan * kTick_s;
constexpr double kSettle_s = 0.3;         // the simulated driver steers until sensors and scans are there
constexpr double kHorizon_s = 2;          // of the line that the guard is told
constexpr double kMostGrip = 0.95;        // of the tyres, at which the speed is planned
constexpr double kNear_m = 20;            // of the line that the tracker needs
constexpr double kScanLatency_s = 0.04;   // of the LiDAR, and of finding the wall
constexpr double kMatchLatency_s = 0.06;  // of a scan match
constexpr double kMatchSigma_m = 0.03, kMatchSigma_rad = 0.05 * kDegree;
constexpr double kNone = std::numeric_limits<double>::quiet_NaN();

/** Scans to walls, as the module in the car makes them. */
class WallFinder {
 public:
  explicit WallFinder(const WallOptions& options) : x_detector(x_context, options) {}
  WallScan look(std::vector<Scan> scans, const LoopLocalizer& localizer) {
    const Sweep sweep = sweepOf(std::move(scans));
    const auto poses = localizer.motion().sweep(sweep.begin_s, sweep.end_s);
    Vector6d twist = Vector6d::Zero();
    twist(2) = localizer.rates().yaw_rate_rps;
    twist(3) = localizer.rates().speed_mps;
    const DeskewedScan scan =
        deskew(x_context, sweep, poses ? *poses : steadySweep(twist, sweep.end_s - sweep.begin_s), x_crop);
    const Pose T_last_now = x_last_s ? localizer.between(*x_last_s, scan.stamp_s) : Pose::Identity();
    x_last_s = scan.stamp_s;
    return x_detector.detect(scan.cloud, scan.stamp_s, T_last_now);
  }

 private:
  static CropOptions nearCrop() {
    CropOptions crop;
    crop.min_range_m = 0.5;  // the wall beside the car is what counts
    return crop;
  }
  gpu::Context x_context{gpu::Backend::cpu};
  WallDetector x_detector;
  CropOptions x_crop = nearCrop();
  std::optional<double> x_last_s;
};

/** One drive: the car, what it measures, what it makes of that, and how it steers. */
class LoopDrive {
 public:
  LoopDrive(const Circuit& circuit, const CarFile& file, const World& world, const RacingLine& told,
            const ClosedLoopOptions& options, const GuardOptions& guard, const WallPathOptions& wall_path)
      : x_circuit(circuit),
        x_file(file),
        x_world(world),
        x_told(told),
        x_options(options),
        x_guard_options(guard),
        x_profile(circuit.track, told, file.car, file.driver, circuit.pace),
        x_nobody(circuit.track, told, x_profile, file.car, 0, options.seed),
        x_car(circuit.track, told, x_profile, file.car, file.driver, x_profile.at(options.from_m).speed_mps,
              options.seed, options.from_m),
        x_motion(circuit.track, file.car, 1),
        x_imu(file.imus.front().second, file.imus.front().first, options.seed),
        x_vehicle(file.vehicles.front().second, file.vehicles.front().first, options.seed),
        x_match_noise(options.seed, kMatchLabel),
        x_injector(options.faults, kStartStamp_s, options.seed),
        x_localizer(std::make_unique<LoopLocalizer>(bodyPose(circuit.track, file.car, x_car.state()),
                                                    kStartStamp_s, x_car.state().forward_mps,
                                                    EstimatorOptions())),
        x_finder(WallOptions()),
        x_guard(guard, wall_path),
        x_follower(wall_path),
        x_handover(guard) {
    for (auto [label, device] : file.lidars) {
      device.rate_hz = 1 / kScan_s;
      x_lidars.emplace_back(device, label, options.seed);
    }
    for (const auto& [label, device] : file.gps) x_receivers.emplace_back(device, label, options.seed);
    x_motion.add(x_car.state());
  }

  ClosedLoopDrive run() {
    ClosedLoopDrive drive;
    const auto ticks = static_cast<std::uint64_t>(std::round(x_options.duration_s / kTick_s));
    for (std::uint64_t tick = 1; tick <= ticks; ++tick) {
      const double now_s = static_cast<double>(tick) * kTick_s;
      for (std::uint64_t k = 0; k < kStepsPerTick; ++k) {
        if (now_s <= kSettle_s)  // nothing was commanded before
          x_car.step();
        else
          x_car.stepSteered(x_command_rad);
        x_motion.add(x_car.state());
      }
      if (tick > kTicksBack) measure(tick, now_s - kMeasured_s);
      while (auto sample = x_samples.pop(now_s)) x_localizer->add(sample->second);
      while (auto scans = x_sweeps.pop(now_s)) decide(std::move(scans->second));
      if (now_s >= kSettle_s)
        steer(now_s);
      else
        x_command_rad = x_car.state().steering_rad;
      drive.rows.push_back(row(now_s));
      if (drive.hasHit()) break;
    }
    return drive;
  }

 private:
  void deliver(double arrival_s, Sample sample) {
    for (auto& delivery : x_injector.apply({arrival_s, std::move(sample)}))
      x_samples.push(delivery.arrival_s, std::move(delivery.sample));
  }

  void measure(std::uint64_t tick, double time_s) {
    deliver(time_s, x_imu.measure(x_motion, time_s, tick));
    deliver(time_s, x_vehicle.measure(x_motion, time_s, tick));
    for (std::size_t i = 0; i < x_receivers.size(); ++i) {
      const auto& device = x_file.gps[i].second;
      const auto every =
          static_cast<std::uint64_t>(std::max(1.0, std::round(1 / (device.rate_hz * kTick_s))));
      if (tick % every == 0)
        deliver(time_s + device.latency_s, *x_receivers[i].measure(x_motion, time_s, tick / every).pose);
    }
    if (tick % kTicksPerScan != kTicksBack) return;
    const std::uint64_t scan = tick / kTicksPerScan;
    deliver(time_s + kMatchLatency_s, match(time_s, scan));
    if (!x_options.is_guarded || time_s < kScan_s) return;
    std::vector<Scan> scans;
    scans.reserve(x_lidars.size());
    for (const auto& lidar : x_lidars)
      scans.push_back(lidar.sweep(x_motion, x_world, x_nobody, time_s - kScan_s, scan));
    x_sweeps.push(time_s + kScanLatency_s, std::move(scans));
  }

  /** What a scan match would say. */
  [[nodiscard]] InsPose match(double time_s, std::uint64_t number) const {
    Vector6d sigma;
    sigma << Eigen::Vector3d::Constant(kMatchSigma_rad), Eigen::Vector3d::Constant(kMatchSigma_m);
    Vector6d error;
    for (int k = 0; k < 6; ++k)
      error(k) = sigma(k) * x_match_noise.normal(6 * number + static_cast<std::uint64_t>(k));
    return {kStartStamp_s + time_s, kMatchLabel, x_motion.T_map_body(time_s) * se3Exp(error),
            sigma.cwiseAbs2().asDiagonal()};
  }

  /** The line that the car is told, in its own frame: where it believes to be. */
  [[nodiscard]] Path toldPath(double stamp_s, double ahead_m) {
    return linePath(x_circuit.track, x_told, x_localizer->at(stamp_s).mean.head<3>(), ahead_m);
  }

  void decide(std::vector<Scan> scans) {
    const WallScan walls = x_finder.look(std::move(scans), *x_localizer);
    const auto [speed_mps, yaw_rate_rps] = x_localizer->rates();
    const double curvature_per_m = yaw_rate_rps / std::max(1.0, speed_mps);
    const GuardOutput decided = x_guard.update(
        {walls.stamp_s, !x_localizer->alarm(), walls,
         trackedPath(toldPath(walls.stamp_s, kHorizon_s * speed_mps),
                     std::max(x_file.driver.lookahead_min_m, x_file.driver.lookahead_s * speed_mps)),
         speed_mps, curvature_per_m});
    const double moved_m = x_localizer->between(x_walls_s, walls.stamp_s).translation().norm();
    x_walls_s = walls.stamp_s;
    x_along.clear();
    if (decided.path)
      x_along = x_follower.follow(*walls.on(decided.path->side), decided.path->gap_m, speed_mps,
                                  curvature_per_m, x_localizer->course_rad(), moved_m);
    else
      x_follower.restart();
    const auto& wall = walls.on(x_guard_options.side);
    x_seen_gap_m = wall ? wall->distance_m() : kNone;
  }

  void steer(double now_s) {
    const double stamp_s = kStartStamp_s + now_s;
    const auto [speed_mps, yaw_rate_rps] = x_localizer->rates();
    const bool by_wall = !x_along.empty();
    const Path path = by_wall ? x_along : toldPath(stamp_s, kNear_m);
    if (!path.empty()) {
      const Pose T_path_body = by_wall ? x_localizer->between(x_walls_s, stamp_s) : Pose::Identity();
      x_command_rad = wantedSteering(aheadOn(path, T_path_body, speed_mps, x_localizer->up_body()), speed_mps,
                                     yaw_rate_rps, x_file.car, x_file.driver);
    }
    if (x_options.is_guarded) x_command_rad = x_handover.steer(x_guard.state(), x_command_rad, kTick_s);
  }

  [[nodiscard]] ClosedLoopRow row(double now_s) {
    const RaceCarState& car = x_car.state();
    const Pose T_map_body = bodyPose(x_circuit.track, x_file.car, car);
    const Eigen::Vector2d believed_m = x_localizer->at(kStartStamp_s + now_s).mean.head<2>();
    const Eigen::Vector2d off_m =
        Eigen::Rotation2Dd(-yawOf(T_map_body)) * (believed_m - T_map_body.translation().head<2>());
    return {now_s,
            car.s_m,
            car.forward_mps,
            x_command_rad,
            wheelToWall_m(x_circuit, x_file.car, car),
            wallGap_m(x_circuit, car.s_m, car.n_m, x_file.car.axle_height_m, x_guard_options.side)
                .value_or(kNone),
            off_m.y(),
            x_localizer->alarm(),
            x_guard.state(),
            x_seen_gap_m};
  }

  const Circuit& x_circuit;
  const CarFile& x_file;
  const World& x_world;
  const RacingLine& x_told;
  ClosedLoopOptions x_options;
  GuardOptions x_guard_options;
  SpeedProfile x_profile;
  Traffic x_nobody;
  RaceCar x_car;
  TrueMotion x_motion;
  ImuModel x_imu;
  VehicleModel x_vehicle;
  Noise x_match_noise;
  std::vector<GpsModel> x_receivers;
  std::vector<LidarModel> x_lidars;
  FaultInjector x_injector;
  std::unique_ptr<LoopLocalizer> x_localizer;
  WallFinder x_finder;
  Guard x_guard;
  WallFollower x_follower;
  SteeringHandover x_handover;
  ArrivalQueue<Sample> x_samples;
  ArrivalQueue<std::vector<Scan>> x_sweeps;
  double x_walls_s = kStartStamp_s;  ///< of the newest scan
  Path x_along;                      ///< along a wall, in the body frame then; empty while no wall leads
  double x_seen_gap_m = kNone;
  double x_command_rad = 0;
};

}  // namespace

std::vector<Fault> everySourceDrifts(const Track& track, const CarFile& car, double there_m, double from_s,
                                     double to_s, double drift_mps, double noise_m) {
  std::vector<std::string> sources;
  for (const auto& device : car.gps) sources.push_back(device.first);
  sources.emplace_back(kMatchLabel);
  std::vector<Fault> faults;
  double times = 1;
  for (const auto& source : sources) {
    Fault drift;
    drift.section = "fault_" + source;
    drift.kind = FaultKind::gps_ramp;
    drift.labels = source;
    drift.from_s = from_s;
    drift.to_s = to_s;
    drift.rate_mps = times * drift_mps;
    drift.direction_deg = yawOf(track.at(there_m).T_map_road) / kDegree + 90;
    faults.push_back(drift);
    Fault noise = drift;
    noise.kind = FaultKind::gps_noise;
    noise.sigma_m = noise_m;
    if (noise_m > 0) faults.push_back(noise);
    times += 0.5;
  }
  return faults;
}

ClosedLoop::ClosedLoop(const Circuit& circuit, const CarFile& car, const std::string& lidars,
                       std::uint64_t seed)
    : x_circuit(circuit), x_car(car), x_world(sceneryMesh(circuit, seed)) {
  constexpr double kLevel_m = 0.5;  // linePath() sees the road from above
  constexpr int kStep_m = 20;
  for (int s_m = 0; s_m < circuit.track.length_m(); s_m += kStep_m)
    if (std::abs(circuit.track.at(s_m).T_map_road.translation().z()) > kLevel_m)
      throw InputError("track " + circuit.path +
                       ": a closed loop needs a circuit that is level along its centre line");
  (void)car.devices(lidars);  // throws when a pattern fits none
  x_car.lidars.clear();
  for (const auto& device : car.lidars)
    if (matchesLabel(lidars, device.first)) x_car.lidars.push_back(device);
  x_car.driver.wander_m = 0;
  x_car.driver.grip_share = kMostGrip;
  if (x_car.gps.empty() || x_car.imus.empty() || x_car.vehicles.empty() || x_car.lidars.empty())
    throw InputError("car " + car.path + ": a closed loop needs a receiver, an IMU, a vehicle and a LiDAR");
  for (const auto& [label, gps] : x_car.gps)
    if (gps.heading != Heading::body)
      throw InputError("car " + car.path + ": [" + label + "] a closed loop needs heading = body");
}

ClosedLoopDrive ClosedLoop::drive(const RacingLine& told, const ClosedLoopOptions& options,
                                  const GuardOptions& guard, const WallPathOptions& wall_path) const {
  return LoopDrive(x_circuit, x_car, x_world, told, options, guard, wall_path).run();
}

namespace {

/** An offset for each 5 m or so of the centre line. */
template <class Offset>
RacingLine lineOf(const Track& track, Offset offset_m) {
  constexpr double kStep_m = 5;
  const auto knots = static_cast<std::size_t>(std::max(8.0, std::round(track.length_m() / kStep_m)));
  std::vector<double> n_m;
  n_m.reserve(knots);
  for (std::size_t i = 0; i < knots; ++i)
    n_m.push_back(offset_m(track.length_m() * static_cast<double>(i) / static_cast<double>(knots)));
  return {track, n_m};
}

}  // namespace

RacingLine lineAlongWall(const Circuit& circuit, const CarOptions& car, Side side, double gap_m) {
  return lineOf(circuit.track, [&](double s_m) {
    const auto from_centre_m = wallGap_m(circuit, s_m, 0, car.axle_height_m, side);
    if (!from_centre_m)
      throw InputError("track " + circuit.path + ": no wall on that side at station " + std::to_string(s_m) +
                       " m");
    return (side == Side::left ? 1 : -1) * (*from_centre_m - gap_m);
  });
}

RacingLine shiftedLine(const Track& track, const RacingLine& line, double from_m, double to_m, double ramp_m,
                       double shift_m) {
  const auto smooth = [](double x) {  // no jump of direction or curvature
    const double u = std::clamp(x, 0.0, 1.0);
    return u * u * u * (10 - u * (15 - 6 * u));
  };
  return lineOf(track, [&](double s_m) {
    return line.at(s_m).n_m - shift_m * smooth((s_m - from_m) / ramp_m) * smooth((to_m - s_m) / ramp_m);
  });
}

}  // namespace raceloc
