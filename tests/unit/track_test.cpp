/** \file
 * libs/track against circles and stadiums known in closed form, the shipped circuits, real centre lines, bad input. */
#include "track/track.h"

#include <gmock/gmock.h>
#include <unistd.h>

#include <cmath>
#include <filesystem>
#include <fstream>
#include <sstream>
#include <stdexcept>
#include <string>
#include <vector>

#include "core/errors.h"
#include "track/circuit.h"
#include "track/periodic_spline.h"

namespace raceloc {
namespace {

namespace fs = std::filesystem;
using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::SizeIs;

const fs::path kRoot = RACELOC_ROOT;
const fs::path kCentreLines = kRoot / "../shared/data/tracks";

/** Points on a level circle to the left about (0, radius), from the origin on. */
std::vector<TrackPoint> circle(double radius_m, double bank_rad) {
  std::vector<TrackPoint> points;
  const int count = static_cast<int>(2 * M_PI * radius_m / 2);
  for (int i = 0; i < count; ++i) {
    const double angle = 2 * M_PI * i / count;
    points.push_back({{radius_m * std::sin(angle), radius_m * (1 - std::cos(angle)), 0}, bank_rad, 6, 5});
  }
  return points;
}

class TrackTest : public ::testing::Test {
 protected:
  void SetUp() override {
    const auto* info = ::testing::UnitTest::GetInstance()->current_test_info();
    folder = fs::temp_directory_path() / ("raceloc_" + std::to_string(::getpid()) + "_" + info->name());
    fs::create_directories(folder);
  }
  void TearDown() override { fs::remove_all(folder); }

  std::string write(const std::string& name, const std::string& text) const {
    std::ofstream(folder / name, std::ios::binary) << text;
    return (folder / name).string();
  }
  /** What readCircuit says of the file; empty: it accepts it. */
  std::string complaint(const std::string& name, const std::string& text) const {
    try {
      (void)readCircuit(write(name, text));
    } catch (const InputError& error) {
      return error.what();
    }
    return {};
  }

  fs::path folder;
};

/** Two straights of 200 m, two half turns of 100 m radius. */
std::string stadium(const std::string& more_of_first = "", const std::string& more_of_all = "") {
  const std::string half_turn = "length_m = 314.159265\nturn = left\nradius_m = 100\n";
  return "[track]\ntransition_m = 40\n[segments]\n" + more_of_all + "[segment_1]\nlength_m = 100\n" +
         more_of_first + "[segment_2]\n" + half_turn + "[segment_3]\nlength_m = 200\n[segment_4]\n" +
         half_turn + "[segment_5]\nlength_m = 100\n";
}

// ---- Spline

TEST(PeriodicSpline, FollowsACircle) {
  constexpr int kKnots = 32;
  std::vector<Eigen::Vector2d> knots;
  for (int i = 0; i < kKnots; ++i)
    knots.emplace_back(std::cos(2 * M_PI * i / kKnots), std::sin(2 * M_PI * i / kKnots));
  const PeriodicSpline<2> spline(knots, 2 * M_PI / kKnots);
  EXPECT_NEAR(spline.period(), 2 * M_PI, 1e-12);
  for (double t = -7; t < 14; t += 0.37) {
    const auto v = spline(t);
    EXPECT_LT((v.value - Eigen::Vector2d(std::cos(t), std::sin(t))).norm(), 1e-4);
    EXPECT_LT((v.first - Eigen::Vector2d(-std::sin(t), std::cos(t))).norm(), 1e-3);
    EXPECT_LT((v.second + Eigen::Vector2d(std::cos(t), std::sin(t))).norm(), 2e-2);
  }
}

TEST(PeriodicSpline, RefusesTooFewKnotsAndNoStep) {
  using Knots = std::vector<Eigen::Matrix<double, 1, 1>>;
  EXPECT_THROW(PeriodicSpline<1>(Knots(3, Eigen::Matrix<double, 1, 1>::Zero()), 1), std::invalid_argument);
  EXPECT_THROW(PeriodicSpline<1>(Knots(4, Eigen::Matrix<double, 1, 1>::Zero()), 0), std::invalid_argument);
}

// ---- Track

TEST(Track, BankedCircle) {
  constexpr double kRadius_m = 100, kBank_rad = 10 * kDegree;
  const Track track(circle(kRadius_m, kBank_rad));
  EXPECT_NEAR(track.length_m(), 2 * M_PI * kRadius_m, 0.01);
  const RoadFrame start = track.at(0);
  EXPECT_LT(start.T_map_road.translation().norm(), 1e-9);
  EXPECT_LT((start.T_map_road.linear().col(0) - Eigen::Vector3d::UnitX()).norm(), 1e-6);
  EXPECT_NEAR(start.turn_per_m.x(), 0, 1e-6);
  EXPECT_NEAR(-start.turn_per_m.y(), std::sin(kBank_rad) / kRadius_m, 1e-5) << "the road curves upward";
  EXPECT_NEAR(start.turn_per_m.z(), std::cos(kBank_rad) / kRadius_m, 1e-5);
  EXPECT_NEAR(track.surface(0, -6).T_map_surface.translation().z(), 6 * std::sin(kBank_rad), 1e-9)
      << "positive bank: the right edge is up";
  EXPECT_NEAR(track.surface(0, 5).stretch, 1 - 5 * std::cos(kBank_rad) / kRadius_m, 1e-5);
  EXPECT_EQ(start.right_m, 6);
  EXPECT_EQ(start.left_m, 5);
}

TEST(Track, LocatesWithinReachOnly) {
  const Track track(circle(100, 0));
  const auto place = track.locate({0, 100 - 97, 2});
  ASSERT_TRUE(place);
  EXPECT_NEAR(place->n_m, 3, 1e-3);
  EXPECT_NEAR(place->height_m, 2, 1e-9);
  EXPECT_FALSE(track.locate({0, 100, 0}, 60)) << "the middle is 100 m from the line";
  EXPECT_TRUE(track.locate({1, 100, 0}, 150));
  EXPECT_FALSE(track.locate({0, -30, 0}, 29));
  EXPECT_TRUE(track.locate({0, -30, 0}, 31));
  EXPECT_FALSE(track.locate({5000, 5000, 0}, 200));
}

TEST(Track, WrapsStations) {
  const Track track(circle(100, 0));
  const double length_m = track.length_m();
  EXPECT_NEAR(track.wrapped(-1), length_m - 1, 1e-9);
  EXPECT_NEAR(track.wrapped(2 * length_m + 3), 3, 1e-9);
  EXPECT_LT(track.wrapped(-1e-18), length_m);
}

TEST(Track, RefusesGapsAndFewPoints) {
  auto points = circle(100, 0);
  auto gap = points;
  gap.erase(gap.begin() + 5, gap.begin() + 20);
  EXPECT_THROW(Track{gap}, std::invalid_argument);
  points.resize(7);
  EXPECT_THROW(Track{points}, std::invalid_argument);
}

// ---- Circuits from segments

TEST_F(TrackTest, StadiumFromSegments) {
  const Circuit circuit = readCircuit(write("stadium.ini", stadium("wall_left_height_m = 0\n")));
  EXPECT_EQ(circuit.name, "stadium");
  EXPECT_NEAR(circuit.track.length_m(), 400 + 200 * M_PI, 0.02);
  EXPECT_LT(circuit.miss.gap_m, 1e-3);
  EXPECT_LT(std::abs(circuit.miss.heading_rad), 1e-6);
  // Heading 90: east is x. Clothoids shift a turn inwards by transition^2 / (16 * 6 R), not more.
  const Eigen::Vector3d far = circuit.track.at(100 + 50 * M_PI).T_map_road.translation();
  EXPECT_NEAR(far.x(), 200, 0.5);
  EXPECT_NEAR(far.y(), 100, 0.5);
  EXPECT_NEAR(circuit.track.at(100 + 50 * M_PI).turn_per_m.z(), 0.01, 1e-5);
  EXPECT_NEAR(circuit.track.at(0).turn_per_m.z(), 0, 1e-6);
  ASSERT_THAT(circuit.barriers, SizeIs(2)) << "neighbours of one kind are joined";
  EXPECT_EQ(circuit.barriers[0].side, Side::left);
  EXPECT_NEAR(circuit.barriers[0].from_m, 100, 0.01);
  EXPECT_EQ(circuit.barriers[1].side, Side::right);
  EXPECT_NEAR(circuit.barriers[1].from_m, 0, 1e-9);
  EXPECT_NEAR(circuit.barriers[1].to_m, circuit.track.length_m(), 1e-6);
}

TEST_F(TrackTest, SegmentsOfTenAndMoreComeAfterTheOthers) {
  // Sorted as text, _10 and _11 would come second and the bank with them.
  std::string text = "[track]\ntransition_m = 0\n";
  for (int k = 1; k <= 12; ++k)
    text += "[segment_" + std::to_string(k) + "]\nlength_m = 52.359878\nturn = left\nradius_m = 100\n" +
            (k == 11 ? "bank_start_deg = 8\nbank_end_deg = 8\n" : "");
  const Circuit circuit = readCircuit(write("ring.ini", text));
  EXPECT_NEAR(circuit.track.at(10.5 * 52.36).bank_rad, 8 * kDegree, 1e-6);
  EXPECT_NEAR(circuit.track.at(1.5 * 52.36).bank_rad, 0, 1e-6);
}

TEST_F(TrackTest, ShortTurnsKeepTheirAngle) {
  // Boundaries between grid cells: sampled at the cells' middles each of them would cost up to 0.25 m / 8 m = 1.8 deg.
  std::string text = "[track]\ntransition_m = 6\n";
  const double quarter_m = 8 * M_PI / 2;
  for (int k = 1; k <= 4; ++k) {
    text += "[segment_" + std::to_string(2 * k - 1) + "]\nlength_m = 30.1\n";
    text += "[segment_" + std::to_string(2 * k) + "]\nlength_m = " + std::to_string(quarter_m) +
            "\nturn = right\nradius_m = 8\n";
  }
  const Circuit circuit = readCircuit(write("square.ini", text));
  EXPECT_LT(std::abs(circuit.miss.heading_rad), 1e-6);
  EXPECT_LT(circuit.miss.gap_m, 0.01);
}

TEST_F(TrackTest, TheSeamIsAsSmoothAsTheRest) {
  // A ring whose start line lies in the turn and whose length is no multiple of the step.
  const Circuit circuit = readCircuit(
      write("ring.ini", "[track]\n[segment_1]\nlength_m = 314.9\nturn = left\nradius_m = 50.12\n"));
  for (double s_m = -20; s_m < 20; s_m += 0.1)
    EXPECT_NEAR(circuit.track.at(s_m).turn_per_m.z(), 1 / 50.12, 2e-5) << "at " << s_m;
}

TEST_F(TrackTest, TrackThatDoesNotCloseIsRefusedWithItsMiss) {
  auto text = stadium();
  text.replace(text.find("length_m = 200"), 14, "length_m = 215");
  EXPECT_THAT(
      complaint("open.ini", text),
      AllOf(HasSubstr("open.ini"), HasSubstr("misses the start by 15.0 m"), HasSubstr("at most 1 %")));
  EXPECT_THAT(complaint("uphill.ini", stadium("grade_percent = 15\n")),
              AllOf(HasSubstr("uphill.ini"), HasSubstr("14.9 m in height")));
  EXPECT_THAT(complaint("straight.ini", "[segment_1]\nlength_m = 500\n"),
              HasSubstr("misses the start by 500.0 m (100.00 % of 500.0 m"));
  text = stadium();
  text.replace(text.find("length_m = 200"), 14, "length_m = 205");
  EXPECT_EQ(complaint("nearly.ini", text), "");
}

TEST_F(TrackTest, BadSegmentsNameFileSectionKeyAndValue) {
  EXPECT_THAT(complaint("a.ini", stadium("right_m = -6\n")),
              AllOf(HasSubstr("a.ini"), HasSubstr("segment_1"), HasSubstr("right_m"), HasSubstr("-6")));
  EXPECT_THAT(complaint("b.ini", stadium("", "left_m = -1\n")),
              AllOf(HasSubstr("b.ini"), HasSubstr("segments"), HasSubstr("left_m"), HasSubstr("-1")));
  EXPECT_THAT(complaint("c.ini", stadium("widht_m = 6\n")),
              AllOf(HasSubstr("c.ini"), HasSubstr("segment_1"), HasSubstr("widht_m")));
  EXPECT_THAT(complaint("d.ini", stadium("turn = up\n")),
              AllOf(HasSubstr("segment_1"), HasSubstr("turn"), HasSubstr("up"), HasSubstr("straight")));
  auto text = stadium();
  text.replace(text.find("length_m = 200"), 14, "right_m = 7");
  EXPECT_THAT(complaint("e.ini", text),
              AllOf(HasSubstr("e.ini"), HasSubstr("segment_3"), HasSubstr("length_m is missing")));
  EXPECT_THAT(complaint("f.ini", stadium() + "[segmnet_9]\nlength_m = 1\n"),
              AllOf(HasSubstr("f.ini"), HasSubstr("segmnet_9")));
  EXPECT_THAT(complaint("g.ini", "[track]\nname = none\n"),
              AllOf(HasSubstr("g.ini"), HasSubstr("no section [segment_01]")));
  EXPECT_THAT(complaint("h.ini", stadium() + "[pace]\ntop_speed_mps = 0\n"),
              AllOf(HasSubstr("pace"), HasSubstr("top_speed_mps"), HasSubstr("0")));
  EXPECT_THROW((void)readCircuit((folder / "absent.ini").string()), InputError);
}

TEST_F(TrackTest, BadSceneryNamesFileSectionKeyAndValue) {
  EXPECT_THAT(complaint("a.ini", stadium() + "[scenery_1]\nfrom_m = 50\nto_m = 40\n"),
              AllOf(HasSubstr("a.ini"), HasSubstr("scenery_1"), HasSubstr("to_m = 40"), HasSubstr("50")));
  EXPECT_THAT(complaint("b.ini", stadium() + "[scenery_1]\nkind = castle\nto_m = 40\n"),
              AllOf(HasSubstr("scenery_1"), HasSubstr("kind"), HasSubstr("castle"), HasSubstr("grandstand")));
  EXPECT_THAT(complaint("c.ini", stadium() + "[scenery_1]\nfrom_m = 5000\nto_m = 5010\n"),
              AllOf(HasSubstr("c.ini"), HasSubstr("scenery_1"), HasSubstr("5000"), HasSubstr("m long")));
  EXPECT_EQ(complaint("d.ini", stadium() + "[scenery_1]\nfrom_m = 1000\nto_m = 1100\n"), "")
      << "across the start line";
}

// ---- Centre lines

std::string ring(int count, double radius_m, const std::string& widths = "5.5,6.5") {
  std::ostringstream text;
  text << "# x_m,y_m,w_tr_right_m,w_tr_left_m\n";
  for (int i = 0; i < count; ++i)
    text << 1000 + radius_m * std::cos(2 * M_PI * i / count) << ","
         << -2000 + radius_m * std::sin(2 * M_PI * i / count) << "," << widths << "\n";
  return text.str();
}

TEST_F(TrackTest, CentreLineOfACsv) {
  const Circuit circuit = readCircuit(write("ring.csv", ring(126, 100)));
  EXPECT_EQ(circuit.name, "ring");
  EXPECT_NEAR(circuit.track.length_m(), 2 * M_PI * 100, 0.05);
  const RoadFrame start = circuit.track.at(0);
  EXPECT_LT(start.T_map_road.translation().norm(), 1e-6) << "the first point is the map's origin";
  EXPECT_NEAR(start.right_m, 5.5, 1e-9);
  EXPECT_NEAR(start.left_m, 6.5, 1e-9);
  EXPECT_THAT(circuit.barriers, SizeIs(2));
  EXPECT_THAT(circuit.notes, ::testing::Contains(HasSubstr("no place on earth")));
  EXPECT_THAT(circuit.notes, ::testing::Contains(HasSubstr("flat")));
}

TEST_F(TrackTest, CsvMayRepeatItsFirstPointAndHaveBlankLinesAndAByteOrderMark) {
  const std::string text = ring(126, 100);
  const auto first = text.find('\n') + 1;
  const std::string again = text.substr(first, text.find('\n', first) - first);
  const Circuit circuit = readCircuit(write("ring.csv", "\xEF\xBB\xBF" + text + again + "\r\n\r\n\n"));
  EXPECT_NEAR(circuit.track.length_m(), 2 * M_PI * 100, 0.05);
}

TEST_F(TrackTest, IniMayTakeItsRoadFromACsv) {
  write("ring.csv", ring(126, 100));
  const Circuit circuit =
      readCircuit(write("mine.ini",
                        "[track]\nname = Mine\norigin_lat_deg = 51\ncentreline_csv = ring.csv\n"
                        "[segments]\nwall_left_height_m = 0\n[pace]\ntop_speed_mps = 33\n"));
  EXPECT_EQ(circuit.name, "Mine");
  EXPECT_EQ(circuit.origin.latitude_deg, 51);
  EXPECT_EQ(circuit.pace.top_speed_mps, 33);
  ASSERT_THAT(circuit.barriers, SizeIs(1));
  EXPECT_EQ(circuit.barriers[0].side, Side::right);
}

TEST_F(TrackTest, BadCsvNamesFileAndLine) {
  EXPECT_THAT(complaint("a.csv", ring(126, 100) + "1100,-2000,5\n"),
              AllOf(HasSubstr("a.csv, line 128"), HasSubstr("1100,-2000,5")));
  EXPECT_THAT(complaint("b.csv", ring(126, 100, "-5,6")),
              AllOf(HasSubstr("b.csv, line 2"), HasSubstr("w_tr_right_m = -5")));
  EXPECT_THAT(complaint("c.csv", ring(126, 100, "5,0")),
              AllOf(HasSubstr("c.csv, line 2"), HasSubstr("w_tr_left_m = 0")));
  EXPECT_THAT(complaint("d.csv", ring(126, 100, "5,nan")), HasSubstr("d.csv, line 2"));
  EXPECT_THAT(complaint("e.csv", ring(20, 100)), AllOf(HasSubstr("e.csv, line 3"), HasSubstr("0.2 to 20 m")));
  EXPECT_THAT(complaint("f.csv", ring(5, 10)), AllOf(HasSubstr("f.csv"), HasSubstr("5 points")));
  EXPECT_THAT(complaint("empty.csv", ""), AllOf(HasSubstr("empty.csv"), HasSubstr("0 points")));
  EXPECT_THROW((void)readCircuit((folder / "absent.csv").string()), InputError);
}

TEST_F(TrackTest, CsvThatDoesNotCloseIsRefusedWithItsMiss) {
  for (const int kept : {110, 5000}) {  // 1 % of the longer line is more than a step may be
    const int count = kept == 110 ? 126 : 5006;
    const double radius_m = 5 * count / (2 * M_PI);
    std::istringstream in(ring(count, radius_m));
    std::string text, line;
    for (int i = 0; i <= kept && std::getline(in, line); ++i) text += line + "\n";
    EXPECT_THAT(complaint("open.csv", text), AllOf(HasSubstr("open.csv"), HasSubstr("does not close")));
  }
}

TEST(CentreLines, AllCircuitsOfTheDatabaseAreRead) {
  if (!fs::exists(kCentreLines)) GTEST_SKIP() << "no " << kCentreLines;
  int count = 0;
  for (const auto& entry : fs::directory_iterator(kCentreLines)) {
    if (entry.path().extension() != ".csv") continue;
    SCOPED_TRACE(entry.path().string());
    ++count;
    const Circuit circuit = readCircuit(entry.path().string());
    EXPECT_GT(circuit.track.length_m(), 2000);
    EXPECT_LT(circuit.track.length_m(), 8000);
    for (double s_m = 0; s_m < circuit.track.length_m(); s_m += 7) {
      const RoadFrame road = circuit.track.at(s_m);
      EXPECT_GT(road.right_m + road.left_m, 5);
      EXPECT_LT(std::abs(road.turn_per_m.z()), 0.2);
    }
  }
  EXPECT_EQ(count, 25);
}

// ---- Shipped circuits

struct Facts {
  std::string file;
  double length_m, top_speed_mps;
  double turns;                          ///< of the heading in a lap, positive: counter-clockwise
  double most_bank_deg;                  ///< of either sign
  double least_height_m, most_height_m;  ///< between the lowest and the highest point
};

class ShippedCircuit : public ::testing::TestWithParam<Facts> {};

TEST_P(ShippedCircuit, HasItsPublicFigures) {
  const Facts& facts = GetParam();
  const Circuit circuit = readCircuit((kRoot / "share/tracks" / facts.file).string());
  const Track& track = circuit.track;
  EXPECT_NEAR(track.length_m(), facts.length_m, 0.005 * facts.length_m);
  EXPECT_EQ(circuit.pace.top_speed_mps, facts.top_speed_mps);
  EXPECT_LT(circuit.miss.gap_m, 0.002 * facts.length_m) << "before it was distributed";
  EXPECT_LT(std::abs(circuit.miss.height_m), 0.05);
  EXPECT_LT(std::abs(circuit.miss.heading_rad), 0.1 * kDegree);
  EXPECT_LT(track.at(0).T_map_road.translation().norm(), 1e-6);

  double turned_rad = 0, bank = 0, low = 1e9, high = -1e9;
  for (int i = 0; i < static_cast<int>(track.length_m()); ++i) {
    const RoadFrame here = track.at(i), next = track.at(i + 1 < track.length_m() ? i + 1 : 0);
    const Eigen::Vector3d a = here.T_map_road.linear().col(0), b = next.T_map_road.linear().col(0);
    turned_rad += std::atan2(a.x() * b.y() - a.y() * b.x(), a.x() * b.x() + a.y() * b.y());
    bank = std::max(bank, std::abs(here.bank_rad));
    low = std::min(low, here.T_map_road.translation().z());
    high = std::max(high, here.T_map_road.translation().z());
  }
  EXPECT_NEAR(turned_rad, 2 * M_PI * facts.turns, 0.02);
  EXPECT_NEAR(bank / kDegree, facts.most_bank_deg, 0.05);
  EXPECT_GE(high - low, facts.least_height_m);
  EXPECT_LE(high - low, facts.most_height_m);
}

INSTANTIATE_TEST_SUITE_P(Track, ShippedCircuit,
                         ::testing::Values(Facts{"lvms.ini", 2414.0, 69.11, 1, 20, 0, 0.1},
                                           Facts{"ims.ini", 4023.4, 41.08, 1, 9.2, 0, 0.1},
                                           Facts{"tms.ini", 2414.0, 57.55, 1, 24, 0, 0.1},
                                           Facts{"lor.ini", 1104.0, 27.74, 1, 12, 0, 0.1},
                                           Facts{"monza_like.ini", 5793, 55.72, -1, 4, 5, 20},
                                           Facts{"everland_like.ini", 4350, 42.04, -1, 3, 30, 60}),
                         [](const auto& circuit) { return fs::path(circuit.param.file).stem().string(); });

TEST(ShippedCircuits, BanksOfTheOvals) {
  const auto bank_deg = [](const char* file, double s_m) {
    return readCircuit((kRoot / "share/tracks" / file).string()).track.at(s_m).bank_rad / kDegree;
  };
  EXPECT_NEAR(bank_deg("lvms.ini", 0), 9, 0.01);
  EXPECT_NEAR(bank_deg("lvms.ini", 650), 20, 0.01);
  EXPECT_NEAR(bank_deg("lvms.ini", 1207), 9, 0.01);
  EXPECT_NEAR(bank_deg("tms.ini", 0), 5, 0.01);
  EXPECT_NEAR(bank_deg("tms.ini", 650), 20, 0.01);
  EXPECT_NEAR(bank_deg("tms.ini", 1750), 24, 0.01);
  EXPECT_NEAR(bank_deg("ims.ini", 480), 9.2, 0.01);
  EXPECT_NEAR(bank_deg("ims.ini", 1800), 0, 0.01);
}

TEST(ShippedCircuits, StartInTheirCompassDirection) {
  const auto direction = [](const char* file) -> Eigen::Vector3d {
    return readCircuit((kRoot / "share/tracks" / file).string()).track.at(0).T_map_road.linear().col(0);
  };
  EXPECT_LT((direction("lor.ini") + Eigen::Vector3d::UnitY()).norm(), 1e-3) << "180 deg: south";
  EXPECT_LT((direction("everland_like.ini").head<2>() - Eigen::Vector2d::UnitX()).norm(), 1e-3) << "east";
}

}  // namespace
}  // namespace raceloc
