/** \file
 * Laws of racetrack IDs: noise, opposite and neighbouring roads, rigid moves, laps found in a drive. */
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "support/centre_line.h"
#include "support/forall.h"
#include "track/circuit.h"
#include "track/driven_line.h"
#include "track/racetrack_dict.h"
#include "track/track_id.h"

namespace raceloc {
namespace {

using test::forAll;
using test::Random;

using Line = std::vector<Eigen::Vector3d>;

double lengthOf(const Line& line) {
  double length_m = 0;
  for (std::size_t k = 0; k < line.size(); ++k) length_m += (line[(k + 1) % line.size()] - line[k]).norm();
  return length_m;
}

/** Shorter way round the loop between two IDs. */
int apart(int a, int b, int n) { return std::min((a - b + n) % n, (b - a + n) % n); }

/** Straights and arcs, walked step by step. */
class Road {
 public:
  explicit Road(const Pose& start = Pose::Identity()) : x_T(start) {}
  Road& go(double length_m, double turn_deg = 0, double climb_m = 0) {
    const int steps = std::max(1, static_cast<int>(std::ceil(length_m)));
    const double step_m = length_m / steps, turn_rad = turn_deg * kDegree / steps;
    for (int i = 0; i < steps; ++i) {
      x_T = x_T * Eigen::AngleAxisd(turn_rad / 2, Eigen::Vector3d::UnitZ()) *
            Eigen::Translation3d(step_m, 0, climb_m / steps) *
            Eigen::AngleAxisd(turn_rad / 2, Eigen::Vector3d::UnitZ());
      poses.push_back(x_T);
    }
    return *this;
  }
  /** A turn with a radius, left positive. */
  Road& turn(double angle_deg, double radius_m) {
    return go(std::abs(angle_deg) * kDegree * radius_m, angle_deg);
  }
  Road& stand(int times, Random& rnd, double sigma_m) {
    for (int i = 0; i < times; ++i) {
      Pose T = x_T * Eigen::Translation3d(rnd.normal(sigma_m), rnd.normal(sigma_m), rnd.normal(sigma_m));
      poses.push_back(T * Eigen::AngleAxisd(rnd.uniform(-M_PI, M_PI), Eigen::Vector3d::UnitZ()));
    }
    return *this;
  }
  [[nodiscard]] Line line() const {
    Line line;
    for (const auto& T : poses) line.push_back(T.translation());
    return line;
  }
  [[nodiscard]] const Pose& end() const { return x_T; }
  std::vector<Pose> poses;

 private:
  Pose x_T;
};

/** A stadium: two opposite straights of 400 m, `gap_m` apart, the first one along x from 0. */
Road& stadium(Road& road, double gap_m) {
  return road.go(400).turn(180, gap_m / 2).go(400).turn(180, gap_m / 2);
}

TEST(TrackIdsProperty, NoiseBelowHalfASpacingMovesAnIdByAtMostOne) {
  const Track track = readCircuit(RACELOC_ROOT "/share/tracks/monza_like.ini").track;
  const Line line = test::centreLine(track, 1);
  forAll(20, [&](Random& rnd) {
    const double spacing_m = rnd.uniform(2, 10);
    const auto way_points = wayPointsAlong(line, spacing_m);
    const TrackIds ids(way_points, {spacing_m, 12, 60});
    double least_m = spacing_m;  // chords are a little shorter than the steps along the line
    for (int k = 0; k < ids.count(); ++k)
      least_m = std::min(least_m, (way_points[static_cast<std::size_t>((k + 1) % ids.count())].p_map_m -
                                   way_points[static_cast<std::size_t>(k)].p_map_m)
                                      .norm());
    for (int i = 0; i < 500; ++i) {
      const Pose T = track.at(rnd.uniform(0, track.length_m())).T_map_road;
      const Eigen::Vector3d noise_m = rnd.vectorWithin(1).normalized() * rnd.uniform(0, 0.5 * least_m);
      const Pose noisy = Eigen::Translation3d(noise_m) * T *
                         Eigen::AngleAxisd(rnd.uniform(-0.3, 0.3), Eigen::Vector3d::UnitZ());
      const auto id = ids.idAt(T), noisy_id = ids.idAt(noisy);
      ASSERT_TRUE(id && noisy_id);
      EXPECT_LE(apart(*id, *noisy_id, ids.count()), 1);
      const auto& way_point = way_points[static_cast<std::size_t>(*id)];
      if ((way_point.p_map_m - T.translation()).norm() + noise_m.norm() < 0.5 * least_m) {
        EXPECT_EQ(*id, *noisy_id);
      }
    }
  });
}

TEST(TrackIdsProperty, BothDirectionsOfAParallelStraightNeverShareAnId) {
  forAll(50, [](Random& rnd) {
    Road road;
    stadium(road, rnd.uniform(8, 20));  // nearer than any real track has them
    const TrackIds ids(wayPointsAlong(road.line(), rnd.uniform(2, 10)), {});
    for (int i = 0; i < 100; ++i) {
      const Eigen::Vector3d p(rnd.uniform(-30, 430), rnd.uniform(-10, 30), rnd.uniform(-5, 5));
      const double yaw_rad = rnd.uniform(-M_PI, M_PI);
      const auto there = ids.idAt(poseFromRpy(p, 0, 0, yaw_rad));
      const auto back = ids.idAt(poseFromRpy(p, 0, 0, yaw_rad + M_PI));
      if (there && back) {
        EXPECT_NE(*there, *back);
      }
    }
  });
}

TEST(TrackIdsProperty, TheLegsOfAHairpinAndRoadsAboveEachOtherAreToldApart) {
  forAll(50, [](Random& rnd) {
    Road road;  // hairpins of 8 m radius
    road.go(300).turn(180, 8).go(300).turn(180, 8);
    const int n = 1000;
    Line line = road.line();
    const TrackIds ids(wayPointsAlong(line, lengthOf(line) / n), {});
    ASSERT_EQ(ids.count(), n);
    const auto k = static_cast<std::size_t>(rnd.integer(0, static_cast<int>(road.poses.size()) - 1));
    const Pose T = road.poses[k] * Eigen::Translation3d(0, rnd.uniform(-4, 4), 0) *
                   Eigen::AngleAxisd(rnd.uniform(-0.5, 0.5), Eigen::Vector3d::UnitZ());
    const auto id = ids.idAt(T);
    ASSERT_TRUE(id);
    // 4 m inside of a bend of 8 m radius halve the way along it, and 0.5 rad cut a corner's share off.
    const int truth =
        static_cast<int>(std::lround(static_cast<double>(k + 1) / static_cast<double>(line.size()) * n)) % n;
    EXPECT_LE(apart(*id, truth, n), 10);

    Line spiral;  // two rounds of one circle, the second 6 m above the first
    for (int i = 0; i < 360; ++i) {
      const double angle_rad = 4 * M_PI * i / 360, rise_m = i < 180 ? 0 : 6;
      spiral.emplace_back(100 * std::cos(angle_rad), 100 * std::sin(angle_rad), rise_m);
    }
    const TrackIds levels(wayPointsAlong(spiral, 5), {});
    const double angle_rad = rnd.uniform(0.3, 2 * M_PI - 0.3);
    for (const int level : {0, 1}) {
      const Eigen::Vector3d p(100 * std::cos(angle_rad), 100 * std::sin(angle_rad),
                              6 * level + rnd.uniform(-2, 2));
      const auto found = levels.idAt(poseFromRpy(p, 0, 0, angle_rad + M_PI / 2));
      ASSERT_TRUE(found);
      EXPECT_EQ(*found * 2 / levels.count(), level);
    }
  });
}

TEST(TrackIdsProperty, APitLaneBeyondTheReachHasNoIds) {
  forAll(50, [](Random& rnd) {
    Road road;
    stadium(road, 200);
    const TrackIdOptions options;
    const TrackIds ids(wayPointsAlong(road.line(), options.spacing_m), options);
    const double aside_m = (options.reach_m + rnd.uniform(0.01, 10)) * rnd.oneOf({-1.0, 1.0});
    EXPECT_FALSE(ids.idAt(poseFromRpy({rnd.uniform(20, 380), aside_m, 0}, 0, 0, 0)));
  });
}

TEST(TrackIdsProperty, ARigidMoveOfEverythingLeavesIdsAlone) {
  const Track track = readCircuit(RACELOC_ROOT "/share/tracks/lvms.ini").track;
  const Line line = test::centreLine(track, 2);
  forAll(20, [&](Random& rnd) {
    const Pose T_moved_map = poseFromRpy(rnd.vectorWithin(5000), 0, 0, rnd.uniform(-M_PI, M_PI));
    Line moved;
    for (const auto& p : line) moved.emplace_back(T_moved_map * p);
    const TrackIds ids(wayPointsAlong(line, 5), {}), moved_ids(wayPointsAlong(moved, 5), {});
    for (int i = 0; i < 200; ++i) {
      const Pose T = track.surface(rnd.uniform(0, track.length_m()), rnd.uniform(-9, 9)).T_map_surface *
                     rnd.pose(0.2, 1);
      EXPECT_EQ(ids.idAt(T), moved_ids.idAt(T_moved_map * T));
    }
  });
}

TEST(TrackIdsProperty, StoredWayPointsGiveTheSameIds) {
  forAll(20, [](Random& rnd) {
    Road road;
    stadium(road, 60);
    const TrackIds ids(wayPointsAlong(road.line(), 5), {});
    const TrackIds stored(std::vector<WayPoint>(ids.wayPoints()), {});
    const Pose T = poseFromRpy({rnd.uniform(-50, 450), rnd.uniform(-20, 80), 0}, 0, 0, rnd.uniform(-3, 3));
    EXPECT_EQ(ids.idAt(T), stored.idAt(T));
  });
}

// ---- The first full lap

/** Every lap line of the stadium with 100 m between its straights is about this long. */
const double kStadium_m = 800 + 100 * M_PI;

/** Worst distance of the points of a line from the stadium's own, and the largest step. */
void expectStadium(const std::optional<Line>& line, double within_m) {
  ASSERT_TRUE(line);
  Road truth;
  stadium(truth, 100);
  const Line on = truth.line();
  EXPECT_NEAR(lengthOf(*line), kStadium_m, 0.02 * kStadium_m);  // chords of 5 m, noise of each
  for (std::size_t k = 0; k < line->size(); ++k) {
    double nearest_m = 1e9;
    for (const auto& p : on) nearest_m = std::min(nearest_m, (p - (*line)[k]).norm());
    EXPECT_LE(nearest_m, within_m);
    EXPECT_LE(((*line)[(k + 1) % line->size()] - (*line)[k]).norm(), 10);
  }
}

TEST(FirstFullLapProperty, IsTheSameWhereverTheDriveBegins) {
  forAll(20, [](Random& rnd) {
    Road drive;
    const int laps = 2;
    for (int lap = 0; lap <= laps; ++lap) stadium(drive, 100);
    const auto begin = rnd.integer(0, static_cast<int>(drive.poses.size()) / 3);
    std::vector<Pose> poses(drive.poses.begin() + begin, drive.poses.end());
    for (auto& T : poses) T.translation() += 0.2 * rnd.vectorWithin(1);
    // Three times 0.35 m of noise (the point's, both of the gap's), beside points 1 m apart.
    expectStadium(firstFullLap(poses), 1.2);
  });
}

TEST(FirstFullLapProperty, LeavesOutThePitTheStandstillAndTheOutLap) {
  forAll(20, [](Random& rnd) {
    Road drive(poseFromRpy({100, -20, 0}, 0, 0, 0));
    drive.stand(200, rnd, 0.3).go(150);  // pit lane, 20 m beside the straight
    drive.turn(30, 40).turn(-30, 40);    // joins it
    Road lap(poseFromRpy({drive.end().translation().x(), 0, 0}, 0, 0, 0));
    lap.go(400 - drive.end().translation().x()).turn(180, 50).go(400).turn(180, 50);
    for (int k = 0; k < 2; ++k) stadium(lap, 100);
    drive.poses.insert(drive.poses.end(), lap.poses.begin(), lap.poses.end());
    expectStadium(firstFullLap(drive.poses), 6);  // the gap left on joining is at most close_m
  });
}

TEST(FirstFullLapProperty, ACrossingAHairpinAndTurningCirclesCloseNothing) {
  forAll(20, [](Random& rnd) {
    const double beside_m = rnd.uniform(1, 5);
    Road circles;  // a driver who warms the tyres
    circles.turn(360 * 4, rnd.uniform(6, 30)).go(1000);
    EXPECT_FALSE(firstFullLap(circles.poses));

    Road crossing;  // comes back to itself from the side
    crossing.go(200).turn(270, 60).go(400);
    EXPECT_FALSE(firstFullLap(crossing.poses));

    Road
        touching;  // a hairpin of 15 m radius touches the straight, on the straight's course where it is nearest
    touching.go(300).turn(90, 50).go(50).turn(90, 50).go(250);
    const double apex_y_m = touching.end().translation().y();
    touching.turn(90, 30).go(apex_y_m - 30 - 15 - beside_m).turn(180, 15).go(300);
    EXPECT_FALSE(firstFullLap(touching.poses));

    Road there_and_back;
    there_and_back.go(500).turn(180, 3).go(500);
    EXPECT_FALSE(firstFullLap(there_and_back.poses));
  });
  EXPECT_FALSE(firstFullLap({}));
  EXPECT_FALSE(firstFullLap({Pose::Identity()}));
}

TEST(FirstFullLapProperty, AFigureOfEightIsOneLap) {
  forAll(10, [](Random& rnd) {
    const double radius_m = rnd.uniform(50, 100), climb_m = rnd.uniform(0, 6);
    Road eight;
    for (int lap = 0; lap < 2; ++lap)  // crossing at right angles, at two heights
      eight.go(radius_m)
          .turn(270, radius_m)
          .go(2 * radius_m, 0, climb_m)
          .turn(-270, radius_m)
          .go(radius_m, 0, -climb_m);
    const auto line = firstFullLap(eight.poses);
    ASSERT_TRUE(line);
    EXPECT_NEAR(lengthOf(*line), radius_m * (4 + 3 * M_PI), 0.02 * radius_m * (4 + 3 * M_PI));
    const TrackIds ids(wayPointsAlong(*line, 5), {});
    RacetrackDict dict(ids.count());
    for (std::uint32_t k = 0; k < eight.poses.size(); ++k) {
      const auto id = ids.idAt(eight.poses[k]);
      ASSERT_TRUE(id);
      dict.add({k, k}, *id, 0);
    }
    EXPECT_NEAR(static_cast<double>(dict.station(dict.entries().size() - 1) - dict.station(0)),
                2 * ids.count(), 2);
  });
}

TEST(FirstFullLapProperty, OneLapThatEndsWhereItBeganIsEnough) {
  Road drive;
  stadium(drive, 100);
  expectStadium(firstFullLap(drive.poses), 0.5);
}

TEST(RacetrackDictProperty, StationsGoOnRoundTheLoopAndStoredEntriesGiveTheSameDict) {
  forAll(50, [](Random& rnd) {
    const int n = rnd.integer(1, 300);
    RacetrackDict dict(n);
    std::int64_t station = rnd.integer(0, n - 1);
    const std::int64_t first = station;
    int session = 0;
    for (std::uint32_t key = 0; key < 500; ++key) {
      dict.add({key, key}, static_cast<int>((station % n + n) % n), session);
      EXPECT_EQ(dict.station(key) - dict.station(0), station - first);
      station += rnd.integer(-(n - 1) / 2, (n - 1) / 2);
    }
    dict.add({9999, 9999}, 0, ++session);
    const RacetrackDict stored(n, dict.entries());
    for (std::size_t k = 0; k < dict.entries().size(); ++k) {
      EXPECT_EQ(stored.station(k), dict.station(k));
      EXPECT_EQ(stored.id(dict.entries()[k].keys), dict.entries()[k].id);
    }
    for (int id = 0; id < n; ++id) EXPECT_EQ(stored.passages(id), dict.passages(id));
  });
}

}  // namespace
}  // namespace raceloc
