/** \file
 * Samples in order of time: one clock that runs ahead does not make the others late. */
#include <gmock/gmock.h>

#include <algorithm>
#include <cmath>

#include "sensors/sample_order.h"
#include "support/forall.h"

namespace raceloc {
namespace {

using test::forAll;
using test::Random;
using ::testing::ElementsAre;
using ::testing::IsEmpty;
using ::testing::Pair;

constexpr double kWindow_s = 0.5, kStart_s = 1e9;

/** A sample and when it comes. */
struct Arrival {
  double at_s;
  Sample sample;
};

Sample gps(double stamp_s) {
  return GpsFix{stamp_s, "gps", Eigen::Vector3d::Zero(), Eigen::Matrix3d::Identity(), Eigen::Vector3d::Zero(),
                4};
}
Sample imu(double stamp_s) {
  return ImuSample{stamp_s, "imu", Eigen::Vector3d::Zero(), Eigen::Vector3d::Zero(), Eigen::Vector3d::Zero()};
}
Sample scan(double stamp_s) { return Scan{stamp_s, "lidar", Pose::Identity(), {}, {}, {}}; }

/** What a recorder gets of a drive: sweeps come when they are over, all a little late. */
std::vector<Arrival> drive(Random& rnd, double duration_s) {
  struct Device {
    Sample (*sample)(double);
    double period_s, delay_s;
  };
  std::vector<Arrival> arrivals;
  for (const Device& device : {Device{gps, 0.05, 0.03}, {imu, 0.01, 0.002}, {scan, 0.1, 0.12}})
    for (double t_s = rnd.uniform(0, device.period_s); t_s < duration_s; t_s += device.period_s)
      arrivals.push_back(
          {kStart_s + t_s + device.delay_s + rnd.uniform(0, 0.05), device.sample(kStart_s + t_s)});
  std::sort(arrivals.begin(), arrivals.end(),
            [](const Arrival& a, const Arrival& b) { return a.at_s < b.at_s; });
  return arrivals;
}

double& stampOf(Sample& sample) {
  return std::visit([](auto& s) -> double& { return s.stamp_s; }, sample);
}

/** All that comes out, which must be in order. */
std::vector<Sample> through(SampleOrder& order, const std::vector<Arrival>& arrivals) {
  std::vector<Sample> out;
  const auto take = [&] {
    while (auto sample = order.next()) {
      if (!out.empty()) {
        EXPECT_LE(stampOf(out.back()), stampOf(*sample));
      }
      out.push_back(std::move(*sample));
    }
  };
  for (const Arrival& arrival : arrivals) {
    order.add(arrival.sample);
    take();
  }
  order.end();
  take();
  return out;
}

/** The n-th GPS fix of a drive, the first one is 0. */
Arrival& fix(std::vector<Arrival>& arrivals, int n) {
  return *std::find_if(arrivals.begin(), arrivals.end(), [&](const Arrival& a) {
    return std::holds_alternative<GpsFix>(a.sample) && n-- == 0;
  });
}

TEST(SampleOrderProperty, AFixWhoseStampLeapsIsLeftOutAndNothingElse) {
  forAll(100, [](Random& rnd) {
    auto arrivals = drive(rnd, 5);
    stampOf(fix(arrivals, rnd.oneOf({0, 1, 50, 90})).sample) += rnd.oneOf({1.0, 10.0, 1e5, 1e9});
    SampleOrder order(kWindow_s);
    EXPECT_EQ(through(order, arrivals).size(), arrivals.size() - 1);
    EXPECT_EQ(order.droppedLate(), 0U);
    EXPECT_THAT(order.leftOut(), ElementsAre(Pair("gps", 1)));
  });
}

TEST(SampleOrderProperty, AReceiverWhoseClockLeapsForAWhileIsLeftOutAlone) {
  forAll(50, [](Random& rnd) {
    auto arrivals = drive(rnd, 5);
    const double leap_s = rnd.oneOf({1.0, 10.0, 1e5});
    for (int n = 20; n < 90; ++n) stampOf(fix(arrivals, n).sample) += leap_s;
    SampleOrder order(kWindow_s);
    EXPECT_EQ(through(order, arrivals).size(), arrivals.size() - 70);
    EXPECT_EQ(order.droppedLate(), 0U);
    EXPECT_THAT(order.leftOut(), ElementsAre(Pair("gps", 70)));
  });
}

TEST(SampleOrderProperty, AStampThatIsAheadByLessMakesNothingLate) {
  forAll(100, [](Random& rnd) {
    auto arrivals = drive(rnd, 5);
    const double ahead_s = rnd.uniform(0, 0.75);
    const int end = rnd.oneOf({21, 80});  // a second before the drive's end, after which none comes near
    for (int n = 20; n < end; ++n) stampOf(fix(arrivals, n).sample) += ahead_s;
    SampleOrder order(kWindow_s);
    EXPECT_EQ(through(order, arrivals).size(), arrivals.size());
    EXPECT_EQ(order.droppedLate(), 0U);
  });
}

TEST(SampleOrderProperty, AGapInTheRecordingLosesNothing) {
  forAll(100, [](Random& rnd) {
    auto arrivals = drive(rnd, 5);
    const double gap_s = rnd.oneOf({0.3, 1.0, 60.0, 1e5});
    for (Arrival& arrival : arrivals)
      if (stampOf(arrival.sample) > kStart_s + 2) {
        stampOf(arrival.sample) += gap_s;
        arrival.at_s += gap_s;
      }
    std::sort(arrivals.begin(), arrivals.end(),
              [](const Arrival& a, const Arrival& b) { return a.at_s < b.at_s; });
    SampleOrder order(kWindow_s);
    EXPECT_EQ(through(order, arrivals).size(), arrivals.size());
    EXPECT_EQ(order.droppedLate(), 0U);
    EXPECT_THAT(order.leftOut(), IsEmpty());
  });
}

TEST(SampleOrderProperty, OneDeviceAloneLosesNothingAndHoldsLittle) {
  forAll(50, [](Random& rnd) {
    SampleOrder order(kWindow_s);
    const double period_s = rnd.oneOf({0.1, 0.3, 1.0, 10.0});
    double stamp_s = kStart_s;
    std::size_t out = 0;
    for (std::size_t n = 1; n <= 200; ++n) {
      stamp_s += n == 100 ? 60 : period_s;
      order.add(scan(stamp_s));
      while (order.next()) ++out;
      EXPECT_LE(n - out, 16U);  // the window and a leap, at ten a second
    }
    order.end();
    while (order.next()) ++out;
    EXPECT_EQ(out, 200U);
  });
}

TEST(SampleOrderProperty, StampsThatStandStillAreBounded) {
  SampleOrder order(kWindow_s);
  std::size_t out = 0, held = 0;
  for (std::size_t n = 1; n <= 50'000; ++n) {
    order.add(imu(n < 25'000 ? kStart_s : kStart_s + 10));
    while (order.next()) ++out;
    held = std::max(held, n - out);
  }
  EXPECT_LE(held, 40'010U);
}

TEST(SampleOrder, WhatIsLatePassesWhereAReaderCanPlaceIt) {
  SampleOrder order(0.05, Late::passed);
  std::vector<std::string> labels;
  const auto take = [&] {
    while (const auto sample = order.next()) labels.push_back(labelOf(*sample));
  };
  std::vector<Sample> samples;
  for (const double t_s : {0.0, 0.1, 0.2, 0.3, 0.4}) samples.push_back(imu(kStart_s + t_s));
  samples.push_back(gps(kStart_s + 0.25));  // 0.3 s has gone out
  samples.push_back(scan(kStart_s + 0.22));
  samples.push_back(imu(kStart_s + 0.24));
  for (const Sample& sample : samples) {
    order.add(sample);
    take();
  }
  order.end();
  take();
  EXPECT_THAT(labels, ElementsAre("imu", "imu", "imu", "imu", "gps", "lidar", "imu"));
  EXPECT_EQ(order.droppedLate(), 1U);  // motion is wanted in order
}

}  // namespace
}  // namespace raceloc
