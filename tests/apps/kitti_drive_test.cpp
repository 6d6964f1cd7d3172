/** \file
 * The same on a real recording: KITTI's drive 2011_09_26_0013, mapped with the even scans, driven with the
 * odd ones. The truth is KITTI's INS, good to decimetres; hence 0.5 m. */
#include <gmock/gmock.h>

#include "apps/localize.h"

namespace {

using namespace raceloc::test;

constexpr double kTolerance_m = 0.5;

class KittiDrive : public ::testing::Test {
 protected:
  void SetUp() override {
    if (!std::filesystem::exists(drive.map()))
      GTEST_SKIP() << "the recording ../shared/data/kitti_raw_0013 is not beside this checkout";
  }
  const DriveFiles drive{"kitti"};
  TemporaryFolder out, other_out;
};

TEST_F(KittiDrive, IsFollowedWithGpsAndLidar) {
  const auto run = localize(drive, drive.race(), out);
  EXPECT_LT(run.rmse_m, kTolerance_m);
  EXPECT_GT(run.match_share, 0.9);
  EXPECT_GT(run.covered_s, 13);  // of 14.9 s
}

TEST_F(KittiDrive, IsFollowedWithoutGps) {
  const auto run = localize(drive, drive.race(), out, {"--disable", "gps_*"});
  EXPECT_LT(run.rmse_m, kTolerance_m);
  EXPECT_GT(run.covered_s, 13);
}

TEST_F(KittiDrive, BadGpsIsRejected) {
  const auto clean = localize(drive, drive.race(), out);
  const auto noisy = localize(drive, drive.noisyRace(), other_out);
  EXPECT_LT(noisy.rmse_m, 1.2 * clean.rmse_m);
}

}  // namespace
