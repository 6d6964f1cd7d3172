/** \file
 * Scans that say less than they should, or something else. */
#include <gtest/gtest.h>

#include "cloud/scan_check.h"
#include "support/room.h"

namespace raceloc {
namespace {

using test::forAll;
using test::Random;

/** A street seen by a LiDAR on a car that stands in it, a little tilted; the LiDAR believes to be at T_body_lidar. */
Scan inTheStreet(Random& rnd, const Pose& T_body_lidar, const Pose& T_body_lidar_believed) {
  const Pose T_map_body =
      poseFromRpy({rnd.uniform(-15, 15), rnd.uniform(-1, 1), rnd.uniform(0.2, 1.2)}, rnd.uniform(-0.02, 0.02),
                  rnd.uniform(-0.02, 0.02), rnd.uniform(-M_PI, M_PI));
  return {100,
          "lidar",
          T_body_lidar_believed,
          transformed(test::street(rnd, 0.01), (T_map_body * T_body_lidar).inverse()),
          {},
          {}};
}

Pose anywhereOnTheCar(Random& rnd) {
  return poseFromRpy({rnd.uniform(-1, 3), rnd.uniform(-1, 1), rnd.uniform(0.4, 2)}, rnd.uniform(-M_PI, M_PI),
                     rnd.uniform(-0.5, 0.5), rnd.uniform(-M_PI, M_PI));
}

TEST(ScanCheckProperty, TheGroundIsSeenWhereverTheLidarIsIfThatIsKnown) {
  forAll(200, [](Random& rnd) {
    const Pose T = anywhereOnTheCar(rnd);
    EXPECT_EQ(showsGround(inTheStreet(rnd, T, T)), true);
  });
}

TEST(ScanCheckProperty, ALidarThatIsUpsideDownOrOnItsSideOrTooHighShowsNoGround) {
  forAll(200, [](Random& rnd) {
    const Pose T = anywhereOnTheCar(rnd);
    const double side = rnd.oneOf({-1, 1});
    const Pose turned =
        rnd.oneOf({poseFromRpy({0, 0, 0}, M_PI, 0, 0), poseFromRpy({0, 0, 0}, side * M_PI / 2, 0, 0),
                   poseFromRpy({0, 0, 0}, 0, side * M_PI / 2, 0), poseFromRpy({0, 0, side * 4}, 0, 0, 0)});
    Pose wrong = turned * T;
    wrong.translation() = T.translation() + turned.translation();
    EXPECT_EQ(showsGround(inTheStreet(rnd, T, wrong)), false);
  });
}

TEST(ScanCheck, OfTooFewPointsNothingIsSaid) {
  Scan scan{100, "lidar", Pose::Identity(), {}, {}, {}};
  EXPECT_FALSE(showsGround(scan));
  EXPECT_FALSE(isOneRing(scan));
  for (int i = 0; i < 10; ++i) scan.cloud.push({5, static_cast<float>(i), -0.3F});
  EXPECT_FALSE(showsGround(scan));
  EXPECT_FALSE(isOneRing(scan));
}

TEST(ScanCheckProperty, OneRingIsACone) {
  forAll(100, [](Random& rnd) {
    const double elevation_rad = rnd.uniform(-0.4, 0.4), second_rad = elevation_rad + 0.01;
    Scan one{100, "lidar", Pose::Identity(), {}, {}, {}}, two = one;
    for (int i = 0; i < 300; ++i) {
      const double azimuth_rad = rnd.uniform(-M_PI, M_PI), range_m = rnd.uniform(1, 80);
      const auto seen = [&](double e) {
        return Eigen::Vector3f(Eigen::Vector3d(std::cos(e) * std::cos(azimuth_rad),
                                               std::cos(e) * std::sin(azimuth_rad), std::sin(e))
                                   .cast<float>() *
                               static_cast<float>(range_m));
      };
      one.cloud.push(seen(elevation_rad));
      two.cloud.push(seen(i % 2 == 0 ? elevation_rad : second_rad));
    }
    EXPECT_TRUE(isOneRing(one));
    EXPECT_FALSE(isOneRing(two));
  });
}

}  // namespace
}  // namespace raceloc
