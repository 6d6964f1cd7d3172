/** \file
 * Scans of one LiDAR or several into sweeps: given ..., when ..., then .... */
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <functional>
#include <set>

#include "odometry/scan_queue.h"
#include "support/forall.h"
#include "support/plain_car.h"

namespace raceloc {
namespace {

using test::forAll;
using test::Random;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Pair;

constexpr double kPeriod_s = 0.1, kEnd_s = 3;

/** A LiDAR that sweeps all the time, and when its scans are handed over after their begin. */
struct Rhythm {
  std::string label;
  double phase_s = 0, delay_s = 0;  ///< delay 0: as a log that is put in order of stamps; kPeriod_s: live
  std::function<bool(double)> works = [](double) { return true; };
};

/** A sweep that left the queue, and when. */
struct Left {
  std::set<std::string> labels;
  double begin_s, end_s, left_s;
};

struct Drive {
  std::vector<Left> sweeps;
  FaultCounts faults;
};

Drive drive(const std::vector<Rhythm>& lidars, Random& rnd, double jitter_s = 0,
            std::vector<std::string> expected = {}) {
  std::multimap<double, Sample> arrivals;
  for (int i = 0; i <= 100 * kEnd_s; ++i)
    arrivals.emplace(0.01 * i, MotionSample{0.01 * i, "vehicle", 10, 0});
  for (const Rhythm& lidar : lidars)
    for (int i = 0; i < kEnd_s / kPeriod_s - 2; ++i) {
      const double begin_s = lidar.phase_s + kPeriod_s * i + rnd.uniform(-jitter_s, jitter_s);
      if (!lidar.works(begin_s)) continue;
      Scan scan{begin_s, lidar.label, Pose::Identity(), {}, {}, {}};
      for (int k = 0; k <= 10; ++k) {
        scan.cloud.push({10, 0, 0});
        scan.time_s.push_back(static_cast<float>(kPeriod_s) * 0.1F * static_cast<float>(k));
      }
      arrivals.emplace(begin_s + lidar.delay_s, scan);
    }
  ScanQueue queue(std::move(expected));
  MotionHistory history(test::plainMotion(), test::plainCalibration());
  Drive result;
  const auto take = [&](const Sweep& sweep, double now_s) {
    Left left{{}, sweep.begin_s, sweep.end_s, now_s};
    for (const Scan& scan : sweep.scans) EXPECT_TRUE(left.labels.insert(scan.label).second) << now_s;
    if (!result.sweeps.empty()) {
      EXPECT_GT(sweep.end_s, result.sweeps.back().end_s);
    }
    result.sweeps.push_back(left);
    for (const auto& [fault, times] : queue.takeFaults(sweep.end_s)) result.faults[fault] += times;
  };
  for (auto& [now_s, sample] : arrivals) {
    if (const auto* motion = std::get_if<MotionSample>(&sample)) history.add(*motion);
    if (const auto* scan = std::get_if<Scan>(&sample)) queue.push(*scan);
    while (const auto sweep = queue.pop(history, now_s)) take(*sweep, now_s);
  }
  while (const auto sweep = queue.popAny()) take(*sweep, kEnd_s);
  return result;
}

/** Log order or live. */
double anyDelay(Random& rnd) { return rnd.oneOf({0.0, kPeriod_s + 0.002, kPeriod_s + 0.02}); }

TEST(ScanQueueProperty, GivenOneLidarEachScanLeavesWhenItsMotionIsKnown) {
  forAll(20, [](Random& rnd) {
    const double delay_s = anyDelay(rnd);
    const Drive one = drive({{"lidar", rnd.uniform(0, 0.1), delay_s}}, rnd, 0.001);
    EXPECT_EQ(one.sweeps.size(), 28U);
    EXPECT_THAT(one.faults, IsEmpty());
    // The next wheel speed, or the scan itself, whichever comes later.
    for (const Left& left : one.sweeps)
      EXPECT_LT(left.left_s, left.end_s + std::max(0.0, delay_s - kPeriod_s) + 0.0101);
  });
}

TEST(ScanQueueProperty, GivenSeveralLidarsASweepHasOneScanOfEach) {
  forAll(200, [](Random& rnd) {
    const int count = rnd.integer(2, 4);
    const double delay_s = anyDelay(rnd);
    std::vector<Rhythm> lidars;
    for (int i = 0; i < count; ++i)
      lidars.push_back({"lidar_" + std::to_string(i), rnd.uniform(0, 0.1), delay_s});
    const Drive all = drive(lidars, rnd, 0.001);
    EXPECT_THAT(all.faults, IsEmpty());
    std::size_t whole = 0;
    for (const Left& left : all.sweeps) {
      if (left.labels.size() == lidars.size()) ++whole;
      // The turn less its longest pause, which is at least its n-th part; and what is about equal.
      EXPECT_LT(left.end_s - left.begin_s, kPeriod_s * (2 - 1.0 / count + 0.1) + 0.004);
    }
    EXPECT_GE(whole, 24U);  // of 28, less the beginning and the end
  });
}

TEST(ScanQueueProperty, WhenALidarDiesTheOthersWaitOnceAndAQuarterOfAPeriod) {
  forAll(200, [](Random& rnd) {
    const double delay_s = anyDelay(rnd), dies_s = rnd.uniform(0.5, 1.0), back_s = rnd.uniform(1.5, 2.0);
    std::vector<Rhythm> lidars;
    for (const char* label : {"lidar_a", "lidar_b", "lidar_c"})
      lidars.push_back({label, rnd.uniform(0, 0.1), delay_s});
    lidars.back().works = [=](double t) { return t < dies_s || t > back_s; };
    const Drive dead = drive(lidars, rnd, 0.001);
    std::size_t delayed = 0, without = 0, with_it = 0;
    for (const Left& left : dead.sweeps) {
      const double wait_s = left.left_s - left.end_s - std::max(0.0, delay_s - kPeriod_s);
      // A dead one may have been due up to two thirds of a period after the others.
      EXPECT_LT(wait_s, kPeriod_s * (2.0 / 3 + 0.25) + 0.015);
      if (wait_s > 0.012 && left.end_s < kEnd_s - 0.3) ++delayed;  // at the end of the drive all die
      const bool has_it = left.labels.count("lidar_c") > 0;
      if (left.end_s > dies_s + 0.25 && left.end_s < back_s) without += has_it ? 0 : 1;
      if (left.begin_s > back_s + 0.2) with_it += has_it ? 1 : 0;
    }
    EXPECT_LE(delayed, 2U);  // when it dies, and when the turn is divided anew with it back
    EXPECT_GE(without, 2U);
    EXPECT_GT(with_it, 4U);
    ASSERT_THAT(dead.faults, ElementsAre(Pair("LiDAR lidar_c: silent", ::testing::Ge(without))));
  });
}

TEST(ScanQueue, WhenALidarIsAlwaysLateItsScansGoWithTheNextSweepAndNobodyWaits) {
  Random rnd(1);
  const Drive late = drive(
      {{"lidar_a", 0, kPeriod_s}, {"lidar_b", 0.01, kPeriod_s}, {"lidar_late", 0, kPeriod_s + 0.06}}, rnd);
  std::size_t with_it = 0;
  for (const Left& left : late.sweeps) {
    if (left.end_s < 0.5) continue;
    EXPECT_LT(left.left_s, left.end_s + 0.0101);
    with_it += left.labels.count("lidar_late");
  }
  EXPECT_GE(with_it, 20U);
  EXPECT_THAT(late.faults, ElementsAre(Pair("LiDAR lidar_late: late", ::testing::Ge(20U))));
}

TEST(ScanQueue, ALidarThatIsCountedOnAndNeverDeliversIsNamed) {
  Random rnd(1);
  const Drive dead = drive({{"lidar_a"}, {"lidar_b", 0.03}}, rnd, 0, {"lidar_a", "lidar_left"});
  EXPECT_THAT(dead.faults, ElementsAre(Pair("LiDAR lidar_left: silent", ::testing::Ge(15U))));
  for (const Left& left : dead.sweeps) EXPECT_LT(left.left_s, left.end_s + 0.0101);
}

TEST(ScanQueue, TwoRatesAreMatchedAsOneWhereTheyMeet) {
  ScanQueue queue;
  const auto scan = [](const char* label, double stamp_s) {
    return Scan{stamp_s, label, Pose::Identity(), {}, {}, {}};
  };
  for (int i = 0; i < 40; ++i) {
    queue.push(scan("fast", 0.05 * i));
    if (i % 2 == 0) queue.push(scan("slow", 0.05 * i + 0.01));
  }
  std::size_t alone = 0, both = 0;
  while (const auto sweep = queue.popAny()) (sweep->scans.size() == 2 ? both : alone) += 1;
  EXPECT_NEAR(static_cast<double>(both), 20, 1);
  EXPECT_NEAR(static_cast<double>(alone), 20, 1);
}

/** Scans of a sweeping LiDAR, those from 1 s to 2 s with other point times. */
FaultCounts withTimes(const std::function<void(Scan&, Random&)>& spoil, std::size_t& sweeps) {
  Random rnd(1);
  ScanQueue queue;
  FaultCounts faults;
  double last_end_s = 0;
  sweeps = 0;
  for (int i = 0; i < 30; ++i) {
    Scan scan{0.1 * i, "lidar", Pose::Identity(), {}, {}, {}};
    for (int k = 0; k < 1000; ++k) {
      const double azimuth_rad = 2 * M_PI * k / 1000;
      scan.cloud.push(
          Eigen::Vector3d(20 * std::cos(azimuth_rad), 20 * std::sin(azimuth_rad), k % 2).cast<float>());
      scan.time_s.push_back(static_cast<float>(0.1 * k / 1000));
    }
    if (i >= 10 && i < 20) spoil(scan, rnd);
    queue.push(scan);
    while (const auto sweep = queue.popAny()) {
      ++sweeps;
      EXPECT_GT(sweep->end_s, last_end_s);
      EXPECT_NEAR(sweep->end_s, 0.1 * i + (i >= 10 && i < 20 ? 0.05 : 0.1),
                  2e-4);  // bent: the sweep's middle
      last_end_s = sweep->end_s;
    }
    for (const auto& [fault, times] : queue.takeFaults(0.1 * i)) faults[fault] += times;
  }
  return faults;
}

TEST(ScanQueue, WhenPointTimesAreBadEachScanIsTakenAsItIsAndThatIsNamed) {
  const auto expectTold = [](const std::string& what, const std::function<void(Scan&, Random&)>& spoil) {
    SCOPED_TRACE(what);
    std::size_t sweeps = 0;
    const FaultCounts faults = withTimes(spoil, sweeps);
    EXPECT_EQ(sweeps, 30U);
    EXPECT_THAT(faults, ElementsAre(Pair("LiDAR lidar: " + what + ", scan taken as it is", 10U)));
  };
  const auto each = [](const std::function<float(float, Random&)>& change) {
    return [change](Scan& scan, Random& rnd) {
      for (float& t : scan.time_s) t = change(t, rnd);
    };
  };
  expectTold("no point times", [](Scan& scan, Random&) { scan.time_s.clear(); });
  expectTold("point times are all 0 s: not used", each([](float, Random&) { return 0.0F; }));
  expectTold("point times in no order: not used",
             each([](float, Random& rnd) { return static_cast<float>(rnd.uniform(0, 0.1)); }));
  expectTold("point times run backwards: not used", each([](float t, Random&) { return 0.1F - t; }));
  expectTold("point times run from 5 to 5.1 s: not used", each([](float t, Random&) { return t + 5; }));
  expectTold("point times run from 0 to 0.2997 s, longer than a sweep: not used",
             each([](float t, Random&) { return 3 * t; }));
  expectTold("point times are not all numbers: not used", each([](float, Random&) { return std::nanf(""); }));
}

TEST(ScanQueue, ScansThatAreNotLaterThanTheOneBeforeArePassedOverForATrueReason) {
  ScanQueue queue;
  std::size_t sweeps = 0;
  for (const double stamp_s : {1.0, 1.1, 1.1, 1.2, 1.15, 0.3, std::nan(""), 1.3}) {
    queue.push({stamp_s, "lidar", Pose::Identity(), {}, {}, {}});
    while (queue.popAny()) ++sweeps;
  }
  EXPECT_EQ(sweeps, 4U);
  EXPECT_THAT(queue.takeFaults(1.3),
              ElementsAre(Pair("LiDAR lidar: empty scan", 6U),
                          Pair("LiDAR lidar: stamp is no number, scan passed over", 1U),
                          Pair("LiDAR lidar: stamp repeated, scan passed over", 1U),
                          Pair("LiDAR lidar: stamp went back, scan passed over", 2U)));
  EXPECT_THAT(queue.takeFaults(1.3), IsEmpty());  // told once
}

TEST(ScanQueue, ALidarThatStaysSilentIsNamedAgainAndAgain) {
  ScanQueue queue;
  for (int i = 0; i < 5; ++i) queue.push({0.1 * i, "lidar", Pose::Identity(), {}, {}, {}});
  while (queue.popAny()) continue;
  (void)queue.takeFaults(0.5);
  EXPECT_THAT(queue.takeFaults(0.6), ElementsAre(Pair("LiDAR lidar: silent", 1U)));
  EXPECT_THAT(queue.takeFaults(0.7), ElementsAre(Pair("LiDAR lidar: silent", 1U)));
}

}  // namespace
}  // namespace raceloc
