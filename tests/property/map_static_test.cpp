#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <stdexcept>
#include <unordered_set>
#include <vector>

#include "map/static_points.h"
#include "support/forall.h"

namespace raceloc {
namespace {

using test::forAll;
using test::Random;

enum class Kind { road, kerb, wall, fence, post, building, parked, car };

/** Upright or lying in the road's frame (x along it, z off it). */
struct Box {
  Kind kind;
  Eigen::Vector3d middle_m, half_m;

  /** Along a ray from `from_m`, a unit vector; infinite where it misses. */
  [[nodiscard]] double range(const Eigen::Vector3d& from_m, const Eigen::Vector3d& ray) const {
    double enter_m = 0, leave_m = std::numeric_limits<double>::infinity();
    for (int axis = 0; axis < 3; ++axis) {
      const double a = (middle_m(axis) - half_m(axis) - from_m(axis)) / ray(axis);
      const double b = (middle_m(axis) + half_m(axis) - from_m(axis)) / ray(axis);
      enter_m = std::max(enter_m, std::min(a, b));
      leave_m = std::min(leave_m, std::max(a, b));
    }
    return enter_m > 0 && enter_m < leave_m ? enter_m : std::numeric_limits<double>::infinity();
  }
};

struct SeenScan {
  Cloud scan_body;
  Pose T_map_body;                  ///< as the survey has it: 0.05 deg and 2 cm beside the truth
  Eigen::Vector3d p_body_sensor_m;  ///< middle of the LiDARs
  std::vector<Kind> kinds;          ///< of what each point is on
};

/** A straight piece of a track, seen by two LiDARs of 32 beams between its walls and posts. */
struct Course {
  double length_m = 60;
  Pose T_map_road = Pose::Identity();
  double axle_m = 0.3;
  std::vector<Eigen::Vector3d> p_body_lidars_m;
  std::vector<Box> standing;
  double mesh_share = 0.3;  ///< of the rays that meet a fence return

  [[nodiscard]] SeenScan seen(double along_m, double left_m, const std::vector<Box>& driving,
                              Random& rnd) const;
};

Course randomCourse(Random& rnd, double bank_rad) {
  Course course;
  course.T_map_road = poseFromRpy({rnd.uniform(-2000, 2000), rnd.uniform(-2000, 2000), rnd.uniform(-50, 50)},
                                  bank_rad, rnd.uniform(-3, 3) * kDegree, rnd.uniform(-3, 3));
  const double height_m = rnd.uniform(0.6, 1.5);  // above the axle: not far below the top of other cars
  course.p_body_lidars_m = {{2.2, 0.4, height_m}, {0.2, -0.4, height_m}};
  const double middle_m = course.length_m / 2, half_m = middle_m + 150;
  course.standing.push_back({Kind::wall, {middle_m, -6, 0.5}, {half_m, 0.1, 0.5}});
  course.standing.push_back({Kind::wall, {middle_m, 9, 0.6}, {half_m, 0.1, 0.6}});
  course.standing.push_back({Kind::fence, {middle_m, 9, 2.6}, {half_m, 0.005, 1.4}});
  course.standing.push_back({Kind::parked, {rnd.uniform(20, 50), 7, 0.75}, {2.3, 0.9, 0.65}});
  for (int x_m = 0; x_m < course.length_m; x_m += 10)
    course.standing.push_back({Kind::post, {static_cast<double>(x_m), 6, 1}, {0.04, 0.04, 1}});
  course.standing.push_back({Kind::kerb, {middle_m, 5, 0.04}, {half_m, 0.4, 0.04}});
  course.standing.push_back({Kind::building, {middle_m, 40, 5}, {half_m, 2, 5}});
  course.standing.push_back({Kind::building, {middle_m, -30, 5}, {half_m, 2, 5}});
  return course;
}

SeenScan Course::seen(double along_m, double left_m, const std::vector<Box>& driving, Random& rnd) const {
  const Pose T_road_body = poseFromRpy({along_m, left_m, axle_m}, rnd.normal(0.5 * kDegree),
                                       rnd.normal(0.5 * kDegree), rnd.normal(1 * kDegree));
  SeenScan scan;
  scan.T_map_body = T_map_road * T_road_body * rnd.pose(0.05 * kDegree, 0.02);
  scan.p_body_sensor_m = Eigen::Vector3d::Zero();
  std::unordered_set<int> taken;  // thinned to one point in 0.1 m
  for (const Eigen::Vector3d& p_body_lidar_m : p_body_lidars_m) {
    scan.p_body_sensor_m += p_body_lidar_m / static_cast<double>(p_body_lidars_m.size());
    const Eigen::Vector3d from_m = T_road_body * p_body_lidar_m;
    const double phase_rad = rnd.uniform(0, 2 * M_PI);
    for (int beam = 0; beam < 32; ++beam)
      for (int column = 0; column < 900; ++column) {
        const double up_rad = (-25 + 0.9 * beam) * kDegree, turn_rad = phase_rad + column * 2 * M_PI / 900;
        const Eigen::Vector3d ray_body(std::cos(up_rad) * std::cos(turn_rad),
                                       std::cos(up_rad) * std::sin(turn_rad), std::sin(up_rad));
        const Eigen::Vector3d ray = T_road_body.linear() * ray_body;
        double range_m = ray.z() < 0 ? -from_m.z() / ray.z() : std::numeric_limits<double>::infinity();
        Kind kind = Kind::road;
        const auto meet = [&](const Box& box) {
          const double box_m = box.range(from_m, ray);
          if (box_m >= range_m || (box.kind == Kind::fence && rnd.uniform(0, 1) > mesh_share)) return;
          range_m = box_m;
          kind = box.kind;
        };
        for (const Box& box : standing) meet(box);
        for (const Box& box : driving) meet(box);
        if (range_m > 100 || range_m < 3) continue;
        const Eigen::Vector3d p_m = p_body_lidar_m + (range_m + rnd.normal(0.02)) * ray_body;
        const Eigen::Array3i cell = (p_m.array() / 0.1).floor().cast<int>() + 1024;
        if (!taken.insert((cell.x() << 11 | cell.y()) << 10 | (cell.z() & 1023)).second) continue;
        scan.scan_body.push(p_m.cast<float>());
        scan.kinds.push_back(kind);
      }
  }
  return scan;
}

Box car(double along_m, double left_m) { return {Kind::car, {along_m, left_m, 0.65}, {2.4, 0.95, 0.55}}; }

/** Three laps: behind a car of the same speed, past a slower one, and alone. */
std::vector<SeenScan> surveyed(const Course& course, Random& rnd) {
  std::vector<SeenScan> scans;
  const double gap_m = rnd.uniform(12, 40), slower = rnd.uniform(0.3, 0.8);
  for (int lap = 0; lap < 3; ++lap)
    for (int x_m = 0; x_m < course.length_m; x_m += 6) {
      std::vector<Box> driving;
      if (lap == 0) driving = {car(x_m + gap_m, rnd.uniform(-0.1, 0.1))};
      if (lap == 1) driving = {car(course.length_m / 2 + slower * (x_m - course.length_m / 2), -3.5)};
      scans.push_back(course.seen(x_m, lap == 1 ? 0.5 : -1, driving, rnd));
    }
  return scans;
}

StaticVoxels counted(const std::vector<SeenScan>& scans, const StaticOptions& options = {}) {
  StaticVoxels voxels(options);
  for (const SeenScan& s : scans) voxels.mark(s.scan_body, s.T_map_body);
  voxels.endMarking();
  for (const SeenScan& s : scans) voxels.count(voxels.look(s.scan_body, s.T_map_body, s.p_body_sensor_m));
  voxels.endCounting();
  return voxels;
}

struct Tally {
  double points = 0, removed = 0;
  [[nodiscard]] double share() const { return removed / points; }
};

std::map<Kind, Tally> tallied(const StaticVoxels& voxels, const std::vector<SeenScan>& scans) {
  std::map<Kind, Tally> tallies;
  for (const SeenScan& s : scans)
    for (std::size_t i = 0; i < s.scan_body.size(); ++i) {
      Tally& tally = tallies[s.kinds[i]];
      ++tally.points;
      tally.removed += voxels.isStatic(s.T_map_body * s.scan_body.point(i).cast<double>()) ? 0 : 1;
    }
  return tallies;
}

class StaticVoxelsOnBank : public testing::TestWithParam<double> {};
INSTANTIATE_TEST_SUITE_P(StaticVoxelsProperty, StaticVoxelsOnBank, testing::Values(0, 20));

TEST_P(StaticVoxelsOnBank, TakeOutWhatDrivesAndLeaveTheRest) {
  forAll(2, [](Random& rnd) {
    const Course course = randomCourse(rnd, GetParam() * kDegree);
    const auto scans = surveyed(course, rnd);
    auto tallies = tallied(counted(scans), scans);
    Tally all_static;
    for (const auto& [kind, tally] : tallies) {
      if (kind == Kind::car) continue;
      all_static.points += tally.points;
      all_static.removed += tally.removed;
    }
    ASSERT_GT(tallies[Kind::car].points, 3000);
    // What is left is in one layer with the road, or at the top, where rays from about its height end on nothing; and
    // what fewer than three scans see through for each that hits it: the price of real trees and hedges that stay.
    EXPECT_GE(tallies[Kind::car].share(), 0.9);
    EXPECT_LE(all_static.share(), 0.01);
    for (const Kind kind : {Kind::road, Kind::wall, Kind::building, Kind::parked, Kind::post, Kind::fence})
      EXPECT_LE(tallies[kind].share(), 0.01) << static_cast<int>(kind);
    // 8 cm high: rays that end on the road behind it graze it in its own layer.
    EXPECT_LE(tallies[Kind::kerb].share(), 0.05);
  });
}

TEST(StaticVoxelsProperty, TheSameScansInAnyOrderGiveTheSame) {
  forAll(1, [](Random& rnd) {
    Course course = randomCourse(rnd, 10 * kDegree);
    course.length_m = 30;
    auto scans = surveyed(course, rnd);
    const StaticVoxels voxels = counted(scans);
    std::vector<Cloud> parts;
    parts.reserve(scans.size());
    for (const SeenScan& s : scans) parts.push_back(voxels.staticPart(s.scan_body, s.T_map_body));
    std::reverse(scans.begin(), scans.end());
    const StaticVoxels backwards = counted(scans);
    std::reverse(scans.begin(), scans.end());
    double removed = 0;
    for (std::size_t i = 0; i < scans.size(); ++i) {
      const Cloud part = backwards.staticPart(scans[i].scan_body, scans[i].T_map_body);
      EXPECT_EQ(part.x, parts[i].x);
      EXPECT_EQ(part.y, parts[i].y);
      EXPECT_EQ(part.z, parts[i].z);
      removed += static_cast<double>(scans[i].scan_body.size() - part.size());
    }
    EXPECT_GT(removed, 0);
  });
}

/** One thing by itself ahead of the LiDAR, hit by some scans and seen through by others, that end at `end_m`. */
bool staysAhead(double ahead_m, double end_m, int hits, int passes, const StaticOptions& options,
                Random& rnd) {
  Pose T_map_body = Pose::Identity();
  T_map_body.translation() = rnd.vectorWithin(1000);
  Cloud thing, beyond;
  thing.push({static_cast<float>(ahead_m), 0, 0});
  beyond.push({static_cast<float>(end_m), 0, 0});
  std::vector<const Cloud*> scans(static_cast<std::size_t>(hits), &thing);
  scans.insert(scans.begin() + rnd.integer(0, hits), static_cast<std::size_t>(passes), &beyond);
  StaticVoxels voxels(options);
  for (const Cloud* scan : scans) voxels.mark(*scan, T_map_body);
  voxels.endMarking();
  for (const Cloud* scan : scans) voxels.count(voxels.look(*scan, T_map_body, Eigen::Vector3d::Zero()));
  voxels.endCounting();
  return !voxels.staticPart(thing, T_map_body).empty();
}

TEST(StaticVoxelsProperty, WhatIsSeenThroughMoreOftenThanHitHasMoved) {
  forAll(500, [](Random& rnd) {
    StaticOptions options;
    options.passes_per_hit = rnd.oneOf({0.5, 1.0, 2.0});
    options.min_passes = rnd.integer(1, 5);
    const int hits = rnd.integer(1, 20), passes = rnd.integer(0, 40);
    const bool moved = passes >= options.min_passes && passes > options.passes_per_hit * hits;
    EXPECT_EQ(staysAhead(20, 90, hits, passes, options, rnd), !moved) << passes << " / " << hits;
  });
}

TEST(StaticVoxelsProperty, CountersThatAreFullStayFull) {
  forAll(5, [](Random& rnd) {
    StaticOptions options;
    options.passes_per_hit = 1;
    const int many = rnd.integer(256, 1000);
    EXPECT_FALSE(staysAhead(20, 90, 254, many, options, rnd));
    EXPECT_TRUE(staysAhead(20, 90, many, 1000, options, rnd));
  });
}

TEST(StaticVoxelsProperty, RaysSeeThroughNothingOutOfTheirReach) {
  forAll(500, [](Random& rnd) {
    StaticOptions options;
    options.near_m = rnd.uniform(0, 10);
    options.range_m = rnd.uniform(20, 60);
    const double end_m = rnd.uniform(10, 100), ahead_m = rnd.uniform(1, 100);
    // A ray that falls by nothing may graze something for all of its end_share.
    const double last_m = std::min(options.range_m, (1 - options.end_share) * end_m);
    const bool stays = staysAhead(ahead_m, end_m, 1, 10, options, rnd);
    const double doubt_m = options.voxel_m;  // where in its voxel it lies
    if (ahead_m < options.near_m - doubt_m || ahead_m > last_m + doubt_m) {
      EXPECT_TRUE(stays) << ahead_m;
    }
    if (ahead_m > options.near_m + doubt_m && ahead_m < last_m - doubt_m) {
      EXPECT_FALSE(stays) << ahead_m;
    }
  });
}

TEST(StaticVoxelsProperty, PlacesThatNoScanHitAreStatic) {
  forAll(50, [](Random& rnd) {
    StaticVoxels voxels({});
    EXPECT_TRUE(voxels.isStatic(rnd.vectorWithin(100)));
    Cloud cloud;
    for (int i = 0; i < 100; ++i) cloud.push(rnd.vectorWithin(50).cast<float>());
    voxels.mark(cloud, Pose::Identity());
    EXPECT_TRUE(voxels.isStatic(rnd.vectorWithin(100)));
    voxels.endMarking();
    voxels.count(voxels.look(cloud, Pose::Identity(), Eigen::Vector3d::Zero()));
    voxels.endCounting();
    EXPECT_TRUE(voxels.isStatic(1000 * rnd.vectorWithin(1).normalized()));
    EXPECT_TRUE(voxels.isStatic(1e9 * rnd.vectorWithin(1).normalized()));
  });
}

TEST(StaticVoxelsProperty, PointsThatWereNotMarkedCountForNothing) {
  forAll(100, [](Random& rnd) {
    Cloud thing, scan, beyond;
    thing.push({20, 0, 0});
    scan.push({20, 0, 0});
    for (int i = 0; i < 9; ++i)  // in voxels beside it
      scan.push({20 + rnd.oneOf({-0.25F, 0.25F}), rnd.oneOf({-0.25F, 0.25F}), 0});
    beyond.push({90, 0, 0});
    const int hits = rnd.integer(1, 9), passes = rnd.integer(0, 20);
    StaticVoxels voxels({});
    voxels.mark(thing, Pose::Identity());
    voxels.endMarking();
    for (int i = 0; i < hits; ++i) voxels.count(voxels.look(scan, Pose::Identity(), Eigen::Vector3d::Zero()));
    for (int i = 0; i < passes; ++i)
      voxels.count(voxels.look(beyond, Pose::Identity(), Eigen::Vector3d::Zero()));
    voxels.endCounting();
    EXPECT_EQ(voxels.isStatic({20, 0, 0}), passes < 3 || passes <= 3 * hits) << passes << " / " << hits;
  });
}

TEST(StaticVoxelsProperty, IntensitiesStayWithTheirPoints) {
  StaticVoxels voxels({});
  Cloud thing, beyond, cloud;
  thing.push({20, 0, 0});
  beyond.push({90, 0, 0});
  for (int i = 0; i < 10; ++i)
    cloud.push({i == 5 ? 20.0F : 30.0F + static_cast<float>(i), 0, 0}, 0.1F * static_cast<float>(i));
  voxels.mark(thing, Pose::Identity());
  voxels.mark(beyond, Pose::Identity());
  voxels.endMarking();
  voxels.count(voxels.look(thing, Pose::Identity(), Eigen::Vector3d::Zero()));
  for (int i = 0; i < 10; ++i) voxels.count(voxels.look(beyond, Pose::Identity(), Eigen::Vector3d::Zero()));
  voxels.endCounting();
  const Cloud part = voxels.staticPart(cloud, Pose::Identity());
  ASSERT_EQ(part.size(), 9U);
  for (std::size_t i = 0; i < part.size(); ++i) EXPECT_FLOAT_EQ(part.intensity[i], 0.1F * (part.x[i] - 30));
}

TEST(StaticVoxelsProperty, RefusesWhatIsNotFiniteAndScansThatComeTooLate) {
  const float nan = std::numeric_limits<float>::quiet_NaN();
  Cloud cloud;
  cloud.push({nan, 0, 0});
  cloud.push({20, 0, 0});
  Pose T_bad = Pose::Identity();
  T_bad.translation().x() = nan;
  StaticVoxels voxels({});
  EXPECT_THROW(voxels.mark(cloud, T_bad), std::invalid_argument);
  voxels.mark(cloud, Pose::Identity());
  EXPECT_THROW(static_cast<void>(voxels.look(cloud, Pose::Identity(), Eigen::Vector3d::Zero())),
               std::logic_error);
  voxels.endMarking();
  EXPECT_THROW(static_cast<void>(voxels.look(cloud, T_bad, Eigen::Vector3d::Zero())), std::invalid_argument);
  EXPECT_THROW(static_cast<void>(voxels.look(cloud, Pose::Identity(), Eigen::Vector3d(nan, 0, 0))),
               std::invalid_argument);
  voxels.count(voxels.look(cloud, Pose::Identity(), Eigen::Vector3d::Zero()));
  voxels.endCounting();
  EXPECT_THROW(voxels.mark(cloud, Pose::Identity()), std::logic_error);
  EXPECT_EQ(voxels.staticPart(cloud, Pose::Identity()).size(), 2U);
}

}  // namespace
}  // namespace raceloc
