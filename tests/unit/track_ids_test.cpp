/** \file
 * Racetrack IDs: the line they are counted along, the dictionary, and golden IDs of one circuit. */
#include <gmock/gmock.h>

#include <cmath>
#include <filesystem>
#include <fstream>
#include <sstream>

#include "core/errors.h"
#include "support/centre_line.h"
#include "track/circuit.h"
#include "track/driven_line.h"
#include "track/racetrack_dict.h"
#include "track/track_id.h"

namespace raceloc {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::ThrowsMessage;

std::string textOf(const std::string& path) {
  std::ostringstream text;
  text << std::ifstream(path).rdbuf();
  return text.str();
}

class DrivenLineFile : public ::testing::Test {
 protected:
  std::string write(const std::string& text) {
    std::ofstream(path) << text;
    return path;
  }
  void TearDown() override { std::filesystem::remove(path); }
  const std::string path =
      ::testing::TempDir() + ::testing::UnitTest::GetInstance()->current_test_info()->name() + ".csv";
  const std::string square = "0,0\n20,0\n40,0\n40,20\n40,40\n20,40\n0,40\n0,20\n";
};

TEST_F(DrivenLineFile, TakesTheColumnsByName) {
  const auto line = readDrivenLine(
      write("# s_m; z_m; x_m; y_m\n# a comment\n0; 5; 1; 2\n1; 5; 9; 2\n2; 5; 17; 2\n3; 5; 25; 2\n"
            "4; 5; 25; 9\n5; 5; 17; 9\n6; 5; 9; 9\n7; 5; 1; 9\n"));
  ASSERT_EQ(line.size(), 8U);
  EXPECT_EQ(line[1], Eigen::Vector3d(9, 2, 5));
}

TEST_F(DrivenLineFile, WithoutNamesTheFirstTwoAreTheCoordinatesAndARepeatedStartIsDropped) {
  EXPECT_EQ(readDrivenLine(write(square)).size(), 8U);
  EXPECT_EQ(readDrivenLine(write(square + "0,0\n")).size(), 8U);
  EXPECT_EQ(readDrivenLine(write("\xEF\xBB\xBF" + square)).size(), 8U);  // a byte-order mark
}

TEST_F(DrivenLineFile, SaysWhatIsWrongAndWhere) {
  const auto refuses = [&](const std::string& text, const std::string& why) {
    write(text);
    EXPECT_THAT([&] { (void)readDrivenLine(path); }, ThrowsMessage<InputError>(HasSubstr(why)));
  };
  refuses("0,0\n1,1\n", "2 points, but a racing line needs at least 8");
  refuses("x_m,y_m\n" + square + "0,abc\n", "line 10: no x_m and y_m in it: 0,abc");
  refuses("s_m,x_m,y_m\n1,2\n", "line 2: no x_m and y_m in it");
  refuses(square + "900,0\n", "line 9: 900.222195 m from the point before");
  refuses("0,0\n20,0\n40,0\n60,0\n80,0\n100,0\n120,0\n140,0\n", "does not close: its end is 140.0");
  EXPECT_THAT([] { (void)readDrivenLine("/nowhere.csv"); },
              ThrowsMessage<InputError>(HasSubstr("/nowhere.csv: cannot be read")));
}

TEST(WayPoints, AreEvenlySpacedWithTheCourseOfTheLine) {
  const auto way_points = wayPointsAlong({{0, 0, 0}, {100, 0, 0}, {100, 100, 0}, {0, 100, 0}}, 9.9);
  ASSERT_EQ(way_points.size(), 40U);
  EXPECT_EQ(way_points[3].p_map_m, Eigen::Vector3d(30, 0, 0));
  EXPECT_DOUBLE_EQ(way_points[3].heading_rad, 0);
  EXPECT_NEAR(way_points[10].heading_rad, M_PI / 4, 1e-12);
  EXPECT_NEAR(way_points[15].heading_rad, M_PI / 2, 1e-12);
}

TEST(WayPoints, RefuseWhatIsNoLine) {
  const std::vector<Eigen::Vector3d> triangle{{0, 0, 0}, {9, 0, 0}, {0, 9, 0}};
  EXPECT_THROW((void)wayPointsAlong({{0, 0, 0}, {9, 0, 0}}, 1), std::invalid_argument);
  EXPECT_THROW((void)wayPointsAlong(triangle, 0), std::invalid_argument);
  EXPECT_THROW((void)wayPointsAlong({{0, 0, 0}, {NAN, 0, 0}, {0, 9, 0}}, 1), std::invalid_argument);
  EXPECT_THROW(TrackIds({}, {}), std::invalid_argument);
}

TEST(TrackIds, APoseThatIsNowhereHasNone) {
  const TrackIds ids(wayPointsAlong({{0, 0, 0}, {100, 0, 0}, {100, 100, 0}, {0, 100, 0}}, 5), {});
  EXPECT_EQ(ids.idAt(poseFromRpy({50, 11, 0}, 0, 0, 0)), 10);
  EXPECT_EQ(ids.idAt(poseFromRpy({50, 13, 0}, 0, 0, 0)), std::nullopt);    // the pit lane
  EXPECT_EQ(ids.idAt(poseFromRpy({50, 1, 0}, 0, 0, M_PI)), std::nullopt);  // against the direction
  EXPECT_EQ(ids.idAt(poseFromRpy({NAN, 1, 0}, 0, 0, 0)), std::nullopt);
  EXPECT_EQ(ids.idAt(poseFromRpy({1e300, 1, 0}, 0, 0, 0)), std::nullopt);
}

/** What the dictionary makes of IDs, one key pose after the other. */
std::vector<int> lapsOf(const std::vector<int>& ids) {
  RacetrackDict dict(100);
  for (const int id : ids) {
    const auto key = static_cast<std::uint32_t>(dict.entries().size());
    dict.add({key, key}, id, 0);
  }
  std::vector<int> laps;
  for (const auto& entry : dict.entries()) laps.push_back(entry.lap);
  return laps;
}

TEST(RacetrackDict, CountsLapsAtTheFirstWayPoint) {
  EXPECT_THAT(lapsOf({90, 30, 60, 95, 10}), ElementsAre(0, 1, 1, 1, 2));
  EXPECT_THAT(lapsOf({98, 99, 0, 99, 0, 0, 1}), ElementsAre(0, 0, 1, 0, 1, 1, 1));  // jitter at the line
  EXPECT_THAT(lapsOf({0, 99, 0}), ElementsAre(0, -1, 0));                           // backs over it
}

TEST(RacetrackDict, GoesBothWaysAndBeginsEachSessionAnew) {
  RacetrackDict dict(100);
  dict.add({5, 7}, 99, 0);
  dict.add({6, 8}, 0, 0);
  dict.add({0, 9}, 0, 1);
  EXPECT_EQ(dict.id({5, 7}), 99);
  EXPECT_EQ(dict.id({7, 5}), std::nullopt);
  EXPECT_THAT(dict.passages(0), ElementsAre(1, 2));
  EXPECT_THAT(dict.passages(100), ElementsAre(1, 2));
  EXPECT_THAT(dict.passages(-1), ElementsAre(0));
  EXPECT_EQ(dict.entries()[1].lap, 1);
  EXPECT_EQ(dict.entries()[2].lap, 0);
  EXPECT_TRUE(dict.samePass(0, 1));
  EXPECT_FALSE(dict.samePass(1, 2));
}

TEST(RacetrackDict, RefusesWhatCannotBe) {
  RacetrackDict dict(100);
  dict.add({5, 7}, 99, 1);
  EXPECT_THROW(dict.add({5, 7}, 98, 1), std::invalid_argument);
  EXPECT_THROW(dict.add({6, 8}, 100, 1), std::invalid_argument);
  EXPECT_THROW(dict.add({6, 8}, -1, 1), std::invalid_argument);
  EXPECT_THROW(dict.add({6, 8}, 1, 0), std::invalid_argument);
  EXPECT_EQ(dict.entries().size(), 1U);
  EXPECT_THROW(RacetrackDict(0), std::invalid_argument);
  EXPECT_THROW(RacetrackDict(100, {{{1, 1}, 5, 0, 3}}), std::invalid_argument);
}

/** Poses every 37 m round the course like Monza, 3 m left and 3 m right of the centre line by turns: station, ID, and
 * where that way-point is [dm]. Saved maps are keyed by these: a change of the file says why. */
TEST(TrackIdsGolden, MonzaLikeKeepsItsIds) {
  const Track track = readCircuit(RACELOC_ROOT "/share/tracks/monza_like.ini").track;
  const TrackIds ids(wayPointsAlong(test::centreLine(track, 2), TrackIdOptions{}.spacing_m), {});
  std::ostringstream text;
  text << ids.count() << " way-points\n";
  for (int k = 0; 37 * k < track.length_m(); ++k) {
    const auto id = ids.idAt(track.surface(37 * k, k % 2 == 0 ? 3 : -3).T_map_surface);
    ASSERT_TRUE(id);
    const Eigen::Vector3d p_dm = 10 * ids.wayPoints()[static_cast<std::size_t>(*id)].p_map_m;
    text << 37 * k << " " << *id << " " << std::lround(p_dm.x()) << " " << std::lround(p_dm.y()) << "\n";
  }
  EXPECT_EQ(text.str(), textOf(RACELOC_ROOT "/tests/golden/monza_like_track_ids.txt"));
}

}  // namespace
}  // namespace raceloc
