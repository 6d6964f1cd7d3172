/** \file
 * The verdict on a map: laps of a circle whose fixes, loops, road and walls are made up. */
#include <gmock/gmock.h>

#include <algorithm>
#include <functional>

#include "pipeline/map_qa.h"
#include "support/forall.h"

namespace raceloc {
namespace {

using test::forAll;
using test::Random;
using ::testing::HasSubstr;
using ::testing::Not;

constexpr double kRadius_m = 100, kStep_s = 0.2, kSigma_m = 0.02;
constexpr int kWaypoints = 120;
const double kSpacing_m = 2 * M_PI * kRadius_m / kWaypoints;
const Eigen::Vector3d kLever_m(1.2, 0.3, 1.5);

/** What is wrong with a receiver. */
struct Fault {
  Eigen::Vector3d lever_m = Eigen::Vector3d::Zero();
  double time_s = 0;
};

/** A drive whose pose is known at any time. */
using Drive = std::function<Pose(double stamp_s)>;

/** The road banks with the angle, so that no component of a lever arm hides. */
Pose onCircle(double driven_m) {
  const double angle_rad = driven_m / kRadius_m;
  return poseFromRpy({kRadius_m * std::cos(angle_rad), kRadius_m * std::sin(angle_rad), 0},
                     0.3 * std::sin(angle_rad), 0, wrapAngle(angle_rad + M_PI / 2));
}
Pose atVaryingSpeed(double stamp_s) { return onCircle(20 * stamp_s - 60 * std::cos(0.2 * stamp_s) + 60); }
Pose onStraight(double stamp_s) { return poseFromRpy({20 * stamp_s, 5, 0}, 0, 0, 0); }

std::vector<KeyPose> driven(const Drive& drive, double duration_s) {
  std::vector<KeyPose> keys;
  for (int i = 0; i * kStep_s < duration_s; ++i)
    keys.push_back({1e9 + i * kStep_s, drive(i * kStep_s), "survey"});
  return keys;
}

void addFixes(MapContent& content, const Drive& drive, const std::string& receiver, const Fault& fault,
              Random& rnd) {
  for (std::size_t key = 0; key < content.key_poses.size(); ++key) {
    const double stamp_s = static_cast<double>(key) * kStep_s;
    const Eigen::Vector3d noise_m(rnd.normal(kSigma_m), rnd.normal(kSigma_m), rnd.normal(kSigma_m));
    content.fixes.push_back({static_cast<std::int32_t>(key), receiver,
                             drive(stamp_s + fault.time_s) * (kLever_m + fault.lever_m) + noise_m,
                             kSigma_m * kSigma_m * Eigen::Matrix3d::Identity(), kLever_m, 1});
  }
}

void addOdometry(MapContent& content, double sigma_m) {
  for (std::int32_t key = 1; key < static_cast<std::int32_t>(content.key_poses.size()); ++key)
    content.edges.push_back(
        {key - 1, key, Pose::Identity(), Matrix6d::Identity() / (sigma_m * sigma_m), EdgeKind::odometry});
}

/** 80 s of the circle: two laps and a half with everything a good map has. */
struct GoodMap {
  MapContent content;
  MapReport report{};

  explicit GoodMap(Random& rnd, const Fault& fault = {}) {
    content.info = {GeodeticPoint{48, 8, 100}, 32, 0.2, "test", "", {"survey"}, kSpacing_m};
    content.key_poses = driven(atVaryingSpeed, 80);
    for (KeyPose& k : content.key_poses) {
      const Eigen::Vector3d p_m = k.T_map_body.translation();
      const double turns = std::atan2(p_m.y(), p_m.x()) / (2 * M_PI) + 1;
      k.racetrack_id = static_cast<std::int32_t>(std::lround(turns * kWaypoints)) % kWaypoints;
    }
    for (int i = 0; i < kWaypoints; ++i) {
      const Pose T = onCircle(i * kSpacing_m);
      content.waypoints.push_back({T.translation(), yawOf(T)});
      content.road.push_back({i * kSpacing_m, 0, 0, 0});
    }
    for (int i = 0; i < kWaypoints; ++i)
      content.walls.push_back({i * kSpacing_m, WallSide::right, onCircle(i * kSpacing_m).translation(), 1});
    addOdometry(content, 0.02);
    addFixes(content, atVaryingSpeed, "gps_a", fault, rnd);
    addFixes(content, atVaryingSpeed, "gps_b", {}, rnd);
    report.converged = true;
    report.gps_rmse_m = 0.03;
    report.walls = {0.03, 0.04, 100};
    report.loops.push_back({0, 170,
                            content.key_poses[0].T_map_body.inverse() * content.key_poses[170].T_map_body,
                            1e-4 * Matrix6d::Identity(), 0.1, 0.9, 3, 0});
    report.loop_residual_m = 0.02;
  }
  [[nodiscard]] QaResult qa(const QaOptions& options = {}) const { return qaOf(content, report, options); }
};

TEST(MapQaProperty, InjectedLeverArmAndTimeOffsetAreFound) {
  forAll(20, [](Random& rnd) {
    const Fault fault{rnd.vectorWithin(0.1), rnd.uniform(-0.01, 0.01)};
    const QaResult qa = GoodMap(rnd, fault).qa();
    ASSERT_EQ(qa.receivers.size(), 2U);
    const ReceiverQa& off = qa.receivers[0];
    for (std::size_t i = 0; i < 3; ++i) {
      EXPECT_TRUE(off.lever_m[i].observable) << off.lever_m[i].sigma;
      EXPECT_NEAR(off.lever_m[i].value, fault.lever_m(static_cast<Eigen::Index>(i)),
                  3 * off.lever_m[i].sigma);
    }
    EXPECT_TRUE(off.time_offset_s.observable) << off.time_offset_s.sigma;
    EXPECT_NEAR(off.time_offset_s.value, fault.time_s, 3 * off.time_offset_s.sigma);
  });
}

TEST(MapQaProperty, OnAStraightAtConstantSpeedNeitherIsObservable) {
  forAll(20, [](Random& rnd) {
    MapContent content{{GeodeticPoint{48, 8, 100}, 32, 0.2, "test", "", {"survey"}}, driven(onStraight, 80)};
    addFixes(content, onStraight, "gps_a", {rnd.vectorWithin(0.3), rnd.uniform(-0.05, 0.05)}, rnd);
    const QaResult qa = qaOf(content, {}, {});
    for (const Estimate& lever : qa.receivers.at(0).lever_m) EXPECT_FALSE(lever.observable) << lever.sigma;
    EXPECT_FALSE(qa.receivers.at(0).time_offset_s.observable) << qa.receivers.at(0).time_offset_s.sigma;
    EXPECT_THAT(verdict(qa), Not(HasSubstr("gps_a")));
  });
}

TEST(MapQaProperty, AtConstantSpeedTurnsTellTheLeverButNotTheStamps) {
  Random rnd(1);
  const Drive constant = [](double stamp_s) { return onCircle(20 * stamp_s); };
  MapContent content{{GeodeticPoint{48, 8, 100}, 32, 0.2, "test", "", {"survey"}}, driven(constant, 80)};
  addFixes(content, constant, "gps_a", {}, rnd);
  const ReceiverQa receiver = qaOf(content, {}, {}).receivers.at(0);
  EXPECT_TRUE(receiver.lever_m[1].observable);
  EXPECT_FALSE(receiver.time_offset_s.observable);
}

TEST(MapQaProperty, AGoodMapPassesAndItsStationsAreCounted) {
  Random rnd(1);
  const QaResult qa = GoodMap(rnd).qa();
  EXPECT_EQ(verdict(qa), "PASS");
  EXPECT_TRUE(qa.passed());
  ASSERT_EQ(qa.stations.size(), static_cast<std::size_t>(kWaypoints));
  const double driven_m = 20 * 79.8 - 60 * std::cos(0.2 * 79.8) + 60;
  int passes = 0;
  for (const StationQa& station : qa.stations) {
    EXPECT_GE(station.passes, 2);
    EXPECT_LE(station.passes, 3);
    passes += station.passes;
    EXPECT_TRUE(station.odometry);
  }
  EXPECT_NEAR(passes, driven_m / kSpacing_m, 1.5);  // the ends are rounded to stations
}

TEST(MapQa, WhatTheLogsLackedIsInTheVerdict) {
  Random rnd(1);
  GoodMap map(rnd);
  SessionReport session{};
  session.session = "a.rawlog";
  map.report.sessions.push_back(session);
  EXPECT_EQ(verdict(map.qa()), "PASS");
  map.report.sessions[0].odometry.faults = {{"LiDAR top: no point times, " + std::string(kTakenAsItIs), 812},
                                            {"LiDAR left: silent", 9}};
  map.report.sessions[0].odometry.restarts = 2;
  EXPECT_EQ(
      verdict(map.qa()),
      "PASS; scans used as they are: LiDAR top: no point times, scan taken as it is (812 times)"
      "; degraded: LiDAR left: silent (9 times); LiDAR odometry lost for good and begun anew (2 times)");
  EXPECT_TRUE(map.qa().passed());
  map.report.sessions.push_back(session);
  EXPECT_THAT(verdict(map.qa()), HasSubstr("; degraded: a.rawlog: LiDAR left: silent (9 times)"));
}

/** One thing made worse, and the words of the verdict that name it. */
struct Spoilt {
  const char* words;
  std::function<void(GoodMap&, QaOptions&)> spoil;
};

TEST(MapQa, EachLimitFailsTheVerdictByName) {
  const std::vector<Spoilt> cases{
      {"wall thickness 0.071 m > 0.050 m", [](GoodMap& m, auto&) { m.report.walls.median_m = 0.071; }},
      {"measured pieces of wall 0 < 1", [](GoodMap& m, auto&) { m.report.walls = {}; }},
      {"GPS rmse 0.200 m > 0.100 m", [](GoodMap& m, auto&) { m.report.gps_rmse_m = 0.2; }},
      {"GPS fixes 0 < 1", [](GoodMap& m, auto&) { m.content.fixes.clear(); }},
      {"refused fixes 50.0 % > 25.0 %",
       [](GoodMap& m, auto&) {
         for (MapFix& fix : m.content.fixes)
           if (fix.receiver == "gps_a") fix.weight = 0;
       }},
      {"way without a fix 209.440 m > 200.000 m",  // 40 of the 120 stations, across the start line
       [](GoodMap& m, auto&) {
         auto& fixes = m.content.fixes;
         fixes.erase(
             std::remove_if(fixes.begin(), fixes.end(),
                            [&](const MapFix& fix) {
                              const int id =
                                  *m.content.key_poses[static_cast<std::size_t>(fix.key)].racetrack_id;
                              return id < 15 || id >= 95;
                            }),
             fixes.end());
       }},
      {"loop residual 0.300 m > 0.100 m", [](GoodMap& m, auto&) { m.report.loop_residual_m = 0.3; }},
      {"loops 0 < 1", [](GoodMap& m, auto&) { m.report.loops.clear(); }},
      {"graphs that did not converge 1 > 0", [](GoodMap& m, auto&) { m.report.converged = false; }},
      {"full laps 2 < 3", [](GoodMap&, QaOptions& o) { o.min_passes = 3; }},
      {"full laps 0 < 1",
       [](GoodMap& m, auto&) {
         for (KeyPose& k : m.content.key_poses)
           if (*k.racetrack_id / 10 == 5) k.racetrack_id.reset();
       }},
      {"stations with road 50.0 % < 95.0 %",
       [](GoodMap& m, auto&) { m.content.road.resize(kWaypoints / 2); }},
      {"stations with a wall 25.0 % < 50.0 %",
       [](GoodMap& m, auto&) { m.content.walls.erase(m.content.walls.begin() + 30, m.content.walls.end()); }},
      {"degenerate stations 100.0 % > 10.0 %",
       [](GoodMap& m, auto&) {
         m.content.edges.clear();
         addOdometry(m.content, 0.5);
       }},
  };
  for (const Spoilt& spoilt : cases) {
    SCOPED_TRACE(spoilt.words);
    Random rnd(1);
    GoodMap map(rnd);
    QaOptions options;
    spoilt.spoil(map, options);
    const QaResult qa = map.qa(options);
    EXPECT_FALSE(qa.passed());
    EXPECT_EQ(verdict(qa), std::string("FAIL: ") + spoilt.words);
  }
}

TEST(MapQa, AWrongLeverArmAndWrongStampsFailByReceiver) {
  Random rnd(1);
  const std::string lever = verdict(GoodMap(rnd, {{0.2, 0, 0}, 0}).qa());
  EXPECT_THAT(lever, HasSubstr("FAIL: gps_a lever arm error 0."));
  EXPECT_THAT(lever, Not(HasSubstr("gps_b")));
  EXPECT_THAT(verdict(GoodMap(rnd, {Eigen::Vector3d::Zero(), 0.03}).qa()),
              HasSubstr("FAIL: gps_a time offset 0.0"));
}

TEST(MapQa, LoopsThatAreWeakInADirectionAreListedByStation) {
  Random rnd(1);
  GoodMap map(rnd);
  EXPECT_TRUE(map.qa().degenerate_loops.empty());
  map.report.loops[0].covariance(3, 3) = 4;
  const QaResult qa = map.qa();
  ASSERT_EQ(qa.degenerate_loops.size(), 1U);
  EXPECT_EQ(qa.degenerate_loops[0].begin_m, *qa.loops[0].station_m);
  EXPECT_EQ(qa.loops[0].weakest.axis, 'x');
  EXPECT_TRUE(qa.passed());
}

TEST(MapQa, AMapWithoutALapHasStationsOfTheDrive) {
  Random rnd(1);
  MapContent content{{GeodeticPoint{48, 8, 100}, 32, 0.2, "test", "", {"survey"}}, driven(onStraight, 20)};
  addOdometry(content, 0.02);
  const QaResult qa = qaOf(content, {}, {});
  EXPECT_FALSE(qa.on_lap);
  EXPECT_NEAR(static_cast<double>(qa.stations.size()) * qa.spacing_m, 20 * 20, 10);
  EXPECT_THAT(verdict(qa), HasSubstr("full laps 0 < 1"));
  for (const StationQa& station : qa.stations) EXPECT_EQ(station.passes, 1) << station.station_m;
}

}  // namespace
}  // namespace raceloc
