#include <algorithm>
#include <cmath>
#include <functional>
#include <map>
#include <vector>

#include "map/road_surface.h"
#include "map/wall_lines.h"
#include "support/forall.h"

namespace raceloc {
namespace {

using test::forAll;
using test::Random;

/** An oval of two straights and two half circles, driven to the left: the racing line is its inner bottom, the road
 * climbs and falls once a lap, is banked more in the turns, and stands between two walls. */
struct Oval {
  double straight_m, radius_m, spacing_m, hill_m, turn_bank_rad;
  Pose T_map_oval = Pose::Identity();
  double left_wall_m = 6, right_wall_m = 9, wall_height_m = 1;

  [[nodiscard]] int waypoints() const { return static_cast<int>(std::lround(length() / spacing_m)); }
  [[nodiscard]] double length() const { return 2 * straight_m + 2 * M_PI * radius_m; }
  [[nodiscard]] double height(double s_m) const { return hill_m * std::sin(2 * M_PI * s_m / length()); }
  [[nodiscard]] double grade(double s_m) const {
    return std::atan(hill_m * 2 * M_PI / length() * std::cos(2 * M_PI * s_m / length()));
  }
  [[nodiscard]] double bank(double s_m) const {  // blends over 60 m, as a road does
    const double half_m = length() / 2, s_half_m = std::fmod(s_m, half_m), blend_m = 60;
    const double into = std::clamp((s_half_m - straight_m + blend_m / 2) / blend_m, 0.0, 1.0);
    const double out = std::clamp((half_m - s_half_m + blend_m / 2) / blend_m, 0.0, 1.0);
    const double start = std::clamp((blend_m / 2 - s_half_m) / blend_m, 0.0, 1.0);
    return turn_bank_rad * std::max(std::min(into, out), start);
  }
  [[nodiscard]] MapWaypoint line(double s_m) const {
    const double half_m = length() / 2, s_half_m = std::fmod(s_m, half_m);
    const double sign = std::fmod(s_m, length()) < half_m ? 1 : -1;
    Eigen::Vector2d p_m(s_half_m - straight_m / 2, -radius_m);
    double heading_rad = 0;
    if (s_half_m > straight_m) {
      heading_rad = (s_half_m - straight_m) / radius_m;
      p_m = {straight_m / 2 + radius_m * std::sin(heading_rad), -radius_m * std::cos(heading_rad)};
    }
    return {T_map_oval * Eigen::Vector3d(sign * p_m.x(), sign * p_m.y(), height(s_m)),
            wrapAngle(heading_rad + (sign < 0 ? M_PI : 0) + yawOf(T_map_oval))};
  }
  /** left_m beside the line, horizontally, and up_m above the road there. */
  [[nodiscard]] Eigen::Vector3d beside(double s_m, double left_m, double up_m) const {
    const MapWaypoint at = line(s_m);
    const Eigen::Vector3d left(-std::sin(at.heading_rad), std::cos(at.heading_rad), -std::tan(bank(s_m)));
    return at.p_map_m + left_m * left + Eigen::Vector3d(0, 0, up_m);
  }
};

Oval randomOval(Random& rnd) {
  Oval oval{rnd.uniform(100, 200), rnd.uniform(60, 120), 0, rnd.uniform(-3, 3), rnd.uniform(5, 24) * kDegree};
  oval.spacing_m = oval.length() / std::round(oval.length() / 10);
  oval.T_map_oval = poseFromRpy({rnd.uniform(-2000, 2000), rnd.uniform(-2000, 2000), rnd.uniform(-50, 50)}, 0,
                                0, rnd.uniform(-3, 3));
  return oval;
}

std::vector<double> steps(double from, double to, double step) {
  std::vector<double> values;
  for (int i = 0; from + i * step <= to; ++i) values.push_back(from + i * step);
  return values;
}

void insert(TiledMap& map, const Cloud& cloud) {
  const std::vector<float> zeros(cloud.size());
  const float* zero = zeros.data();
  map.insert(cloud, {zero, zero, zero, zero, zero, zero, zeros.size()});
}

/** What a survey would have left of it: a point every 0.25 m with 2 cm of noise, some of it where nothing is. */
TiledMap surveyed(const Oval& oval, Random& rnd, const std::function<bool(double, WallSide)>& has_wall) {
  constexpr double kStep_m = 0.25, kNoise_m = 0.02;
  Cloud cloud;
  const auto see = [&](double s_m, double left_m, double up_m) {
    const Eigen::Vector3d noise(rnd.normal(kNoise_m), rnd.normal(kNoise_m), rnd.normal(kNoise_m));
    cloud.push((oval.beside(s_m, left_m, up_m) + noise).cast<float>());
  };
  for (const double s_m : steps(0, oval.length(), kStep_m)) {
    for (const double left_m : steps(-oval.right_wall_m, oval.left_wall_m, kStep_m)) see(s_m, left_m, 0);
    for (const double up_m : steps(0, oval.wall_height_m, kStep_m / 2)) {
      if (has_wall(s_m, WallSide::left)) see(s_m, oval.left_wall_m, up_m);
      if (has_wall(s_m, WallSide::right)) see(s_m, -oval.right_wall_m, up_m);
    }
    if (rnd.uniform(0, 1) < 0.1) see(s_m, rnd.uniform(-5, 5), rnd.uniform(0.2, 3));  // dust, birds
    see(s_m, rnd.uniform(-9, 6), 6);                                                 // a roof
  }
  TiledMap map(32);
  insert(map, cloud);
  return map;
}

std::vector<MapWaypoint> waypointsOf(const Oval& oval) {
  std::vector<MapWaypoint> line;
  for (int i = 0; i < oval.waypoints(); ++i) line.push_back(oval.line(i * oval.spacing_m));
  return line;
}

/** A lap beside the line; the rear axle is 0.3 m above the road, and the car leans by up to 2 deg. */
std::vector<KeyPose> drivenLap(const Oval& oval, Random& rnd) {
  std::vector<KeyPose> lap;
  const double beside_m = rnd.uniform(-3, 3);
  for (const double s_m : steps(0, oval.length(), 3)) {
    const Pose T =
        poseFromRpy(oval.beside(s_m, beside_m, 0.3), -oval.bank(s_m) + rnd.uniform(-2, 2) * kDegree,
                    -oval.grade(s_m), oval.line(s_m).heading_rad);
    lap.push_back({s_m, T, "lap"});
  }
  return lap;
}

/** Where bank and wall are constant around a station: the truth of a plane or a straight piece of wall. */
bool isSteady(const Oval& oval, double s_m) {
  const double before_m = std::fmod(s_m + oval.length() - 3, oval.length());
  return std::abs(oval.bank(s_m + 3) - oval.bank(s_m)) < 1e-9 &&
         std::abs(oval.bank(before_m) - oval.bank(s_m)) < 1e-9;
}

TEST(RoadSurfaceProperty, MeasuresABankedOval) {
  forAll(4, [](Random& rnd) {
    Oval oval = randomOval(rnd);
    if (rnd.oneOf({true, false})) oval.left_wall_m = 3;  // inside of the strip that is fitted
    const TiledMap map = surveyed(oval, rnd, [](double, WallSide) { return true; });
    const auto road = roadSurface(map, waypointsOf(oval), oval.spacing_m, drivenLap(oval, rnd));
    ASSERT_EQ(road.size(), static_cast<std::size_t>(oval.waypoints()));
    for (const RoadStation& r : road) {
      const double height_m = oval.line(r.station_m).p_map_m.z();
      EXPECT_NEAR(r.height_m, height_m, 0.03) << r.station_m;
      EXPECT_NEAR(r.grade_rad, oval.grade(r.station_m), 0.5 * kDegree) << r.station_m;
      if (isSteady(oval, r.station_m)) {
        EXPECT_NEAR(r.bank_rad, oval.bank(r.station_m), 0.5 * kDegree) << r.station_m;
      }
    }
  });
}

TEST(RoadSurfaceProperty, HasNoValueWhereNobodyDroveOrNothingIs) {
  forAll(2, [](Random& rnd) {
    const Oval oval = randomOval(rnd);
    const TiledMap map = surveyed(oval, rnd, [](double, WallSide) { return true; });
    auto lap = drivenLap(oval, rnd);
    EXPECT_TRUE(roadSurface(TiledMap(32), waypointsOf(oval), oval.spacing_m, lap).empty());
    EXPECT_TRUE(roadSurface(map, waypointsOf(oval), oval.spacing_m, {}).empty());
    for (KeyPose& k : lap)
      k.T_map_body.linear() *= poseFromRpy({0, 0, 0}, 0, 0, M_PI).linear();  // the other way
    EXPECT_TRUE(roadSurface(map, waypointsOf(oval), oval.spacing_m, lap).empty());
  });
}

TEST(WallLinesProperty, FindsTheWallsOfABankedOvalAndTheirGaps) {
  forAll(4, [](Random& rnd) {
    const Oval oval = randomOval(rnd);
    const double gap_from_m = rnd.uniform(20, oval.length() - 100), gap_to_m = gap_from_m + 50;
    const auto has_wall = [&](double s_m, WallSide side) {
      return side == WallSide::left || s_m < gap_from_m || s_m > gap_to_m;
    };
    const TiledMap map = surveyed(oval, rnd, has_wall);
    const auto walls = wallLines(map, waypointsOf(oval), oval.spacing_m);
    std::map<WallSide, std::size_t> found;
    for (const WallPoint& w : walls) {
      ++found[w.side];
      const double left_m = w.side == WallSide::left ? oval.left_wall_m : -oval.right_wall_m;
      EXPECT_TRUE(has_wall(w.station_m, w.side) || std::abs(w.station_m - gap_from_m) < 1 ||
                  std::abs(w.station_m - gap_to_m) < 1);
      const Eigen::Vector3d error_m = w.p_map_foot_m - oval.beside(w.station_m, left_m, 0);
      EXPECT_LT(error_m.head<2>().norm(), 0.05) << w.station_m;
      EXPECT_NEAR(w.height_m, oval.wall_height_m, 0.2) << w.station_m;
    }
    const auto stations = static_cast<std::size_t>(oval.waypoints());
    EXPECT_EQ(found[WallSide::left], stations);
    EXPECT_LE(found[WallSide::right], stations - 4);  // 50 m of 10 m each, but for the ends
    EXPECT_GE(found[WallSide::right], stations - 6);
  });
}

TEST(WallLinesProperty, ABankIsNoWall) {
  forAll(3, [](Random& rnd) {
    Oval oval = randomOval(rnd);
    oval.turn_bank_rad = 35 * kDegree;
    const TiledMap map = surveyed(oval, rnd, [](double, WallSide) { return false; });
    EXPECT_TRUE(wallLines(map, waypointsOf(oval), oval.spacing_m).empty());
  });
}

}  // namespace
}  // namespace raceloc
