/** \file
 * A drive whose scans are spoilt: given ..., when ..., then it is followed by what is left, and what is wrong is
 * named. */
#include <gmock/gmock.h>
#include <mrpt/io/CFileGZInputStream.h>
#include <mrpt/io/CFileGZOutputStream.h>
#include <mrpt/maps/CColouredPointsMap.h>
#include <mrpt/maps/registerAllClasses.h>
#include <mrpt/obs/CObservationPointCloud.h>
#include <mrpt/serialization/CArchive.h>

#include <cmath>
#include <functional>
#include <nlohmann/json.hpp>

#include "apps/apps.h"

namespace {

using namespace raceloc::test;
using mrpt::maps::CColouredPointsMap;
using mrpt::obs::CObservationPointCloud;
using ::testing::HasSubstr;
using ::testing::Not;

const DriveFiles kDrive("synthetic");
constexpr double kTolerance_m = 0.2;  // as of the drive that is not spoilt, synthetic_drive_test.cpp

/** What becomes of the scan of this number: it is written so many times. */
using Spoil = std::function<int(CObservationPointCloud&, int)>;

/** A point of a scan as it is stored: channels are intensity, ring / 255, time. */
struct Point {
  float x, y, z, r, g, b;
};
void keep(
    CObservationPointCloud& scan, const std::function<bool(const Point&)>& wanted,
    const std::function<void(Point&)>& change = [](Point&) {}) {
  const auto& all = dynamic_cast<const CColouredPointsMap&>(*scan.pointcloud);
  auto kept = CColouredPointsMap::Create();
  for (std::size_t i = 0; i < all.size(); ++i) {
    Point p{};
    all.getPointRGB(i, p.x, p.y, p.z, p.r, p.g, p.b);
    if (!wanted(p)) continue;
    change(p);
    kept->insertPointFast(p.x, p.y, p.z);
    kept->setPointColor_fast(kept->size() - 1, p.r, p.g, p.b);
  }
  scan.pointcloud = kept;
}

struct Driven {
  std::string said;
  double rmse_m, length_m;
};

class BadScans : public ::testing::Test {
 protected:
  [[nodiscard]] std::string spoilt(const Spoil& spoil) const {
    mrpt::maps::registerAllClasses_mrpt_maps();
    const auto path = folder_ / "spoilt.rawlog";
    mrpt::io::CFileGZInputStream all(kDrive.race());
    mrpt::io::CFileGZOutputStream kept(path);
    auto from = mrpt::serialization::archiveFrom(all);
    auto to = mrpt::serialization::archiveFrom(kept);
    int number = 0;
    try {
      for (;;) {
        const auto object = from.ReadObject();
        const auto scan = std::dynamic_pointer_cast<CObservationPointCloud>(object);
        const int times = scan ? spoil(*scan, number++) : 1;
        for (int i = 0; i < times; ++i) to << *object;
      }
    } catch (const mrpt::serialization::CExceptionEOF&) {
    }
    return path;
  }

  [[nodiscard]] Driven drive(const Spoil& spoil) const {
    const auto live = runCommand({app("raceloc-live"), "-c", ini("live.ini"), "--odometry-only", "-i",
                                  spoilt(spoil), "--trajectory", folder_ / "odometry.tum"});
    EXPECT_EQ(live.exit_code, 0) << live.err;
    const auto eval =
        runCommand({app("raceloc-eval"), "--align", "se3", "--truth", kDrive.truth(), "--estimate",
                    folder_ / "odometry.tum", "--json", folder_ / "figures.json"});
    EXPECT_EQ(eval.exit_code, 0) << eval.err;
    const auto figures = nlohmann::json::parse(readFile(folder_ / "figures.json"));
    const auto comma = live.out.find(" s, ", live.out.find("recording"));
    return {live.out, figures.at("errors").at("position_3d_m").at("rmse"),
            std::stod(live.out.substr(comma + 4))};
  }

  TemporaryFolder folder_;
};

bool fromTenTo(int last, int number) { return number >= 10 && number < last; }

TEST_F(BadScans, WhenNothingIsWrongNothingIsNamed) {
  EXPECT_THAT(drive([](CObservationPointCloud&, int) { return 1; }).said, Not(HasSubstr("DEGRADED")));
}

TEST_F(BadScans, WhenScansAreEmpty) {
  const Driven run = drive([](CObservationPointCloud& scan, int number) {
    if (fromTenTo(15, number)) scan.pointcloud = CColouredPointsMap::Create();
    return 1;
  });
  EXPECT_LT(run.rmse_m, kTolerance_m);
  EXPECT_THAT(run.said, HasSubstr("DEGRADED         LiDAR lidar_top: empty scan (5 times)"));
  EXPECT_THAT(run.said, HasSubstr(" 40 scans (35 trusted"));
}

TEST_F(BadScans, WhenScansHaveOneRing) {
  const double kBeam_rad = (4 - 10 * 28.0 / 31) * M_PI / 180;  // the eleventh from above
  const Driven run = drive([&](CObservationPointCloud& scan, int number) {
    if (fromTenTo(20, number))
      keep(scan, [&](const Point& p) {
        return std::abs(std::atan2(p.z, std::hypot(p.x, p.y)) - kBeam_rad) < 0.002;
      });
    return 1;
  });
  EXPECT_LT(run.rmse_m, 0.5);  // 2 s by gyro and wheels, and a line of points
  EXPECT_THAT(
      run.said,
      HasSubstr("DEGRADED         LiDAR lidar_top: all points in one ring, height, roll and pitch are "
                "not seen (10 times)"));
}

TEST_F(BadScans, WhenScansComeTwice) {
  const Driven run = drive([](CObservationPointCloud&, int number) { return fromTenTo(15, number) ? 2 : 1; });
  EXPECT_LT(run.rmse_m, kTolerance_m);
  EXPECT_THAT(run.said, HasSubstr("LiDAR lidar_top: stamp repeated, scan passed over (5 times)"));
}

TEST_F(BadScans, WhenStampsGoBack) {
  std::vector<mrpt::system::TTimeStamp> stamps;
  const Driven run = drive([&](CObservationPointCloud& scan, int number) {
    stamps.push_back(scan.timestamp);
    if (fromTenTo(15, number)) scan.timestamp = stamps[5] + std::chrono::milliseconds(10 * number);
    return 1;
  });
  EXPECT_LT(run.rmse_m, kTolerance_m);
  EXPECT_THAT(run.said, HasSubstr("LiDAR lidar_top: stamp went back, scan passed over (5 times)"));
}

TEST_F(BadScans, WhenTheStampStandsStill) {
  std::optional<mrpt::system::TTimeStamp> first;
  const auto stop = [&](CObservationPointCloud& scan, int number) {
    if (!first) first = scan.timestamp;
    if (number > 0) scan.timestamp = *first;
    return 1;
  };
  const auto map =
      runCommand({app("raceloc-map"), "-c", ini("map.ini"), "-o", folder_ / "map.rlmap", spoilt(stop)});
  EXPECT_EQ(map.exit_code, 2);
  EXPECT_THAT(map.err, HasSubstr("key pose"));
  EXPECT_THAT(map.err, ::testing::AnyOf(HasSubstr("stamp repeated"), HasSubstr("silent"))) << map.err;
}

TEST_F(BadScans, WhenTheExtrinsicsAreUpsideDown) {
  const Driven run = drive([](CObservationPointCloud& scan, int) {
    scan.sensorPose = scan.sensorPose + mrpt::poses::CPose3D(0, 0, 0, 0, 0, M_PI);
    return 1;
  });
  EXPECT_THAT(run.said,
              HasSubstr("LiDAR lidar_top: no ground below the car, check its extrinsics (36 times)"));
  EXPECT_NEAR(run.length_m, 94, 5);  // no standstill
}

TEST_F(BadScans, WhenPointTimesAreNotSecondsSinceTheStamp) {
  const Driven run = drive([](CObservationPointCloud& scan, int number) {
    if (fromTenTo(20, number))
      keep(
          scan, [](const Point&) { return true; }, [](Point& p) { p.b = 1000 * p.b; });
    return 1;
  });
  EXPECT_LT(run.rmse_m, kTolerance_m);
  EXPECT_THAT(run.said,
              ::testing::ContainsRegex(
                  "LiDAR lidar_top: point times run from .* s: not used, scan taken as it is .10 times"));
}

TEST_F(BadScans, WhenNoPointTimesAreThereAnyMore) {
  const Driven run = drive([](CObservationPointCloud& scan, int number) {
    if (number >= 10)
      keep(
          scan, [](const Point&) { return true; }, [](Point& p) { p.b = -1; });
    return 1;
  });
  EXPECT_LT(run.rmse_m, kTolerance_m);
  EXPECT_THAT(run.said, HasSubstr("LiDAR lidar_top: no point times, scan taken as it is (30 times)"));
}

}  // namespace
