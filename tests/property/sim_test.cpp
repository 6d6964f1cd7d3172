/** \file
 * Laws of the simulator: what it says of its sensors and its car holds of what they give. */
#include <gmock/gmock.h>
#include <tbb/global_control.h>

#include <cmath>
#include <functional>

#include "sim/race.h"
#include "sim/scenery.h"
#include "sim/wall_gap.h"
#include "support/forall.h"
#include "support/lap.h"

namespace {

using namespace raceloc;
using namespace raceloc::test;
using Eigen::Vector3d;

/** Mean and standard deviation of what was added. */
class Statistic {
 public:
  void add(double value) {
    ++x_n;
    x_sum += value;
    x_squares += value * value;
  }
  [[nodiscard]] double n() const { return x_n; }
  [[nodiscard]] double mean() const { return x_sum / x_n; }
  [[nodiscard]] double sigma() const { return std::sqrt(x_squares / x_n - mean() * mean()); }

 private:
  double x_n = 0, x_sum = 0, x_squares = 0;
};

/** 4.5 standard errors: one false alarm in 150 000 checks, and the seeds are fixed. */
constexpr double kErrors = 4.5;
void expectNormal(const Statistic& found, double mean, double sigma) {
  EXPECT_NEAR(found.mean(), mean, kErrors * sigma / std::sqrt(found.n()) + 1e-12);
  EXPECT_NEAR(found.sigma(), sigma, kErrors * sigma / std::sqrt(2 * found.n()) + 1e-12);
}

// ---- Noise

TEST(NoiseProperty, IsNormalAndUniform) {
  for (const auto* name : {"a", "b", "gps_left/position"}) {
    const Noise noise(7, name);
    Statistic normal, uniform, product;
    for (std::uint64_t i = 0; i < 100'000; ++i) {
      normal.add(noise.normal(i));
      uniform.add(noise.uniform(i));
      product.add(noise.normal(i) * noise.normal(i + 1));
    }
    expectNormal(normal, 0, 1);
    EXPECT_NEAR(product.mean(), 0, kErrors / std::sqrt(product.n()));  // neighbours are independent
    EXPECT_NEAR(uniform.mean(), 0.5, kErrors / std::sqrt(12.0 * uniform.n()));
    EXPECT_NEAR(uniform.sigma(), 1 / std::sqrt(12),
                kErrors * std::sqrt(1.0 / 180 / uniform.n()) * std::sqrt(3.0));  // var(u^2)
  }
  EXPECT_NE(Noise(1, "a").uniform(0), Noise(2, "a").uniform(0));
  EXPECT_NE(Noise(1, "a").uniform(0), Noise(1, "b").uniform(0));
}

// ---- Car

class Car : public ::testing::TestWithParam<std::pair<const char*, const char*>> {};
INSTANTIATE_TEST_SUITE_P(On, Car,
                         ::testing::Values(std::pair("lvms", "indy"), std::pair("lor", "road_car"),
                                           std::pair("monza_like", "indy"),
                                           std::pair("everland_like", "road_car")),
                         [](const auto& test) {
                           return std::string(test.param.first) + "_" + test.param.second;
                         });

TEST_P(Car, KeepsToItsTyresAndItsLine) {
  Lap lap(GetParam().first, GetParam().second);
  const double end_s = 1.1 * lap.profile.lap_s();
  while (lap.car.state().time_s < end_s) {
    lap.car.step();
    const RaceCarState& x = lap.car.state();
    ASSERT_LE(x.front_friction_use, 1 + 1e-12) << x.s_m;
    ASSERT_LE(x.rear_friction_use, 1 + 1e-12) << x.s_m;
    ASSERT_LT(x.forward_mps, lap.circuit.pace.top_speed_mps + 0.5) << x.s_m;
    ASSERT_LT(std::abs(x.sideslip_rad()), 10 * kDegree) << x.s_m;  // it does not spin
    // The wander has a sigma of 0.3 m and at most sqrt(8) times that; the driver adds up to 0.5 m.
    ASSERT_LT(std::abs(x.n_m - lap.line.at(x.s_m).n_m), lap.file.driver.wander_m * std::sqrt(8) + 0.5)
        << x.s_m;
  }
  EXPECT_GT(lap.car.state().s_m, lap.circuit.track.length_m());
}

TEST(SteeredCar, FollowsTheCommandAsFastAsItCan) {
  Lap lap("lvms");
  const double most_step_rad = kDegree * lap.file.car.max_steering_rate_dps * RaceCar::kStep_s;
  const double from_rad = lap.car.state().steering_rad, wanted_rad = from_rad + 5.5 * most_step_rad;
  for (int i = 1; i <= 8; ++i) {
    lap.car.stepSteered(wanted_rad);
    EXPECT_NEAR(lap.car.state().steering_rad, from_rad + std::min(i * most_step_rad, 5.5 * most_step_rad),
                1e-12);  // sums of eight steps
  }
  EXPECT_GT(lap.car.state().s_m, 0);
}

TEST(SteeredCar, StartsAnywhereOnTheLine) {
  const Lap lap("lvms");
  const RaceCar car(lap.circuit.track, lap.line, lap.profile, lap.file.car, lap.file.driver, 50, 1, 600);
  EXPECT_EQ(car.state().s_m, 600);
  EXPECT_NEAR(car.state().n_m, lap.line.at(600).n_m, lap.file.driver.wander_m * std::sqrt(8));
  EXPECT_EQ(car.state().yaw_rate_rps, 50 * lap.line.at(600).curvature_per_m);
}

TEST(WallGap, IsWhatARayFindsAndLeavesTheWheels) {
  Lap lap("lvms");
  const auto& [circuit, file] = std::tie(lap.circuit, lap.file);
  const World world(sceneryMesh(circuit, 1));
  forAll(50, [&](Random& rnd) {
    RaceCarState car;
    car.s_m = rnd.uniform(0, circuit.track.length_m());
    car.n_m = rnd.uniform(-6, 0);
    const auto gap_m = wallGap_m(circuit, car.s_m, car.n_m, file.car.axle_height_m, Side::right);
    ASSERT_TRUE(gap_m.has_value());
    EXPECT_FALSE(wallGap_m(circuit, 600, 0, 0, Side::left).has_value());  // none inside turn 1
    const Pose T = circuit.track.surface(car.s_m, car.n_m).T_map_surface *
                   Eigen::Translation3d(0, 0, file.car.axle_height_m);
    // Across the road, to the wall as it was built: of chords of 1.5 m (1 mm from the arc), in floats.
    const Vector3d right = -T.linear().col(1);
    Hit hit;
    world.cast(T.translation(), &right, 1, 50, &hit);
    EXPECT_NEAR(hit.range_m, *gap_m, 5e-3);
    const double bank_cos = right.head<2>().norm(), level_m = *gap_m * bank_cos;
    // The car along the road: its outer wheels are half a width nearer, the same in front where the road is straight.
    const double wheel_m = wheelToWall_m(circuit, file.car, car);
    const double bend_m =
        std::abs(circuit.track.at(car.s_m).turn_per_m.z()) * std::pow(file.car.wheelbase_m, 2);
    EXPECT_NEAR(wheel_m, level_m - 0.5 * file.car.width_m * bank_cos, 5e-3 + bend_m);
    // Turned to the wall, it touches when the front corner does.
    car.heading_rad = -rnd.uniform(0.1, 1.5);
    const double reach_m = file.car.wheelbase_m * std::sin(-car.heading_rad) +
                           0.5 * file.car.width_m * std::cos(car.heading_rad);
    EXPECT_NEAR(wheelToWall_m(circuit, file.car, car), level_m - reach_m * bank_cos, 5e-3 + bend_m);
  });
}

TEST_P(Car, DriverDoesNotChatterBetweenThrottleAndBrakes) {
  Lap lap(GetParam().first, GetParam().second);
  int switches = 0, last = 0;
  while (lap.car.state().time_s < lap.profile.lap_s()) {
    lap.car.step();
    const double pull_mps2 = lap.car.state().forward_mps2;
    const int sense = pull_mps2 > 2 ? 1 : (pull_mps2 < -2 ? -1 : 0);
    if (sense == 0 || sense == last) continue;
    if (last != 0) ++switches;
    last = sense;
  }
  // Twice a corner, in at most 16 corners a lap; a line with bends of its own made four a second.
  EXPECT_LE(switches, 2 * 16);
}

TEST_P(Car, ForcesThatItsMotionTellsOfAreWithinFriction) {
  // From positions alone: what the road must have pushed with, for the centre of mass to move as it did.
  Lap lap(GetParam().first, GetParam().second);
  const CarOptions& car = lap.file.car;
  const double end_s = 0.7 * lap.profile.lap_s(), h_s = 0.005;
  lap.driveUntil(end_s);
  const auto centre_map = [&](double time_s) -> Vector3d {
    const RaceCarState x = lap.motion.state(time_s);
    return lap.circuit.track.surface(x.s_m, x.n_m).T_map_surface *
           (Eigen::AngleAxisd(x.heading_rad, Vector3d::UnitZ()) *
            Vector3d(car.wheelbase_m - car.front_m, 0, 0));
  };
  double largest_use = 0;
  for (double t = 1; t < end_s - 1; t += 0.05) {
    const RaceCarState x = lap.motion.state(t);
    const Eigen::Matrix3d R_map_car = lap.circuit.track.surface(x.s_m, x.n_m).T_map_surface.linear() *
                                      Eigen::AngleAxisd(x.heading_rad, Vector3d::UnitZ()).toRotationMatrix();
    const Vector3d acceleration =
        (centre_map(t + h_s) - 2 * centre_map(t) + centre_map(t - h_s)) / (h_s * h_s);
    Vector3d force_mps2 = R_map_car.transpose() * (acceleration + Vector3d(0, 0, kGravity_mps2));
    const double air = 0.5 * kAirDensity_kgpm3 * x.forward_mps * x.forward_mps / car.mass_kg;
    force_mps2.x() += air * car.drag_area_m2;
    force_mps2.z() += air * (car.downforce_area_front_m2 + car.downforce_area_rear_m2);
    const double use = force_mps2.head<2>().norm() / (car.friction * force_mps2.z());
    // 3 %: the load is that of the rear axle's path, the centre of mass is up to 1.7 m ahead of it on a road that
    // bends.
    ASSERT_LE(use, 1.03) << x.s_m;
    largest_use = std::max(largest_use, use);
  }
  EXPECT_GT(largest_use, 0.3);  // else this showed nothing
}

TEST_P(Car, CourseIsHeadingPlusSideslip) {
  Lap lap(GetParam().first, GetParam().second);
  lap.driveUntil(0.6 * lap.profile.lap_s());
  double largest_rad = 0;
  for (double t = 1; t < 0.6 * lap.profile.lap_s() - 1; t += 0.37) {
    // In the plane of the road, from positions alone. The axle moves with the body's heave and lean, so take the
    // place on the road.
    const auto on_road = [&](double time_s) {
      const RaceCarState x = lap.motion.state(time_s);
      return lap.circuit.track.surface(x.s_m, x.n_m).T_map_surface;
    };
    const double dt_s = 0.01;
    const RaceCarState x = lap.motion.state(t);
    const Pose T_map_road = on_road(t) * Eigen::AngleAxisd(x.heading_rad, Vector3d::UnitZ());
    const Vector3d step =
        T_map_road.linear().transpose() * (on_road(t + dt_s).translation() - on_road(t - dt_s).translation());
    // Slip changes by up to 1 rad/s^2 in quick manoeuvres: over +-10 ms its mean is within 1e-4 of its middle.
    EXPECT_NEAR(std::atan2(step.y(), step.x()), x.sideslip_rad(), 3e-4) << t;
    largest_rad = std::max(largest_rad, std::abs(x.sideslip_rad()));
  }
  EXPECT_GT(largest_rad, 0.5 * kDegree);  // else this showed nothing
}

TEST(CarProperty, StandsStillAndStarts) {
  Lap lap("ims");
  RaceCar car(lap.circuit.track, lap.line, lap.profile, lap.file.car, lap.file.driver, 0, 1);
  const Pose start = bodyPose(lap.circuit.track, lap.file.car, car.state());
  for (int i = 0; i < 3000; ++i) car.step(false);
  EXPECT_TRUE(bodyPose(lap.circuit.track, lap.file.car, car.state()).isApprox(start, 1e-12));
  for (int i = 0; i < 10'000; ++i) car.step();
  EXPECT_GT(car.state().forward_mps, 30);
}

TEST(SpeedProfileProperty, LvmsIsDrivenAsInThePaper) {
  Circuit circuit = readCircuit(shipped("share/tracks/lvms.ini"));
  circuit.pace.top_speed_mps = 244 / 3.6;
  const CarFile file = readCarFile(shipped("ini/sim/indy.ini"));
  const RacingLine line(circuit.track, file.driver.margin_m);
  const SpeedProfile profile(circuit.track, line, file.car, file.driver, circuit.pace);
  EXPECT_NEAR(3.6 * profile.top_mps(), 244, 0.5);
  EXPECT_NEAR(3.6 * profile.mean_mps(), 225, 3);
}

TEST(SpeedProfileProperty, StationsPassAtItsSpeed) {
  const Lap lap("monza_like");
  forAll(200, [&](Random& rnd) {
    const double t_s = rnd.uniform(1, 3 * lap.profile.lap_s()), dt_s = 0.01;
    const double s_m = lap.profile.stationAfter(t_s);
    const double speed_mps = (lap.profile.stationAfter(t_s + dt_s) - lap.profile.stationAfter(t_s - dt_s)) /
                             (2 * dt_s) * lap.line.at(s_m).stretch;
    // The table has a row each 2 m: braking with 14 m/s^2 at 20 m/s changes the speed by 1.4 m/s in one, half of it
    // either way.
    EXPECT_NEAR(speed_mps, lap.profile.at(s_m).speed_mps, 0.7);
  });
  EXPECT_NEAR(lap.profile.stationAfter(lap.profile.lap_s()), lap.circuit.track.length_m(), 1e-6);
}

// ---- Motion: its derivatives belong to its poses

TEST(TrueMotionProperty, GyroTurnsTheBodyAndVelocityMovesIt) {
  Lap lap("lvms");
  lap.driveUntil(8);
  const double step_s = 0.002;
  Pose T = lap.motion.T_map_body(2);
  for (double t = 2; t < 6 - 1e-9; t += step_s) {
    const Vector3d turn_rad = lap.motion.gyro_body_rps(t + 0.5 * step_s) * step_s;
    T.translation() += lap.motion.velocity_map_mps(t + 0.5 * step_s, Vector3d::Zero()) * step_s;
    Vector6d increment = Vector6d::Zero();
    increment.head<3>() = turn_rad;
    T = T * se3Exp(increment);
  }
  const Pose truth = lap.motion.T_map_body(6);
  // Differences over +-5 ms smooth the vibration (up to 27 rad/s) by (27 * 0.005)^2 / 6 = 0.3 % of its 3 mrad and 1 cm.
  EXPECT_LT(Eigen::AngleAxisd(Eigen::Matrix3d(truth.linear().transpose() * T.linear())).angle(), 1e-4);
  EXPECT_LT((truth.translation() - T.translation()).norm(), 2e-3);
}

TEST(TrueMotionProperty, SpecificForceAtRestIsGravity) {
  Lap lap("ims");
  RaceCar car(lap.circuit.track, lap.line, lap.profile, lap.file.car, lap.file.driver, 0, 1);
  TrueMotion motion(lap.circuit.track, lap.file.car, 10);
  for (int i = 0; i < 1000; ++i) {
    car.step(false);
    motion.add(car.state());
  }
  const Vector3d force = motion.specificForce_body_mps2(0.5, {1, 2, 3});
  EXPECT_NEAR(force.norm(), kGravity_mps2, 1e-6);
  EXPECT_GT(force.z(), 0.98 * kGravity_mps2);
  EXPECT_LT(motion.gyro_body_rps(0.5).norm(), 1e-9);
}

TEST(TrueMotionProperty, SpecificForceInATurnIsWhatTheTyresGive) {
  Lap lap("ims");
  lap.driveUntil(lap.profile.lap_s());
  Statistic along, across;
  // Steps of the vibration's periods cancel what the body's swaying adds at the centre of mass; what the engine does
  // at the edges of a step does not matter in the mean.
  const double rear_m = lap.file.car.wheelbase_m - lap.file.car.front_m;
  const Vector3d centre(rear_m, 0, 0);
  for (double t = 2; t < lap.profile.lap_s() - 1; t += 0.01) {
    const RaceCarState x = lap.motion.state(t);
    const Vector3d force = lap.motion.specificForce_body_mps2(t, centre);
    along.add(force.x() - x.forward_mps2);
    across.add(force.y() - x.leftward_mps2);
  }
  EXPECT_NEAR(across.mean(), 0, 0.15);  // the body leans up to 0.5 deg in a bend: sin(0.5 deg) g = 0.09
  EXPECT_NEAR(along.mean(), 0, 0.15);
}

// ---- World and LiDAR

/** First triangle along a ray, by trying all of them in double. Source: Moeller and Trumbore, 1997. */
double bruteRange(const Mesh& mesh, const Vector3d& origin, const Vector3d& direction, double max_m) {
  double first_m = max_m;
  for (const auto& [ia, ib, ic] : mesh.triangles) {
    const Vector3d a = mesh.vertices[ia].cast<double>();
    const Vector3d ab = mesh.vertices[ib].cast<double>() - a, ac = mesh.vertices[ic].cast<double>() - a;
    const Vector3d p = direction.cross(ac);
    const double determinant = ab.dot(p);
    if (std::abs(determinant) < 1e-14) continue;
    const Vector3d t = origin - a, q = t.cross(ab);
    const double u = t.dot(p) / determinant, v = direction.dot(q) / determinant;
    if (u < 0 || v < 0 || u + v > 1) continue;
    const double range_m = ac.dot(q) / determinant;
    if (range_m > 0.05 && range_m < first_m) first_m = range_m;
  }
  return first_m;
}

TEST(WorldProperty, RaysMeetTheFirstTriangle) {
  const Lap lap("lor");
  const Mesh mesh = sceneryMesh(lap.circuit, 3);
  const World world(mesh);
  int differ = 0, met = 0;
  const int cast = forAll(150, [&](Random& rnd) {
    const Vector3d origin =
        lap.circuit.track.surface(rnd.uniform(0, 1100), rnd.uniform(-5, 5)).T_map_surface *
        Vector3d(0, 0, rnd.uniform(0.3, 2));
    const Vector3d direction =
        Vector3d(rnd.uniform(-1, 1), rnd.uniform(-1, 1), rnd.uniform(-0.3, 0.3)).normalized();
    Hit hit;
    world.cast(origin, &direction, 1, 150, &hit);
    const double truth_m = bruteRange(mesh, origin, direction, 150);
    met += hit.range_m > 0 ? 1 : 0;
    // Floats place a ray within 0.2 mm: at an edge it may pass on the other side.
    if (std::abs((hit.range_m > 0 ? hit.range_m : 150) - truth_m) > 1e-6) ++differ;
  });
  EXPECT_GT(met, cast / 2);
  EXPECT_LE(differ, 1);
}

class EveryTrack : public ::testing::TestWithParam<const char*> {};
INSTANTIATE_TEST_SUITE_P(Shipped, EveryTrack,
                         ::testing::Values("lvms", "ims", "tms", "lor", "monza_like", "everland_like"),
                         [](const auto& test) { return std::string(test.param); });

TEST_P(EveryTrack, RoadIsWhatACarStandsOn) {
  const Lap lap(GetParam());
  const World world(sceneryMesh(lap.circuit, 1));
  for (double s_m = 0; s_m < lap.circuit.track.length_m(); s_m += 2.3) {
    const RoadFrame road = lap.circuit.track.at(s_m);
    for (const double n_m :
         {0.05 - road.right_m, -0.4 * road.right_m, 0.0, 0.7 * road.left_m, road.left_m - 0.05}) {
      const Pose T = lap.circuit.track.surface(s_m, n_m).T_map_surface;
      const Vector3d down = -T.linear().col(2);
      Hit hit;
      world.cast(T * Vector3d(0, 0, 2), &down, 1, 10, &hit);
      // Triangles of 1.5 m on a road that twists by 0.003 rad/m and is 10 m wide: a centimetre at the very most.
      ASSERT_NEAR(hit.range_m, 2, 0.01) << "station " << s_m << ", offset " << n_m;
    }
  }
}

/** Residual of each point of some sweeps: its range less that to the surface from the true pose at its own time. */
Statistic rangeResiduals(const LidarOptions& options, std::uint64_t seed) {
  Lap lap("lor");
  const World world(sceneryMesh(lap.circuit, 1));
  const Traffic nobody(lap.circuit.track, lap.line, lap.profile, lap.file.car, 0, 1);
  const LidarModel lidar(options, "lidar", seed);
  lap.driveUntil(12);
  Statistic residual;
  for (std::uint64_t number = 0; number < 8; ++number) {
    const double begin_s = 1 + 1.3 * static_cast<double>(number);
    const Scan scan = lidar.sweep(lap.motion, world, nobody, begin_s, number);
    EXPECT_EQ(scan.stamp_s, kStartStamp_s + begin_s + options.clock_offset_s);
    for (std::size_t i = 0; i < scan.cloud.size(); i += 3) {
      const Pose T_map_lidar =
          lap.motion.T_map_body(begin_s + static_cast<double>(scan.time_s[i])) * options.T_body_lidar();
      const Vector3d p_lidar = scan.cloud.point(i).cast<double>();
      const Vector3d direction = T_map_lidar.linear() * p_lidar.normalized();
      Hit hit;
      world.cast(T_map_lidar.translation(), &direction, 1, options.max_range_m + 1, &hit);
      // Floats of time and direction: at a silhouette or at 1 deg of incidence a point may belong to another surface.
      if (std::abs(hit.range_m - p_lidar.norm()) < 0.5 && hit.brightness > 0.01)
        residual.add(p_lidar.norm() - hit.range_m);
    }
    EXPECT_GT(scan.cloud.size(), 1000U);
  }
  return residual;
}

TEST(LidarProperty, PointsLieOnTheirSurfacesWithinTheNoise) {
  LidarOptions options;
  options.x_m = 2;
  options.z_m = 0.5;
  options.yaw_deg = 30;
  options.range_sigma_m = 0.03;
  options.range_bias_m = 0.05;
  options.clock_offset_s = 0.25;
  const Statistic residual = rangeResiduals(options, 5);
  EXPECT_GT(residual.n(), 10'000);
  EXPECT_NEAR(residual.mean(), 0.05, 0.001);  // 0.03 / sqrt(10 000), and coarse incidence
  EXPECT_NEAR(residual.sigma(), 0.03, 0.002);
}

TEST(LidarProperty, WithoutNoiseTheyLieOnThem) {
  LidarOptions options;
  options.z_m = 0.5;
  options.range_sigma_m = 0;
  const Statistic residual = rangeResiduals(options, 5);
  EXPECT_NEAR(residual.mean(), 0, 1e-3);
  EXPECT_LT(residual.sigma(), 5e-3);  // float time (6e-9 s) and direction (6e-8) at grazing incidence
}

TEST(LidarProperty, LosesTheSharesThatItStates) {
  Lap lap("lor");
  const World world(sceneryMesh(lap.circuit, 1));
  const Traffic nobody(lap.circuit.track, lap.line, lap.profile, lap.file.car, 0, 1);
  lap.driveUntil(4);
  LidarOptions options;
  options.dropout_share = 0;
  options.range_at_10_percent_m = 1000;
  const auto seen = [&](const LidarOptions& o) {
    return static_cast<double>(LidarModel(o, "lidar", 1).sweep(lap.motion, world, nobody, 1, 0).cloud.size());
  };
  const double all = seen(options);
  options.dropout_share = 0.3;
  EXPECT_NEAR(seen(options) / all, 0.7, kErrors * std::sqrt(0.21 / all));
  options.dropout_share = 0;
  options.range_at_10_percent_m = 8;  // dark and far surfaces vanish
  EXPECT_LT(seen(options), 0.8 * all);
}

TEST(LidarProperty, SeesOtherCarsWhereTheyAre) {
  Lap lap("lor");
  const World world(sceneryMesh(lap.circuit, 1));
  const Traffic traffic(lap.circuit.track, lap.line, lap.profile, lap.file.car, 20, 1);
  lap.driveUntil(4);
  LidarOptions options;
  options.azimuth_min_deg = -180;
  options.azimuth_max_deg = 180;
  options.z_m = 0.6;
  options.range_sigma_m = 0;
  std::size_t on_cars = 0;
  const Scan scan = LidarModel(options, "lidar", 1).sweep(lap.motion, world, traffic, 2, 0);
  for (std::size_t i = 0; i < scan.cloud.size(); ++i) {
    const double time_s = 2 + static_cast<double>(scan.time_s[i]);
    const Vector3d p_map =
        lap.motion.T_map_body(time_s) * options.T_body_lidar() * scan.cloud.point(i).cast<double>();
    for (const auto& box : traffic.at(time_s)) {
      const Vector3d p_box = (box.T_map_box.inverse() * p_map).cwiseAbs() - box.half_m;
      if (p_box.maxCoeff() < 2e-3) {
        ++on_cars;
        EXPECT_GT(p_box.maxCoeff(), -2e-3);  // on the skin, not within
      }
    }
  }
  EXPECT_GT(on_cars, 20U);
}

// ---- Other sensors

TEST(GpsProperty, WhiteNoiseAndVelocityAreAsStated) {
  Lap lap("lvms");
  lap.driveUntil(36);
  GpsOptions options;
  options.x_m = 1.6;
  options.z_m = 1;
  options.horizontal_sigma_m = 0.4;
  options.vertical_sigma_m = 0.7;
  options.drift_sigma_m = 0;
  options.clock_offset_s = -0.2;
  options.heading_sigma_deg = 0.3;
  options.attitude_sigma_deg = 0.2;
  options.velocity_sigma_mps = 0.5;
  GpsModel gps(options, "gps", 11);
  Statistic east, up, heading, roll, speed;
  for (std::uint64_t number = 0; number < 3500; ++number) {
    const double time_s = 0.5 + 0.01 * static_cast<double>(number);
    const auto out = gps.measure(lap.motion, time_s, number);
    EXPECT_NEAR(out.fix.stamp_s, kStartStamp_s + time_s - 0.2, 1e-6);
    const Pose T = lap.motion.T_map_body(time_s);
    const Vector3d error_m = out.fix.p_map_antenna_m - T * options.p_body_m();
    east.add(error_m.x());
    up.add(error_m.z());
    EXPECT_TRUE((out.pose->T_map_body.translation() - T.translation()).isApprox(error_m, 1e-6));
    const Vector6d turn = se3Log(T.inverse() * out.pose->T_map_body);
    heading.add(turn[2]);
    roll.add(turn[0]);
    const Vector3d v = lap.motion.velocity_map_mps(time_s, options.p_body_m());
    speed.add(out.fix.velocity->speed_mps * std::cos(out.fix.velocity->course_rad) - v.x());
    EXPECT_TRUE(out.fix.cov_map_m2.isApprox(Eigen::Matrix3d(Vector3d(0.16, 0.16, 0.49).asDiagonal()), 1e-9));
  }
  expectNormal(east, 0, 0.4);
  expectNormal(up, 0, 0.7);
  expectNormal(heading, 0, 0.3 * kDegree);
  expectNormal(roll, 0, 0.2 * kDegree);
  expectNormal(speed, 0, 0.5);
}

TEST(GpsProperty, DriftKeepsItsVarianceAndItsTime) {
  Lap lap("ims");
  lap.driveUntil(2);
  GpsOptions options;
  options.rate_hz = 10;
  options.horizontal_sigma_m = options.vertical_sigma_m = 0;
  options.drift_sigma_m = 2;
  options.drift_time_s = 5;
  Statistic first, later, product;
  for (std::uint64_t seed = 0; seed < 3000; ++seed) {
    GpsModel gps(options, "gps", seed);
    const auto error_m = [&](std::uint64_t number) {
      return (gps.measure(lap.motion, 1, number).fix.p_map_antenna_m - lap.motion.T_map_body(1).translation())
          .x();
    };
    const double begin_m = error_m(0);
    double end_m = 0;
    for (std::uint64_t number = 1; number <= 50; ++number) end_m = error_m(number);  // one time constant
    first.add(begin_m);
    later.add(end_m);
    product.add(begin_m * end_m);
  }
  expectNormal(first, 0, 2);
  expectNormal(later, 0, 2);
  // Var(xy) of a normal pair with correlation c is s^4 (1 + c^2).
  EXPECT_NEAR(product.mean(), 4 * std::exp(-1), kErrors * 4 * 1.07 / std::sqrt(product.n()));
}

TEST(ImuProperty, NoiseAndBiasAreAsStated) {
  Lap lap("lvms");
  lap.driveUntil(34);
  ImuOptions options;
  options.gyro_sigma_dps = 0.7;
  options.gyro_bias_sigma_dps = 0.2;
  options.force_sigma_mps2 = 0.3;
  options.force_bias_sigma_mps2 = 0.1;
  options.y_m = 0.5;
  const ImuModel imu(options, "imu", 3);
  Statistic gyro, force;
  for (std::uint64_t number = 0; number < 3000; ++number) {
    const double time_s = 0.5 + 0.01 * static_cast<double>(number);
    const ImuSample sample = imu.measure(lap.motion, time_s, number);
    gyro.add((sample.gyro_body_rps - lap.motion.gyro_body_rps(time_s)).y());
    force.add(
        (sample.specific_force_body_mps2 - lap.motion.specificForce_body_mps2(time_s, {0, 0.5, 0})).z());
  }
  expectNormal(gyro, imu.gyroBias_rps().y(), 0.7 * kDegree);
  expectNormal(force, imu.forceBias_mps2().z(), 0.3);
  Statistic gyro_bias, force_bias;
  for (std::uint64_t seed = 0; seed < 2000; ++seed) {
    const ImuModel one(options, "imu", seed);
    gyro_bias.add(one.gyroBias_rps().z());
    force_bias.add(one.forceBias_mps2().x());
  }
  expectNormal(gyro_bias, 0, 0.2 * kDegree);
  expectNormal(force_bias, 0, 0.1);
}

TEST(ImuProperty, Saturates) {
  Lap lap("lvms");
  lap.driveUntil(30);
  ImuOptions options;
  options.gyro_limit_dps = 5;
  options.force_limit_mps2 = 10;
  const ImuModel imu(options, "imu", 3);
  bool at_limit = false;
  for (std::uint64_t number = 0; number < 290; ++number) {
    const ImuSample sample = imu.measure(lap.motion, 0.5 + 0.1 * static_cast<double>(number), number);
    EXPECT_LE(sample.gyro_body_rps.cwiseAbs().maxCoeff(), 5 * kDegree + 1e-12);
    EXPECT_LE(sample.specific_force_body_mps2.cwiseAbs().maxCoeff(), 10 + 1e-12);
    at_limit = at_limit || sample.gyro_body_rps.z() > 5 * kDegree - 1e-9;
  }
  EXPECT_TRUE(at_limit);
}

TEST(VehicleProperty, NoiseAndBiasAreAsStated) {
  Lap lap("lvms");
  lap.driveUntil(34);
  VehicleOptions options;
  options.speed_scale_sigma = 0.01;
  options.speed_sigma_mps = 0.2;
  options.steering_sigma_deg = 0.4;
  options.steering_offset_sigma_deg = 0.5;
  options.yaw_rate_sigma_dps = 0.6;
  options.yaw_rate_bias_sigma_dps = 0.3;
  const VehicleModel vehicle(options, "vehicle", 9);
  Statistic speed, steering, yaw_rate;
  for (std::uint64_t number = 0; number < 3000; ++number) {
    const double time_s = 0.5 + 0.01 * static_cast<double>(number);
    const MotionSample sample = vehicle.measure(lap.motion, time_s, number);
    const RaceCarState x = lap.motion.state(time_s);
    speed.add(sample.speed_mps - vehicle.speedScale() * (1 + x.wheel_slip) * x.forward_mps);
    steering.add(*sample.steering_rad - x.steering_rad - vehicle.steeringOffset_rad());
    yaw_rate.add(sample.yaw_rate_rps - lap.motion.gyro_body_rps(time_s).z() - vehicle.yawRateBias_rps());
    EXPECT_LT(std::abs(x.wheel_slip), 0.15);
  }
  expectNormal(speed, 0, 0.2);
  expectNormal(steering, 0, 0.4 * kDegree);
  expectNormal(yaw_rate, 0, 0.6 * kDegree);
  Statistic scale, offset, bias;
  for (std::uint64_t seed = 0; seed < 2000; ++seed) {
    const VehicleModel one(options, "vehicle", seed);
    scale.add(one.speedScale());
    offset.add(one.steeringOffset_rad());
    bias.add(one.yawRateBias_rps());
  }
  expectNormal(scale, 1, 0.01);
  expectNormal(offset, 0, 0.5 * kDegree);
  expectNormal(bias, 0, 0.3 * kDegree);
}

// ---- The stream

CarFile smallCar() {
  CarFile car = readCarFile(shipped("ini/sim/indy.ini"));
  for (auto& [label, lidar] : car.lidars) {
    lidar.beams = 8;
    lidar.columns = 40;
  }
  return car;
}

/** All that a stream says, as text: equal texts, equal bits. */
std::string textOf(Race& race) {
  std::string text;
  const auto put = [&](auto... values) {
    for (const double value : {static_cast<double>(values)...})
      text.append(reinterpret_cast<const char*>(&value), sizeof value);
  };
  while (const auto arrival = race.next()) {
    put(arrival->time_s);
    if (const auto* truth = std::get_if<StampedPose>(&arrival->message)) {
      put(truth->stamp_s, truth->T_map_body.translation().x(), truth->T_map_body.linear()(1, 2));
      continue;
    }
    const auto& sample = std::get<Sample>(arrival->message);
    text += labelOf(sample);
    put(stampOf(sample));
    if (const auto* scan = std::get_if<Scan>(&sample))
      for (std::size_t i = 0; i < scan->cloud.size(); ++i)
        put(scan->cloud.x[i], scan->cloud.y[i], scan->cloud.z[i], scan->cloud.intensity[i], scan->time_s[i],
            scan->ring[i]);
    if (const auto* fix = std::get_if<GpsFix>(&sample))
      put(fix->p_map_antenna_m.x(), fix->p_map_antenna_m.z());
    if (const auto* imu = std::get_if<ImuSample>(&sample))
      put(imu->gyro_body_rps.x(), imu->specific_force_body_mps2.z());
    if (const auto* motion = std::get_if<MotionSample>(&sample))
      put(motion->speed_mps, *motion->steering_rad);
  }
  return text;
}

TEST(RaceProperty, SameBitsForAnyNumberOfThreads) {
  const Circuit circuit = readCircuit(shipped("share/tracks/lor.ini"));
  const CarFile car = smallCar();
  RaceOptions options;
  options.laps = 0.1;
  options.traffic = 2;
  std::vector<std::string> texts;
  for (const std::size_t threads : {1U, 2U, 4U}) {
    const tbb::global_control limit(tbb::global_control::max_allowed_parallelism, threads);
    Race race(circuit, car, options);
    // Embree shares TBB with us: it must leave us the threads.
    EXPECT_EQ(tbb::global_control::active_value(tbb::global_control::max_allowed_parallelism), threads);
    texts.push_back(textOf(race));
  }
  EXPECT_GT(texts[0].size(), 100'000U);
  EXPECT_TRUE(texts[0] == texts[1]);
  EXPECT_TRUE(texts[0] == texts[2]);
  options.seed = 2;
  Race other(circuit, car, options);
  EXPECT_FALSE(textOf(other) == texts[0]);
}

TEST(RaceProperty, ArrivesInOrderAtTheStatedRatesAndLatencies) {
  const Circuit circuit = readCircuit(shipped("share/tracks/lor.ini"));
  CarFile car = smallCar();
  car.gps[1].second.clock_offset_s = 0.4;
  RaceOptions options;
  options.laps = 0.2;
  Race race(circuit, car, options);
  double last_s = 0;
  std::map<std::string, std::vector<double>> stamps;
  while (const auto arrival = race.next()) {
    EXPECT_GE(arrival->time_s, last_s);
    last_s = arrival->time_s;
    const auto* sample = std::get_if<Sample>(&arrival->message);
    if (sample == nullptr || std::holds_alternative<InsPose>(*sample)) continue;
    stamps[labelOf(*sample)].push_back(stampOf(*sample));
    const double delay_s = arrival->time_s - (stampOf(*sample) - kStartStamp_s);
    if (labelOf(*sample) == "gps_left") {
      EXPECT_NEAR(delay_s, 0.03, 1e-6);
    }
    if (labelOf(*sample) == "gps_right") {
      EXPECT_NEAR(delay_s, 0.035 - 0.4, 1e-6);
    }
    if (labelOf(*sample) == "lidar_left") {
      EXPECT_NEAR(delay_s, 0.1 + 0.02, 1e-6);
    }
  }
  ASSERT_EQ(stamps.size(), 7U);
  for (const auto& [label, rate_hz] :
       {std::pair("gps_left", 20.0), std::pair("imu", 100.0), std::pair("lidar_front", 10.0)})
    for (std::size_t i = 1; i < stamps[label].size(); ++i)
      EXPECT_NEAR(stamps[label][i] - stamps[label][i - 1], 1 / rate_hz, 1e-6);
}

TEST(RaceProperty, SaysThatACarIsTooWeakForItsTrack) {
  const Circuit circuit = readCircuit(shipped("share/tracks/everland_like.ini"));  // climbs of 6 %
  CarFile car = smallCar();
  car.car.mass_kg = 20'000;
  car.car.power_w = 1000;
  RaceOptions options;
  options.labels = "imu";
  options.start_mps = 0;
  Race race(circuit, car, options);
  try {
    while (race.next()) {
    }
    FAIL() << "it drove to the end";
  } catch (const InputError& e) {
    EXPECT_THAT(e.what(), ::testing::HasSubstr("does not get on"));
    EXPECT_THAT(e.what(), ::testing::HasSubstr("everland_like.ini"));
    EXPECT_THAT(e.what(), ::testing::HasSubstr("indy.ini"));
  }
}

TEST(RaceProperty, TellsWhichDevicesThereAre) {
  const Circuit circuit = readCircuit(shipped("share/tracks/lor.ini"));
  RaceOptions options;
  options.labels = "radar_*";
  try {
    const Race race(circuit, smallCar(), options);
    FAIL();
  } catch (const InputError& e) {
    EXPECT_THAT(e.what(), ::testing::HasSubstr("radar_*"));
    EXPECT_THAT(e.what(), ::testing::HasSubstr("lidar_front"));
  }
}

}  // namespace
