/** \file
 * Road and walls beside a pose, from a map's stations: those of the geometry that the map was made of. */
#include <gmock/gmock.h>

#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include "pipeline/track_surface.h"
#include "support/forall.h"
#include "support/surveyed_track.h"
#include "track/circuit.h"

namespace raceloc {
namespace {

using test::forAll;
using test::Random;

constexpr double kSpacing_m = 5;

Track circuit(const std::string& name) {
  return readCircuit(RACELOC_ROOT "/share/tracks/" + name + ".ini").track;
}

double angleBetween(const Eigen::Vector3d& a, const Eigen::Vector3d& b) {
  return std::atan2(a.cross(b).norm(), a.dot(b));
}

/** Height, plane and gaps of random places on the road; the worst of each. */
struct Worst {
  double height_m = 0, up_rad = 0, gap_m = 0, lateral_m = 0, station_m = 0;
};
Worst worstOn(const Track& track, unsigned seed) {
  const TrackSurface surface(test::surveyedTrack(track, kSpacing_m), {});
  Random rnd(seed);
  Worst worst;
  constexpr int kPlaces = 2000;
  for (int k = 0; k < kPlaces; ++k) {
    const double s_m = rnd.uniform(0, track.length_m());
    const RoadFrame centre = track.at(s_m);
    const double n_m = rnd.uniform(-std::min(9.0, centre.right_m), std::min(9.0, centre.left_m));
    const Pose T = track.surface(s_m, n_m).T_map_surface;
    const Eigen::Vector3d p_map_m = T.translation();
    const auto place = surface.at(p_map_m.head<2>(), yawOf(T), p_map_m.z());
    EXPECT_TRUE(place && place->road && place->gap_left_m && place->gap_right_m) << s_m;
    if (!place || !place->road || !place->gap_left_m || !place->gap_right_m) break;
    const auto keep = [](double& most, double value) { most = std::max(most, std::abs(value)); };
    keep(worst.height_m, place->road->height_m - p_map_m.z());
    keep(worst.up_rad, angleBetween(place->road->up_map, T.linear().col(2)));
    const auto away_m = [&](double wall_n_m) {
      return (track.surface(s_m, wall_n_m).T_map_surface.translation() - p_map_m).head<2>().norm();
    };
    keep(worst.gap_m, *place->gap_left_m - away_m(centre.left_m));
    keep(worst.gap_m, *place->gap_right_m - away_m(-centre.right_m));
    keep(worst.lateral_m, std::abs(place->lateral_m) - away_m(0));
    const double length_m = surface.length_m();
    keep(worst.station_m, std::remainder(place->station_m - s_m, length_m));
  }
  return worst;
}

TEST(TrackSurfaceProperty, IsTheRoadThatWasSurveyed) {
  // Curvature and bank that change within one spacing of 5 m: most in chicanes.
  const auto expect = [](const std::string& name, const Worst& most) {
    SCOPED_TRACE(name);
    const Worst worst = worstOn(circuit(name), 1);
    EXPECT_LT(worst.height_m, most.height_m);
    EXPECT_LT(worst.up_rad, most.up_rad);
    EXPECT_LT(worst.gap_m, most.gap_m);
    EXPECT_LT(worst.lateral_m, most.lateral_m);
    EXPECT_LT(worst.station_m, most.station_m);
  };
  expect("lvms", {0.001, 0.02 * kDegree, 0.01, 0.001, 0.01});  // 20 deg of bank
  expect("tms", {0.001, 0.02 * kDegree, 0.02, 0.001, 0.01});   // 24 deg
  expect("monza_like", {0.01, 0.3 * kDegree, 0.03, 0.02, 0.2});
  expect("everland_like", {0.01, 0.3 * kDegree, 0.03, 0.01, 0.1});  // 43 m of height
}

TEST(TrackSurfaceProperty, AMoveOfEverythingInThePlaneMovesOnlyWhatPoints) {
  const Track track = circuit("lvms");
  const MapContent content = test::surveyedTrack(track, kSpacing_m);
  const TrackSurface surface(content, {});
  forAll(50, [&](Random& rnd) {
    const Pose T_new_old =
        poseFromRpy({rnd.uniform(-2000, 2000), rnd.uniform(-2000, 2000), 0}, 0, 0, rnd.uniform(-3, 3));
    const double turn_rad = yawOf(T_new_old);
    MapContent moved = content;
    for (MapWaypoint& w : moved.waypoints) w = {T_new_old * w.p_map_m, wrapAngle(w.heading_rad + turn_rad)};
    for (WallPoint& w : moved.walls) w.p_map_foot_m = T_new_old * w.p_map_foot_m;
    const TrackSurface moved_surface(moved, {});
    for (int k = 0; k < 20; ++k) {
      const Pose T = track.surface(rnd.uniform(0, track.length_m()), rnd.uniform(-6, 6)).T_map_surface;
      const auto here = surface.at(T.translation().head<2>(), yawOf(T));
      const auto there = moved_surface.at((T_new_old * T.translation()).head<2>(), yawOf(T) + turn_rad);
      ASSERT_TRUE(here && there);
      constexpr double kRounding = 1e-8;  // of doubles some km from 0
      EXPECT_NEAR(there->station_m, here->station_m, kRounding);
      EXPECT_NEAR(there->lateral_m, here->lateral_m, kRounding);
      EXPECT_NEAR(wrapAngle(there->line_heading_rad - here->line_heading_rad - turn_rad), 0, kRounding);
      EXPECT_NEAR(there->road->height_m, here->road->height_m, kRounding);
      EXPECT_NEAR(there->road->grade_rad, here->road->grade_rad, kRounding);
      EXPECT_NEAR(there->road->bank_rad, here->road->bank_rad, kRounding);
      EXPECT_NEAR((there->road->up_map - T_new_old.linear() * here->road->up_map).norm(), 0, kRounding);
      EXPECT_NEAR(*there->gap_left_m, *here->gap_left_m, kRounding);
      EXPECT_NEAR(*there->gap_right_m, *here->gap_right_m, kRounding);
    }
  });
}

TEST(TrackSurfaceProperty, NothingJumpsAlongTheLap) {
  for (const std::string name : {"lvms", "monza_like"}) {
    SCOPED_TRACE(name);
    const Track track = circuit(name);
    const TrackSurface surface(test::surveyedTrack(track, kSpacing_m), {});
    forAll(5, [&](Random& rnd) {
      const double amplitude_m = rnd.uniform(0, 3), waves = rnd.integer(1, 8), step_m = 0.05;
      std::optional<TrackPlace> last;
      double climbed_m = 0;
      const int steps = static_cast<int>((track.length_m() + 40) / step_m);
      for (int k = 0; k < steps; ++k) {  // from before the start to behind it
        const double s_m = k * step_m - 20;
        const double n_m = amplitude_m * std::sin(2 * M_PI * waves * s_m / track.length_m());
        const Pose T = track.surface(track.wrapped(s_m), n_m).T_map_surface;
        const auto place = surface.at(T.translation().head<2>(), yawOf(T), T.translation().z());
        ASSERT_TRUE(place && place->road && place->gap_left_m && place->gap_right_m) << s_m;
        if (last) {
          const double forward_m = std::remainder(place->station_m - last->station_m, surface.length_m());
          climbed_m += forward_m;
          EXPECT_NEAR(forward_m, step_m, 0.2 * step_m) << s_m;
          // The steepest there is: a slope of 0.5, walls that open by 1:2, bends of 10 m radius.
          EXPECT_NEAR(place->lateral_m, last->lateral_m, 0.5 * step_m) << s_m;
          EXPECT_NEAR(place->road->height_m, last->road->height_m, 0.5 * step_m) << s_m;
          EXPECT_NEAR(*place->gap_left_m, *last->gap_left_m, 0.5 * step_m) << s_m;
          EXPECT_NEAR(*place->gap_right_m, *last->gap_right_m, 0.5 * step_m) << s_m;
          EXPECT_LT(angleBetween(place->road->up_map, last->road->up_map), 0.1 * step_m) << s_m;
          EXPECT_NEAR(wrapAngle(place->line_heading_rad - last->line_heading_rad), 0, 0.1 * step_m) << s_m;
        }
        last = place;
      }
      EXPECT_NEAR(climbed_m, track.length_m() + 40, 1);
    });
  }
}

TEST(TrackSurfaceProperty, ACarStandsOnTheRoadAndHeadsWhereItHeads) {
  forAll(200, [](Random& rnd) {
    const Eigen::Vector3d up =
        Eigen::Vector3d(rnd.uniform(-0.5, 0.5), rnd.uniform(-0.5, 0.5), 1).normalized();
    const double heading_rad = rnd.uniform(-3.1, 3.1);
    Pose T = Pose::Identity();
    T.linear() = standingOn(up, heading_rad);
    EXPECT_NEAR((T.linear() * T.linear().transpose() - Eigen::Matrix3d::Identity()).norm(), 0, 1e-12);
    EXPECT_NEAR(T.linear().determinant(), 1, 1e-12);
    EXPECT_NEAR((T.linear().col(2) - up).norm(), 0, 1e-12);
    EXPECT_NEAR(yawOf(T), heading_rad, 1e-12);
  });
}

/** A flat square track of 400 m with a road at 5 m of height, and one wall. */
MapContent square() {
  const auto way_points = wayPointsAlong({{0, 0, 5}, {100, 0, 5}, {100, 100, 5}, {0, 100, 5}}, kSpacing_m);
  MapContent content{{{}, 32, 0.25, "", "", {}, kSpacing_m}, {}};
  for (const WayPoint& w : way_points) {
    const double station_m = kSpacing_m * static_cast<double>(content.waypoints.size());
    content.waypoints.push_back({w.p_map_m, w.heading_rad});
    content.road.push_back({station_m, 5, 0, 0.1});
    const Eigen::Vector3d left(-std::sin(w.heading_rad), std::cos(w.heading_rad), 0);
    content.walls.push_back({station_m, WallSide::left, w.p_map_m + 4 * left, 1});
  }
  return content;
}

TEST(TrackSurface, WhatIsMissingAtAStationIsMissingThereAlone) {
  MapContent content = square();
  content.road.erase(content.road.begin() + 10);  // station 50 m
  content.walls.erase(content.walls.begin() + 14);
  const TrackSurface surface(content, {});
  const auto at = [&](double x_m) { return *surface.at({x_m, 1}, 0); };
  EXPECT_TRUE(at(44).road);
  EXPECT_FALSE(at(46).road);
  EXPECT_FALSE(at(54).road);
  EXPECT_TRUE(at(56).road);
  EXPECT_NEAR(at(44).road->height_m, 5 - std::tan(0.1), 1e-9);
  EXPECT_NEAR(*at(54).gap_left_m, 3, 1e-9);
  EXPECT_FALSE(at(66).gap_left_m);
  EXPECT_FALSE(at(74).gap_left_m);
  EXPECT_NEAR(*at(76).gap_left_m, 3, 1e-9);
  EXPECT_NEAR(surface.at({50, 4.5}, 0)->gap_left_m.value(), -0.5, 1e-9);  // through the wall
  EXPECT_FALSE(at(50).gap_right_m);                                       // nowhere one
}

TEST(TrackSurface, OffTheLineThereIsNoPlace) {
  const TrackSurface surface(square(), {});
  EXPECT_TRUE(surface.at({50, -11}, 0));
  EXPECT_FALSE(surface.at({50, -13}, 0));
  EXPECT_FALSE(surface.at({50, 0}, M_PI));
  EXPECT_FALSE(surface.at({std::nan(""), 0}, 0));
  EXPECT_FALSE(surface.at({50, 0}, std::nan("")));
  EXPECT_FALSE(surface.at({1e300, 0}, 0));
  EXPECT_FALSE(TrackSurface({{{}, 32, 0.25, "", "", {}}, {}}, {}).at({0, 0}, 0));
}

TEST(TrackSurface, ABridgeIsToldByItsHeight) {
  MapContent content = square();  // the same once more, 8 m above: two laps of a spiral
  const std::size_t below = content.waypoints.size();
  for (std::size_t i = 0; i < below; ++i) {
    MapWaypoint w = content.waypoints[i];
    w.p_map_m.z() += 8;
    content.waypoints.push_back(w);
    content.road.push_back({kSpacing_m * static_cast<double>(below + i), 13, 0, 0});
  }
  const TrackSurface surface(content, {});
  EXPECT_NEAR(surface.at({50, 0}, 0, 5.3)->road->height_m, 5, 1e-9);
  EXPECT_NEAR(surface.at({50, 0}, 0, 13.3)->road->height_m, 13, 1e-9);
}

TEST(TrackSurface, RefusesStationsThatAreNoWayPoints) {
  MapContent content = square();
  content.road[3].station_m += 1;
  EXPECT_THROW(TrackSurface(content, {}), std::invalid_argument);
  EXPECT_THROW(TrackSurface(square(), {0, 60}), std::invalid_argument);
}

}  // namespace
}  // namespace raceloc
