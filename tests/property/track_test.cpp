/** \file
 * Laws of libs/track, many of them on every shipped circuit. */
#include "track/track.h"

#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <string>
#include <system_error>
#include <vector>

#include "core/errors.h"
#include "support/forall.h"
#include "track/circuit.h"
#include "track/periodic_spline.h"

namespace raceloc {
namespace {

namespace fs = std::filesystem;
using test::forAll;
using test::Random;

const fs::path kTracks = fs::path(RACELOC_ROOT) / "share/tracks";

using Knot = Eigen::Vector3d;

std::vector<Knot> randomKnots(Random& rnd) {
  std::vector<Knot> knots(static_cast<std::size_t>(rnd.integer(4, 40)));
  for (auto& knot : knots) knot = rnd.vectorWithin(10);
  return knots;
}

TEST(PeriodicSpline, PassesThroughItsKnots) {
  forAll(100, [](Random& rnd) {
    const auto knots = randomKnots(rnd);
    const double step = rnd.uniform(0.1, 5);
    const PeriodicSpline<3> spline(knots, step);
    for (std::size_t i = 0; i < knots.size(); ++i) {
      const double laps = rnd.integer(-2, 2);
      EXPECT_LT((spline(step * static_cast<double>(i) + laps * spline.period()).value - knots[i]).norm(),
                1e-9);
    }
  });
}

TEST(PeriodicSpline, IsTwiceContinuousAtEveryKnotAndAtTheSeam) {
  forAll(100, [](Random& rnd) {
    const auto knots = randomKnots(rnd);
    const double step = rnd.uniform(0.5, 5);
    const PeriodicSpline<3> spline(knots, step);
    constexpr double kLittle = 1e-8;
    for (std::size_t i = 0; i < knots.size(); ++i) {
      const double at = step * static_cast<double>(i);
      const auto before = spline(at - kLittle), after = spline(at + kLittle);
      EXPECT_LT((before.value - after.value).norm(), 1e-5);
      EXPECT_LT((before.first - after.first).norm(), 1e-4);
      EXPECT_LT((before.second - after.second).norm(), 1e-3);
    }
  });
}

TEST(PeriodicSpline, DerivativesAreThoseOfTheValue) {
  forAll(100, [](Random& rnd) {
    const PeriodicSpline<3> spline(randomKnots(rnd), 1);
    const double at = rnd.uniform(0, 2 * spline.period()), h = 1e-5;
    const auto a = spline(at - h), b = spline(at + h), here = spline(at);
    EXPECT_LT(((b.value - a.value) / (2 * h) - here.first).norm(), 1e-4);
    EXPECT_LT(((b.first - a.first) / (2 * h) - here.second).norm(), 1e-2);
  });
}

// ---- Shipped circuits

class EveryCircuit : public ::testing::TestWithParam<std::string> {
 protected:
  const Circuit circuit = readCircuit((kTracks / (GetParam() + ".ini")).string());
  const Track& track = circuit.track;

  [[nodiscard]] double station(Random& rnd) const { return rnd.uniform(-1, 2) * track.length_m(); }
};

std::vector<std::string> shipped() {
  std::vector<std::string> names;
  std::error_code none;  // no folder: no tests, said by GoogleTest
  for (const auto& entry : fs::directory_iterator(kTracks, none))
    if (entry.path().extension() == ".ini") names.push_back(entry.path().stem().string());
  std::sort(names.begin(), names.end());
  return names;
}

TEST_P(EveryCircuit, FrameIsARotation) {
  forAll(300, [&](Random& rnd) {
    const Eigen::Matrix3d R = track.at(station(rnd)).T_map_road.linear();
    EXPECT_LT((R.transpose() * R - Eigen::Matrix3d::Identity()).norm(), 1e-12);
    EXPECT_GT(R.determinant(), 0);
    EXPECT_GT(R(2, 2), 0.7) << "the surface faces the sky";
  });
}

TEST_P(EveryCircuit, TurnIsTheFramesOwn) {
  forAll(300, [&](Random& rnd) {
    const double s_m = station(rnd), h = 1e-4;
    const Eigen::Matrix3d before = track.at(s_m - h).T_map_road.linear(),
                          after = track.at(s_m + h).T_map_road.linear();
    const Eigen::Matrix3d turn = track.at(s_m).T_map_road.linear().transpose() * (after - before) / (2 * h);
    const Eigen::Vector3d measured(turn(2, 1), turn(0, 2), turn(1, 0));
    EXPECT_LT((measured - track.at(s_m).turn_per_m).norm(), 2e-6);
  });
}

TEST_P(EveryCircuit, StationsAreMetresOfTheCentreLine) {
  double walked_m = 0, worst = 0;
  const double step_m = track.length_m() / 1e5;
  Eigen::Vector3d last = track.at(0).T_map_road.translation();
  for (int i = 1; i <= 100'000; ++i) {
    const Eigen::Vector3d here = track.at(i * step_m).T_map_road.translation();
    walked_m += (here - last).norm();
    worst = std::max(worst, std::abs(walked_m - i * step_m));
    last = here;
  }
  EXPECT_LT(worst, 0.005);
}

TEST_P(EveryCircuit, SurfaceAxisIsTangentAndStretchIsItsPace) {
  forAll(300, [&](Random& rnd) {
    const double s_m = station(rnd), n_m = rnd.uniform(-12, 12), h = 1e-4;
    const Eigen::Vector3d along = (track.surface(s_m + h, n_m).T_map_surface.translation() -
                                   track.surface(s_m - h, n_m).T_map_surface.translation()) /
                                  (2 * h);
    const SurfacePoint point = track.surface(s_m, n_m);
    const Eigen::Matrix3d R = point.T_map_surface.linear();
    EXPECT_LT((along - point.stretch * R.col(0)).norm(), 2e-5);
    EXPECT_LT((R.transpose() * R - Eigen::Matrix3d::Identity()).norm(), 1e-12);
    const Eigen::Vector3d across = (track.surface(s_m, n_m + h).T_map_surface.translation() -
                                    track.surface(s_m, n_m - h).T_map_surface.translation()) /
                                   (2 * h);
    EXPECT_LT((across - R.col(1)).norm(), 1e-7);
  });
}

TEST_P(EveryCircuit, LocateInvertsTheSurface) {
  forAll(1000, [&](Random& rnd) {
    const double s_m = rnd.uniform(0, track.length_m());
    const RoadFrame road = track.at(s_m);
    const double n_m = rnd.uniform(-road.right_m - 3, road.left_m + 3), height_m = rnd.uniform(-2, 5);
    const auto place = track.locate(road.T_map_road * Eigen::Vector3d(0, n_m, height_m));
    ASSERT_TRUE(place);
    EXPECT_LT(std::abs(std::remainder(place->s_m - s_m, track.length_m())), 1e-5);
    EXPECT_NEAR(place->n_m, n_m, 1e-6);
    EXPECT_NEAR(place->height_m, height_m, 1e-6);
    EXPECT_GE(place->s_m, 0);
    EXPECT_LT(place->s_m, track.length_m());
  });
}

TEST_P(EveryCircuit, IsClosedInPositionHeadingBankAndGrade) {
  const RoadFrame begin = track.at(0), end = track.at(track.length_m() - 1e-7);
  EXPECT_LT((begin.T_map_road.translation() - end.T_map_road.translation()).norm(), 1e-6);
  EXPECT_LT((begin.T_map_road.linear() - end.T_map_road.linear()).norm(), 1e-6) << "heading, grade and bank";
  EXPECT_NEAR(begin.bank_rad, end.bank_rad, 1e-6);
  EXPECT_LT((begin.turn_per_m - end.turn_per_m).norm(), 1e-6);
  EXPECT_NEAR(begin.right_m, end.right_m, 1e-6);
  EXPECT_NEAR(begin.left_m, end.left_m, 1e-6);
}

TEST_P(EveryCircuit, PartsKeepApart) {
  // The simulator blends the terrain between parts: near ones must be of like height, none may meet.
  struct Spot {
    double s_m;
    Eigen::Vector3d p_m;
  };
  std::vector<Spot> spots;
  for (double s_m = 0; s_m < track.length_m(); s_m += 5)
    spots.push_back({s_m, track.at(s_m).T_map_road.translation()});
  for (const auto& a : spots)
    for (const auto& b : spots) {
      if (std::abs(std::remainder(a.s_m - b.s_m, track.length_m())) < 100) continue;
      const double near_m = (a.p_m - b.p_m).head<2>().norm();
      if (near_m > 60) continue;
      EXPECT_GT(near_m, 25) << a.s_m << " and " << b.s_m;
      EXPECT_LT(std::abs(a.p_m.z() - b.p_m.z()), 6) << a.s_m << " and " << b.s_m;
    }
}

/** Whether a point beside the road lies on the road of any part. */
bool isOnARoad(const Track& track, const Eigen::Vector3d& p_map_m) {
  const auto place = track.locate(p_map_m, 200);
  if (!place) return false;
  const RoadFrame road = track.at(place->s_m);
  return place->n_m < road.left_m - 0.01 && place->n_m > -road.right_m + 0.01;
}

TEST_P(EveryCircuit, WallsStandClearOfEveryRoad) {
  EXPECT_FALSE(circuit.barriers.empty());
  for (const auto& wall : circuit.barriers) {
    ASSERT_LT(wall.from_m, wall.to_m);
    for (double s_m = wall.from_m; s_m <= wall.to_m; s_m += 3) {
      const RoadFrame road = track.at(s_m);
      const double n_m =
          wall.side == Side::left ? road.left_m + wall.offset_m : -road.right_m - wall.offset_m;
      const SurfacePoint foot = track.surface(s_m, n_m);
      EXPECT_GT(1 - n_m * road.turn_per_m.z(), 0.2) << "folds at " << s_m;
      EXPECT_FALSE(isOnARoad(track, foot.T_map_surface.translation())) << "at " << s_m;
    }
  }
}

TEST_P(EveryCircuit, SceneryStandsClearOfEveryRoadAndBehindTheWalls) {
  EXPECT_FALSE(circuit.scenery.empty());
  for (const auto& thing : circuit.scenery) {
    EXPECT_LE(thing.to_m, track.length_m() + 1);
    if (thing.kind == SceneryKind::gantry || thing.kind == SceneryKind::overpass ||
        thing.kind == SceneryKind::tunnel)
      continue;
    for (const Side side : {Side::left, Side::right}) {
      if (thing.side != Side::both && thing.side != side) continue;
      for (double s_m = thing.from_m; s_m <= thing.to_m; s_m += 4) {
        const RoadFrame road = track.at(s_m);
        for (const double beyond_m :
             {thing.offset_m, thing.offset_m + thing.depth_m / 2, thing.offset_m + thing.depth_m}) {
          const double n_m = side == Side::left ? road.left_m + beyond_m : -road.right_m - beyond_m;
          EXPECT_FALSE(isOnARoad(track, track.surface(s_m, n_m).T_map_surface.translation()))
              << "from " << thing.from_m << ", at " << s_m << ", " << beyond_m << " m beside it";
        }
        for (const auto& wall : circuit.barriers) {
          if (wall.side != side || s_m < wall.from_m || s_m > wall.to_m) continue;
          EXPECT_GT(thing.offset_m, wall.offset_m) << "from " << thing.from_m;
        }
      }
    }
  }
}

TEST_P(EveryCircuit, IsWideAndSmoothEnoughForACar) {
  for (double s_m = 0; s_m < track.length_m(); ++s_m) {
    const RoadFrame road = track.at(s_m);
    EXPECT_GE(road.right_m, 4.5);
    EXPECT_GE(road.left_m, 4.5);
    EXPECT_LT(std::abs(road.turn_per_m.z()), 1 / 15.0);
    EXPECT_LT(std::abs(road.turn_per_m.y()), 0.005) << "no kinks in height, at " << s_m;
    EXPECT_LT(std::abs(road.turn_per_m.x()), 0.01) << "no kinks in bank, at " << s_m;
  }
}

INSTANTIATE_TEST_SUITE_P(Track, EveryCircuit, ::testing::ValuesIn(shipped()),
                         [](const auto& circuit) { return circuit.param; });

// ---- Any segments

/** A stadium with one straight longer than the other. */
struct Stadium {
  double radius_m, straight_m, excess_m;
  double length_m() const { return 2 * straight_m + excess_m + 2 * M_PI * radius_m; }
};

std::string written(const Stadium& s, double transition_m) {
  const std::string path =
      (fs::temp_directory_path() / ("raceloc_stadium_" + std::to_string(::getpid()) + ".ini")).string();
  std::ofstream out(path);
  out.precision(12);
  out << "[track]\ntransition_m = " << transition_m << "\n[segment_1]\nlength_m = " << s.straight_m
      << "\n[segment_2]\nturn = left\nradius_m = " << s.radius_m << "\nlength_m = " << M_PI * s.radius_m
      << "\nbank_start_deg = 10\nbank_end_deg = 10\n[segment_3]\nlength_m = " << s.straight_m + s.excess_m
      << "\n[segment_4]\nturn = left\nradius_m = " << s.radius_m << "\nlength_m = " << M_PI * s.radius_m
      << "\nbank_start_deg = 10\nbank_end_deg = 10\n";
  return path;
}

TEST(Segments, AMissUpToOnePercentIsDistributedAndABiggerOneRefused) {
  forAll(60, [](Random& rnd) {
    Stadium s{rnd.uniform(20, 300), rnd.uniform(50, 800), 0};
    const double share = rnd.oneOf({-1.0, 1.0}) * rnd.uniform(0.001, 0.03);
    s.excess_m = share * (2 * s.straight_m + 2 * M_PI * s.radius_m);
    if (s.straight_m + s.excess_m < 10) return;
    const double miss = std::abs(s.excess_m) / s.length_m();
    const std::string path = written(s, rnd.uniform(0, 60));
    if (miss < 0.0099) {
      const Circuit circuit = readCircuit(path);
      EXPECT_NEAR(circuit.miss.gap_m, std::abs(s.excess_m), 0.01);
      EXPECT_NEAR(circuit.track.length_m(), s.length_m(), 0.006 * s.length_m());
      const RoadFrame begin = circuit.track.at(0), end = circuit.track.at(circuit.track.length_m() - 1e-7);
      EXPECT_LT((begin.T_map_road.matrix() - end.T_map_road.matrix()).norm(), 1e-5);
    } else if (miss > 0.0101) {
      try {
        (void)readCircuit(path);
        ADD_FAILURE() << "accepted a miss of " << miss;
      } catch (const InputError& error) {
        char gap[64];
        std::snprintf(gap, sizeof gap, "by %.1f m (", std::abs(s.excess_m));
        EXPECT_NE(std::string(error.what()).find(gap), std::string::npos) << error.what() << " lacks " << gap;
      }
    }
    fs::remove(path);
  });
}

TEST(Segments, TurnsKeepTheirAngleWhateverTheTransition) {
  forAll(60, [](Random& rnd) {
    const Stadium s{rnd.uniform(8, 300), rnd.uniform(20, 500), 0};
    const std::string path = written(s, rnd.uniform(0, 100));
    const Circuit circuit = readCircuit(path);
    EXPECT_LT(std::abs(circuit.miss.heading_rad), 1e-9);
    EXPECT_LT(circuit.miss.gap_m, 1e-6);
    fs::remove(path);
  });
}

}  // namespace
}  // namespace raceloc
