/** \file
 * Receivers that lie, on a lap with two of them: which fixes are refused, and what becomes of the map. */
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <functional>

#include "graph/gps_spans.h"
#include "support/forall.h"

namespace raceloc {
namespace {

using test::forAll;
using test::Random;

constexpr double kStep_s = 0.1, kSpeed_mps = 20;
constexpr double kRtk_m = 0.02;
constexpr int kReceivers = 2;
const std::array<std::string, kReceivers> kNames{"gps_left", "gps_right"};

Eigen::Vector3d noise(Random& rnd, double sigma) {
  return {rnd.normal(sigma), rnd.normal(sigma), rnd.normal(sigma)};
}

struct Drive {
  std::vector<Keyframe> keyframes;
  std::vector<Pose> T_map_body;  ///< the truth
};

/** What a source of motion makes of it: a share of the way too much, and noise that its covariance tells. */
BodyMotion measured(const Pose& T_start_end, double stretch, double sigma_rad, double sigma_m, Random& rnd) {
  Vector6d xi;
  xi << noise(rnd, sigma_rad), noise(rnd, sigma_m);
  Pose T = T_start_end;
  T.translation() *= 1 + stretch;
  Vector6d sigma;
  sigma << Eigen::Vector3d::Constant(sigma_rad), Eigen::Vector3d::Constant(sigma_m);
  return {kStep_s, T * se3Exp(xi), sigma.cwiseAbs2().asDiagonal()};
}

/** An oval lap over hills, `keys` key poses long, 2 m apart at 10 Hz: odometry that drifts by 0.1 % of the way, wheels
 * five times as bad, two RTK receivers, an accelerometer. */
Drive drive(Random& rnd, int keys, double begin_s = 0) {
  const double a_m = rnd.uniform(100, 300), b_m = rnd.uniform(0.4, 1) * a_m, begin_rad = rnd.uniform(-3, 3);
  const double stretch = rnd.oneOf({-1e-3, 1e-3}), wheels = rnd.uniform(-5e-3, 5e-3);
  const std::array<Eigen::Vector3d, kReceivers> levers_m{Eigen::Vector3d(0.3, 0.5, 1), {0.3, -0.5, 1}};
  Drive drive;
  Pose T_odom_body = Pose::Identity();
  double angle_rad = begin_rad;
  for (int i = 0; i < keys; ++i) {
    const double ahead_m = std::hypot(a_m * std::sin(angle_rad), b_m * std::cos(angle_rad));
    const Pose T =
        poseFromRpy({a_m * std::cos(angle_rad), b_m * std::sin(angle_rad), 3 * std::sin(2 * angle_rad)}, 0.1,
                    -6 * std::cos(2 * angle_rad) / ahead_m,
                    std::atan2(b_m * std::cos(angle_rad), -a_m * std::sin(angle_rad)));
    angle_rad += kSpeed_mps * kStep_s / ahead_m;
    Keyframe k{begin_s + kStep_s * i, Pose::Identity(), {}};
    if (i > 0) {
      const Pose T_start_end = drive.T_map_body.back().inverse() * T;
      k.since_last = measured(T_start_end, stretch, 1e-4, 0.003, rnd);
      k.reckoned = measured(T_start_end, wheels, 5e-4, 0.01, rnd);
      T_odom_body = T_odom_body * k.since_last.T_start_end;
    }
    k.since_last.covariance = flooredOdometry(k.since_last.covariance, {});
    k.T_odom_body = T_odom_body;
    for (std::size_t r = 0; r < kReceivers; ++r)
      k.gps.push_back({kNames[r], T * levers_m[r] + noise(rnd, kRtk_m),
                       kRtk_m * kRtk_m * Eigen::Matrix3d::Identity(), levers_m[r]});
    k.level = KeyLevel{(T.linear().transpose() * Eigen::Vector3d::UnitZ() + noise(rnd, kDegree)).normalized(),
                       kDegree};
    drive.keyframes.push_back(std::move(k));
    drive.T_map_body.push_back(T);
  }
  return drive;
}

void append(Drive& drive, const Drive& next) {
  drive.keyframes.insert(drive.keyframes.end(), next.keyframes.begin(), next.keyframes.end());
  drive.T_map_body.insert(drive.T_map_body.end(), next.T_map_body.begin(), next.T_map_body.end());
}

/** A lie of one receiver, at key poses first .. last. */
struct Lie {
  std::size_t receiver, first, last;
};

/** \param change  a fix, `along_s` after the lie began and `left_s` before it ends */
void tell(Drive& drive, const Lie& lie,
          const std::function<void(KeyGps&, double along_s, double left_s)>& change) {
  for (std::size_t key = lie.first; key <= lie.last; ++key)
    change(drive.keyframes[key].gps[lie.receiver], kStep_s * static_cast<double>(key - lie.first),
           kStep_s * static_cast<double>(lie.last - key));
}

/** Somewhere on the drive, also at its ends. */
Lie lieOf(Random& rnd, const Drive& drive, double duration_s) {
  const int keys = static_cast<int>(drive.keyframes.size()), length = static_cast<int>(duration_s / kStep_s);
  const int first = std::clamp(rnd.integer(-length, keys), 0, keys - length);
  return {static_cast<std::size_t>(rnd.integer(0, kReceivers - 1)), static_cast<std::size_t>(first),
          static_cast<std::size_t>(first + length - 1)};
}

Eigen::Vector3d aside(Random& rnd, double least_m, double most_m) {
  Eigen::Vector3d direction = rnd.vectorWithin(1);
  direction.z() *= 0.3;
  return direction.normalized() * rnd.uniform(least_m, most_m);
}

struct Found {
  std::vector<GpsSpan> spans;
  std::vector<Pose> T_map_body;
};

/** The mapper's way, without loops. */
Found found(Drive& drive) {
  const GraphOptions o;
  auto& keyframes = drive.keyframes;
  GraphSolution gps = solveGraph(GraphKind::gps, keyframes, {}, alignedOdometry(keyframes), o);
  refuseUnchained(keyframes, gps.T_map_body, o);
  gps = solveGraph(GraphKind::gps, keyframes, {}, gps.T_map_body, o);
  GraphSolution joint = solveGraph(GraphKind::joint, keyframes, {}, gps.T_map_body, o);
  std::vector<GpsSpan> spans;
  for (int round = 0; round < 2; ++round) {
    joint = solveGraph(GraphKind::joint, keyframes, {}, joint.T_map_body, o);
    spans = gpsSpans(keyframes, joint.T_map_body, o);
    refuse(keyframes, spans);
  }
  joint = solveGraph(GraphKind::joint, keyframes, {}, joint.T_map_body, o);
  return {spans, joint.T_map_body};
}

double worstError_m(const Found& found, const Drive& drive) {
  double worst = 0;
  for (std::size_t i = 0; i < drive.T_map_body.size(); ++i)
    worst = std::max(worst, (found.T_map_body[i].translation() - drive.T_map_body[i].translation()).norm());
  return worst;
}

bool within(std::size_t key, const Lie& lie) { return lie.first <= key && key <= lie.last; }

/** How many of the fixes outside all lies are refused. */
double refusedShare(const Drive& drive, const std::vector<Lie>& lies) {
  double good = 0, refused = 0;
  for (std::size_t key = 0; key < drive.keyframes.size(); ++key)
    for (std::size_t r = 0; r < kReceivers; ++r) {
      if (std::any_of(lies.begin(), lies.end(),
                      [&](const Lie& lie) { return lie.receiver == r && within(key, lie); }))
        continue;
      ++good;
      refused += drive.keyframes[key].gps[r].refused ? 1 : 0;
    }
  return refused / good;
}

std::string listed(const std::vector<GpsSpan>& spans) {
  std::string lines;
  for (const GpsSpan& span : spans) lines += text(span, 0) + "\n";
  return lines;
}

/** Each lie is one span, its ends not off by more than `fixes`. */
void expectListed(const std::vector<GpsSpan>& spans, const std::vector<Lie>& lies, bool refused, int fixes) {
  for (const Lie& lie : lies)
    EXPECT_EQ(std::count_if(spans.begin(), spans.end(),
                            [&](const GpsSpan& span) {
                              const auto off = [](std::size_t a, std::size_t b) {
                                return std::abs(static_cast<int>(a) - static_cast<int>(b));
                              };
                              return span.receiver == kNames[lie.receiver] && span.refused == refused &&
                                     off(span.first, lie.first) <= fixes && off(span.last, lie.last) <= fixes;
                            }),
              1)
        << kNames[lie.receiver] << " lies at key poses " << lie.first << " .. " << lie.last
        << "; listed are\n"
        << listed(spans);
}

/** Six sigma of a fix; two receivers and the odometry beside it make it much less. */
constexpr double kMap_m = 0.1;
constexpr double kGoodRefused = 0.01;
constexpr int kKeys = 1000;

void expectFoundOut(Drive& drive, const std::vector<Lie>& lies, int fixes) {
  const Found f = found(drive);
  expectListed(f.spans, lies, true, fixes);
  EXPECT_LE(refusedShare(drive, lies), kGoodRefused) << listed(f.spans);
  EXPECT_LT(worstError_m(f, drive), kMap_m) << listed(f.spans);
}

TEST(GpsSpansProperty, HonestReceiversAreBelieved) {
  forAll(3, [](Random& rnd) {
    Drive d = drive(rnd, kKeys);
    const Found f = found(d);
    EXPECT_TRUE(f.spans.empty()) << listed(f.spans);
    EXPECT_EQ(refusedShare(d, {}), 0);
    EXPECT_LT(worstError_m(f, d), kMap_m);
  });
}

TEST(GpsSpansProperty, AStepOfOneReceiverIsFoundOut) {
  forAll(3, [](Random& rnd) {
    Drive d = drive(rnd, kKeys);
    const Lie lie = lieOf(rnd, d, rnd.uniform(1, 30));
    const Eigen::Vector3d step_m = aside(rnd, 2, 20);
    tell(d, lie, [&](KeyGps& gps, double, double) { gps.p_map_antenna_m += step_m; });
    expectFoundOut(d, {lie}, 2);
  });
}

TEST(GpsSpansProperty, TheSameStepOfBothIsFoundOut) {
  forAll(3, [](Random& rnd) {
    Drive d = drive(rnd, kKeys);
    const auto first =
        static_cast<std::size_t>(rnd.integer(100, kKeys - 130));  // 10 s of truth on either side
    const std::vector<Lie> lies{{0, first, first + 29}, {1, first, first + 29}};
    const Eigen::Vector3d step_m = aside(rnd, 2, 20);
    for (const Lie& lie : lies)
      tell(d, lie, [&](KeyGps& gps, double, double) { gps.p_map_antenna_m += step_m; });
    expectFoundOut(d, lies, 2);
  });
}

TEST(GpsSpansProperty, NoiseThatIsNotOwnedUpToIsFoundOut) {
  forAll(3, [](Random& rnd) {
    Drive d = drive(rnd, kKeys);
    const Lie lie = lieOf(rnd, d, rnd.uniform(1, 30));
    tell(d, lie, [&](KeyGps& gps, double, double) { gps.p_map_antenna_m += noise(rnd, 10); });
    expectFoundOut(d, {lie}, 2);
  });
}

TEST(GpsSpansProperty, NoiseThatIsOwnedUpToIsPoorButNotRefused) {
  forAll(3, [](Random& rnd) {
    Drive d = drive(rnd, kKeys);
    const Lie lie = lieOf(rnd, d, rnd.uniform(1, 30));
    const double sigma_m = rnd.uniform(1, 10);
    tell(d, lie, [&](KeyGps& gps, double, double) {
      gps.p_map_antenna_m += noise(rnd, sigma_m);
      gps.cov_map_m2 = sigma_m * sigma_m * Eigen::Matrix3d::Identity();
    });
    const Found f = found(d);
    expectListed(f.spans, {lie}, false, 0);
    EXPECT_EQ(f.spans.size(), 1U) << listed(f.spans);
    for (const Keyframe& k : d.keyframes)
      for (const KeyGps& gps : k.gps) EXPECT_FALSE(gps.refused);
    EXPECT_LT(worstError_m(f, d), kMap_m);
  });
}

TEST(GpsSpansProperty, DrivesInARowDoNotJoinASpan) {
  forAll(3, [](Random& rnd) {
    Drive d = drive(rnd, 300);
    const double begin_s = d.keyframes.back().stamp_s + kStep_s;  // a log that was cut in two
    append(d, drive(rnd, 300, begin_s));
    const std::vector<Lie> lies{{1, 250, 299}, {1, 300, 340}};
    for (const Lie& lie : lies) {
      const Eigen::Vector3d step_m = aside(rnd, 2, 20);
      tell(d, lie, [&](KeyGps& gps, double, double) { gps.p_map_antenna_m += step_m; });
    }
    expectFoundOut(d, lies, 2);
  });
}

TEST(GpsSpans, AReceiverThatOnlyStrewsItsFixesIsLeftToTheOther) {
  Random rnd(5);
  Drive d = drive(rnd, 300);
  const Lie lie{0, 0, 299};
  tell(d, lie, [&](KeyGps& gps, double, double) { gps.p_map_antenna_m += noise(rnd, 10); });
  expectFoundOut(d, {lie}, 2);
}

TEST(GpsSpans, WhereAllFixesAreStrewnThereIsStillAMap) {
  Random rnd(6);
  Drive d = drive(rnd, 300);
  for (std::size_t r = 0; r < kReceivers; ++r)
    tell(d, {r, 0, 299}, [&](KeyGps& gps, double, double) { gps.p_map_antenna_m += noise(rnd, 10); });
  EXPECT_NO_THROW(found(d));
}

TEST(GpsSpans, RefuseMarksTheRefusedSpansAndNoOthers) {
  Random rnd(7);
  Drive d = drive(rnd, 30);
  d.keyframes[20].gps[0].refused = true;
  refuse(d.keyframes,
         {{kNames[0], 5, 7, 0.5, 0.7, 3, 9, 0.02, true}, {kNames[1], 10, 12, 1, 1.2, 3, 9, 2, false}});
  for (std::size_t key = 0; key < 30; ++key) {
    EXPECT_EQ(d.keyframes[key].gps[0].refused, 5 <= key && key <= 7) << key;
    EXPECT_FALSE(d.keyframes[key].gps[1].refused) << key;
  }
}

}  // namespace
}  // namespace raceloc
