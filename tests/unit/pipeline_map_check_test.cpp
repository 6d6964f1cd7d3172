/** \file
 * Maps that a car must not drive by. */
#include <gmock/gmock.h>
#include <unistd.h>

#include <filesystem>
#include <string>

#include "core/errors.h"
#include "pipeline/map_check.h"
#include "support/complaint.h"
#include "support/some_map.h"

namespace raceloc {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;

class MapCheckTest : public ::testing::Test {
 protected:
  void SetUp() override {
    path_ =
        (std::filesystem::temp_directory_path() / ("raceloc_check_" + std::to_string(getpid()) + ".rlmap"))
            .string();
    saveMap(path_, test::groundMap(32, 64, 2), {content_.info, {}});
  }
  void TearDown() override { std::filesystem::remove(path_); }
  static GpsFix fixAt(double x_m, const std::string& label) {
    return {0, label, {x_m, 0, 0}, Eigen::Matrix3d::Identity(), Eigen::Vector3d::Zero(), 4};
  }

  std::string path_;
  test::Random rnd_{7};
  MapContent content_ = test::someContent(rnd_, 32);
};

TEST_F(MapCheckTest, AnotherHashIsRefusedWithBothNamed) {
  const MapFile map(path_);
  requireHash(map, path_, "");
  requireHash(map, path_, map.contentHash());
  EXPECT_THAT(test::complaint([&] { requireHash(map, path_, "md5:0"); }),
              AllOf(HasSubstr("map " + path_), HasSubstr("content hash is " + map.contentHash()),
                    HasSubstr("asks for md5:0;")));
}

TEST_F(MapCheckTest, AMapOfAnotherPlaceIsRefused) {
  const MapFile map(path_);  // its tiles end at x = 64 m
  PlaceCheck check(map, path_, 1000);
  const auto addMore = [&](int fixes) {
    for (int i = 0; i < fixes; ++i) check.add(fixAt(5064, i % 2 == 0 ? "gps_left" : "gps_right"));
  };
  addMore(9);
  EXPECT_THAT(
      test::complaint([&] { addMore(1); }),
      AllOf(HasSubstr("map " + path_ + ": of another place"), HasSubstr("origin is 48.982000 8.390400 deg"),
            HasSubstr("gps_left is 5000 m from its nearest tile")));
}

TEST_F(MapCheckTest, OneFixOnTheMapSettlesIt) {
  const MapFile map(path_);
  PlaceCheck check(map, path_, 1000);
  for (int i = 0; i < 9; ++i) check.add(fixAt(1e6, "gps_right"));  // a receiver that lies
  check.add(fixAt(1064, "gps_left"));
  for (int i = 0; i < 20; ++i) check.add(fixAt(1e6, "gps_right"));
}

TEST_F(MapCheckTest, AMapWithoutPlaceOrPointsIsRefused) {
  content_.info.origin.reset();
  saveMap(path_, TiledMap(32), {content_.info, {}});
  const MapFile map(path_);
  EXPECT_THAT(test::complaint([&] { static_cast<void>(requireOrigin(map, path_)); }),
              HasSubstr("has no georeference"));
  EXPECT_THAT(test::complaint([&] { PlaceCheck(map, path_, 1000); }), HasSubstr("has no points"));
}

}  // namespace
}  // namespace raceloc
