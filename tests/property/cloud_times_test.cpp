/** \file
 * Point times: what LiDARs give is believed, what no LiDAR gives is not. */
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

#include "cloud/point_times.h"
#include "support/forall.h"

namespace raceloc {
namespace {

using test::forAll;
using test::Random;

constexpr double kPeriod_s = 0.1;

/** How a scan is stored. */
enum class Storage { by_column, by_ring, shuffled };

/** A spinning LiDAR, or a part of its turn, with some returns lost; lasers of a column fire one after the other. */
Scan spinning(Random& rnd, Storage storage, bool with_rings) {
  const double first_rad = rnd.uniform(-M_PI, M_PI), turn_rad = rnd.oneOf({2 * M_PI, 2.1, -2 * M_PI, -2.1});
  const int rings = rnd.oneOf({4, 16, 64}), columns = rnd.oneOf({60, 500, 1000});
  struct Return {
    Eigen::Vector3f p_m;
    float time_s, ring;
  };
  std::vector<Return> returns;
  for (int column = 0; column < columns; ++column)
    for (int ring = 0; ring < rings; ++ring) {
      if (rnd.uniform(0, 1) < 0.2) continue;
      const double share = (column + static_cast<double>(ring) / rings) / columns;
      const double azimuth_rad =
          first_rad + turn_rad * column / columns;  // as a driver tells it: of the column
      const double range_m = rnd.uniform(3, 60);
      returns.push_back({Eigen::Vector3d(range_m * std::cos(azimuth_rad), range_m * std::sin(azimuth_rad),
                                         range_m * 0.01 * ring)
                             .cast<float>(),
                         static_cast<float>(share * kPeriod_s), static_cast<float>(ring)});
    }
  if (storage == Storage::by_ring)
    std::stable_sort(returns.begin(), returns.end(),
                     [](const Return& a, const Return& b) { return a.ring < b.ring; });
  if (storage == Storage::shuffled)
    for (std::size_t i = returns.size(); i > 1; --i)
      std::swap(returns[i - 1], returns[static_cast<std::size_t>(rnd.integer(0, static_cast<int>(i) - 1))]);
  Scan scan{100, "lidar", Pose::Identity(), {}, {}, {}};
  for (const Return& r : returns) {
    scan.cloud.push(r.p_m);
    scan.time_s.push_back(r.time_s);
    if (with_rings) scan.ring.push_back(r.ring);
  }
  return scan;
}

Scan anySpinning(Random& rnd) {
  return spinning(rnd, rnd.oneOf({Storage::by_column, Storage::by_ring, Storage::shuffled}),
                  rnd.oneOf({true, false}));
}

/** A pattern that crosses itself and never repeats, stored as it was drawn. */
Scan rosette(Random& rnd) {
  Scan scan{100, "lidar", Pose::Identity(), {}, {}, {}};
  const double a = rnd.uniform(500, 900), b = rnd.uniform(200, 400);
  for (int i = 0; i < 20000; ++i) {
    const double time_s = kPeriod_s * i / 20000, yaw_rad = 0.5 * std::sin(a * time_s);
    scan.cloud.push(Eigen::Vector3d(20, 20 * yaw_rad, 5 * std::cos(b * time_s)).cast<float>());
    scan.time_s.push_back(static_cast<float>(time_s));
  }
  return scan;
}

TEST(PointTimesProperty, OfLidarsAreGoodHoweverTheirPointsAreStored) {
  forAll(100, [](Random& rnd) {
    for (const Storage storage : {Storage::by_column, Storage::by_ring, Storage::shuffled})
      for (const bool with_rings : {true, false}) {
        const auto verdict = checkPointTimes(spinning(rnd, storage, with_rings), kPeriod_s);
        EXPECT_EQ(verdict.kind, PointTimes::good) << verdict.text << static_cast<int>(storage) << with_rings;
      }
    EXPECT_EQ(checkPointTimes(rosette(rnd), kPeriod_s).kind, PointTimes::good);
  });
}

TEST(PointTimesProperty, AtRandomAreFound) {
  forAll(100, [](Random& rnd) {
    Scan scan = anySpinning(rnd);
    const double share = rnd.oneOf({1.0, 0.4});
    for (float& t : scan.time_s)
      if (rnd.uniform(0, 1) < share) t = static_cast<float>(rnd.uniform(0, kPeriod_s));
    EXPECT_EQ(checkPointTimes(scan, kPeriod_s).kind, PointTimes::unordered);
  });
}

TEST(PointTimesProperty, BeyondASweepAreFound) {
  forAll(50, [](Random& rnd) {
    const Scan good = anySpinning(rnd);
    const auto changed = [&](float factor, float added_s) {
      Scan scan = good;
      for (float& t : scan.time_s) t = added_s + factor * t;
      return checkPointTimes(scan, kPeriod_s);
    };
    EXPECT_EQ(changed(1e3F, 0).kind, PointTimes::not_seconds);    // milliseconds
    EXPECT_EQ(changed(1, 1.3e9F).kind, PointTimes::not_seconds);  // stamps
    EXPECT_EQ(changed(1, -0.1F).kind, PointTimes::not_seconds);   // since the end
    EXPECT_EQ(changed(7, 0).kind, PointTimes::too_long);          // longer than any sweep
    EXPECT_EQ(changed(2, 0).kind, PointTimes::too_long);          // longer than until the next scan
    EXPECT_EQ(changed(0, 0.05F).kind, PointTimes::all_equal);
    EXPECT_EQ(changed(1e-4F, 0).kind, PointTimes::all_equal);
    EXPECT_EQ(changed(1, 0.1F).kind, PointTimes::good);  // late by a period: who knows
  });
}

TEST(PointTimesProperty, BackwardsAreFoundOnceTheLidarIsKnown) {
  forAll(50, [](Random& rnd) {
    Scan scan = spinning(rnd, rnd.oneOf({Storage::by_column, Storage::by_ring}), true);
    const auto before = checkPointTimes(scan, kPeriod_s);
    ASSERT_TRUE(before.ascending);
    for (float& t : scan.time_s) t = static_cast<float>(kPeriod_s) - t;
    EXPECT_EQ(checkPointTimes(scan, kPeriod_s, before.ascending).kind, PointTimes::backwards);
    EXPECT_EQ(checkPointTimes(scan, kPeriod_s).kind, PointTimes::good);  // nothing to compare with
  });
}

TEST(PointTimes, ThatAreNoNumbersOrNotOnePerPointAreNamed) {
  Random rnd(1);
  Scan scan = anySpinning(rnd);
  scan.time_s[7] = std::numeric_limits<float>::quiet_NaN();
  EXPECT_EQ(checkPointTimes(scan).kind, PointTimes::not_seconds);
  scan.time_s.resize(10);
  EXPECT_EQ(checkPointTimes(scan).kind, PointTimes::not_seconds);
  scan.time_s.clear();
  EXPECT_EQ(checkPointTimes(scan).kind, PointTimes::absent);
}

TEST(PointTimes, OfAFewPointsMayBeEqual) {
  Scan scan{100, "lidar", Pose::Identity(), {}, std::vector<float>(5, 0.05F), {}};
  for (int i = 0; i < 5; ++i) scan.cloud.push({10, 0, static_cast<float>(i)});
  EXPECT_EQ(checkPointTimes(scan, kPeriod_s).kind, PointTimes::good);
}

}  // namespace
}  // namespace raceloc
