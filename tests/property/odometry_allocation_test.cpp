/** \file
 * Odometry allocates nothing once it is warm, from the points of a scan to its step. A program of its own: it replaces
 * malloc, which `new` and Eigen call as well. */
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "odometry/odometry_stream.h"
#include "support/counted_malloc.h"
#include "support/plain_car.h"
#include "support/room.h"

namespace raceloc {
namespace {

using test::Random;
using ::testing::IsEmpty;

constexpr double kPeriod_s = 0.1, kSample_s = 0.01, kRound_s = 6;
constexpr double kSpeed_mps = 5, kYawRate_rps = 2 * M_PI / kRound_s;

/** A car that drives round after round in a circle of 5 m: in the second one it sees nothing new. */
Pose poseAt(double stamp_s) { return arc(kSpeed_mps * stamp_s, kYawRate_rps * stamp_s); }

/** What one LiDAR of a car sees of a street in a sweep. */
Scan sweepOfStreet(Random& rnd, const std::string& label, double stamp_s) {
  const Cloud street = test::street(rnd, 0.01);
  Scan scan{stamp_s, label, Pose::Identity(), {}, {}, {}};
  for (std::size_t i = 0; i < street.size(); ++i) {
    const double time_s = kPeriod_s * static_cast<double>(i) / static_cast<double>(street.size());
    scan.cloud.push((poseAt(stamp_s + time_s).inverse() * street.point(i).cast<double>()).cast<float>());
    scan.time_s.push_back(static_cast<float>(time_s));
  }
  return scan;
}

/** The first round, of scans in order of time, as the n-th one: with all other samples between them. */
std::vector<Sample> asRound(int n, const std::vector<Scan>& scans) {
  std::vector<Sample> samples;
  const double begin_s = n * kRound_s;
  auto scan = scans.begin();
  for (int i = 0; i < kRound_s / kSample_s; ++i) {
    const double stamp_s = begin_s + kSample_s * i;
    const double changing = 1e-9 * i;  // what repeats itself is taken for frozen
    samples.emplace_back(ImuSample{stamp_s,
                                   "imu",
                                   {0, 0, kYawRate_rps + changing},
                                   {0, kSpeed_mps * kYawRate_rps, 9.81 + changing},
                                   {0, 0, 0}});
    samples.emplace_back(MotionSample{stamp_s, "vehicle", kSpeed_mps + changing, kYawRate_rps});
    for (; scan != scans.end() && begin_s + scan->stamp_s < stamp_s + kSample_s; ++scan) {
      samples.emplace_back(*scan);
      std::get<Scan>(samples.back()).stamp_s += begin_s;
    }
  }
  return samples;
}

class AllocationOfOdometry : public ::testing::TestWithParam<std::vector<std::string>> {};

TEST_P(AllocationOfOdometry, IsNoneOnceItIsWarm) {
#ifdef RACELOC_OTHER_MALLOC
  GTEST_SKIP() << "malloc is the sanitizer's";
#endif
  Random rnd(1);
  std::vector<Scan> scans;
  for (int i = 0; i < kRound_s / kPeriod_s; ++i)
    for (std::size_t k = 0; k < GetParam().size(); ++k)
      scans.push_back(sweepOfStreet(rnd, GetParam()[k], kPeriod_s * (i + static_cast<double>(k) / 3)));

  gpu::Context context(gpu::Backend::cpu);
  OdometryStream stream(MotionHistory(test::plainMotion(), test::plainCalibration()),
                        LivOdometry(context, {}, {0, 60, 0, 0, 0}, {}, {}), ScanQueue(GetParam()));
  int steps = 0, trusted = 0;
  const auto take = [&](const OdometryStep& step) {
    ++steps;
    trusted += step.trusted ? 1 : 0;
  };
  constexpr int kWarm = 2;  // rounds: the local map and all buffers have their size
  for (int n = 0; n < kWarm; ++n)
    for (Sample& sample : asRound(n, scans)) stream.add(std::move(sample), take);
  std::vector<Sample> round = asRound(kWarm, scans);
  steps = trusted = 0;
  const long before = allocations;
  for (Sample& sample : round) stream.add(std::move(sample), take);
  EXPECT_EQ(allocations - before, 0);
  EXPECT_GT(before, 0);
  EXPECT_EQ(steps, kRound_s / kPeriod_s);
  EXPECT_EQ(trusted, steps);
  EXPECT_THAT(stream.tally().faults, IsEmpty());  // to name one allocates
}

INSTANTIATE_TEST_SUITE_P(Lidars, AllocationOfOdometry,
                         ::testing::Values(std::vector<std::string>{"lidar"},
                                           std::vector<std::string>{"lidar_left", "lidar_right"}));

}  // namespace
}  // namespace raceloc
