#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cmath>
#include <csignal>
#include <fstream>
#include <iterator>
#include <string>

#include "core/errors.h"
#include "core/labels.h"
#include "core/options.h"
#include "core/output_file.h"
#include "core/statistics.h"
#include "core/trajectory.h"
#include "core/types.h"
#include "support/complaint.h"
#include "support/run_command.h"

namespace raceloc {
namespace {

using test::complaint;
using test::TemporaryFolder;
using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::EndsWith;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Pair;
using ::testing::SizeIs;
using ::testing::UnorderedElementsAre;

std::string textOf(const std::string& path) {
  std::ifstream in(path);
  return {std::istreambuf_iterator<char>(in), {}};
}

/** A file of the test's own, with this text in it. */
std::string written(const TemporaryFolder& folder, const std::string& name, const std::string& text) {
  std::ofstream(folder / name) << text;
  return folder / name;
}

// ---- values

TEST(Types, YawIsCounterClockwiseFromEast) {
  EXPECT_DOUBLE_EQ(yawOf(poseFromRpy({1, 2, 3}, 0, 0, 0.5)), 0.5);
  const Eigen::Vector3d ahead = poseFromRpy({0, 0, 0}, 0, 0, M_PI / 2) * Eigen::Vector3d(1, 0, 0);
  EXPECT_TRUE(ahead.isApprox(Eigen::Vector3d(0, 1, 0), 1e-12));
}

TEST(Types, PositivePitchLowersTheNoseAndPositiveRollLiftsTheLeft) {  // z up, x forward, y left
  EXPECT_LT((poseFromRpy({0, 0, 0}, 0, 0.1, 0) * Eigen::Vector3d(1, 0, 0)).z(), 0);
  EXPECT_GT((poseFromRpy({0, 0, 0}, 0.1, 0, 0) * Eigen::Vector3d(0, 1, 0)).z(), 0);
}

TEST(Types, TransformedCloudKeepsItsIntensity) {
  Cloud cloud;
  cloud.push({1, 0, 0}, 0.25F);
  const Cloud moved = transformed(cloud, poseFromRpy({10, 20, 30}, 0, 0, M_PI / 2));
  ASSERT_EQ(moved.size(), 1U);
  EXPECT_TRUE(moved.point(0).isApprox(Eigen::Vector3f(10, 21, 30), 1e-6F));
  EXPECT_THAT(moved.intensity, ElementsAre(0.25F));
}

TEST(Labels, MatchShellPatterns) {
  EXPECT_TRUE(matchesLabel("gps_*", "gps_left"));
  EXPECT_TRUE(matchesLabel("lidar_?", "lidar_1"));
  EXPECT_TRUE(matchesLabel("imu gps_*", "gps_left"));
  EXPECT_TRUE(matchesLabel("imu,gps_*", "imu"));
  EXPECT_FALSE(matchesLabel("gps_*", "imu"));
  EXPECT_FALSE(matchesLabel("gps", "gps_left"));
  EXPECT_FALSE(matchesLabel("lidar_?", "lidar_12"));
  EXPECT_FALSE(matchesLabel("", "gps"));
  EXPECT_FALSE(matchesLabel(" , ", "gps"));
}

TEST(Errors, ListedNames) {
  EXPECT_EQ(listed({}), "none");
  EXPECT_EQ(listed({"a"}), "a");
  EXPECT_EQ(listed({"a", "b"}), "a, b");
}

// ---- options

enum class Kernel { rbf, gaussian };

struct SampleOptions {
  double voxel_size_m = 1.5;
  double share = 0.5;
  int max_iterations = 30;
  bool gated = true;
  Kernel kernel = Kernel::rbf;
  std::string label = "lidar";
  void describe(OptionList& keys) {
    keys.add("voxel_size_m", voxel_size_m, above(0), "edge of a voxel [m]");
    keys.add("share", share, between(0, 1), "of the inliers");
    keys.add("max_iterations", max_iterations, atLeast(1), "steps");
    keys.add("gated", gated, "whether the gate is on");
    keys.add("kernel", kernel, {{"rbf", Kernel::rbf}, {"gaussian", Kernel::gaussian}}, "of the covariances");
    keys.add("label", label, "of the sensor");
  }
};

SampleOptions loaded(const std::string& section_text) {
  const TemporaryFolder folder;
  IniFile ini(written(folder, "sample.ini", "[sample]\n" + section_text));
  SampleOptions options;
  ini.load("sample", options);
  ini.rejectUnknownSections();
  return options;
}

TEST(Options, ReadEveryType) {
  const auto options = loaded(
      "voxel_size_m = 2.5e-1\nshare=0\nmax_iterations = 7\ngated = false\nkernel = gaussian\nlabel = "
      "velo_1\n");
  EXPECT_EQ(options.voxel_size_m, 0.25);
  EXPECT_EQ(options.share, 0);
  EXPECT_EQ(options.max_iterations, 7);
  EXPECT_FALSE(options.gated);
  EXPECT_EQ(options.kernel, Kernel::gaussian);
  EXPECT_EQ(options.label, "velo_1");
}

TEST(Options, AbsentKeysKeepTheirDefaults) {
  const auto options = loaded("");
  EXPECT_EQ(options.voxel_size_m, 1.5);
  EXPECT_EQ(options.label, "lidar");
}

TEST(Options, CommentsBlanksAndEvaluationsAreMrpts) {
  const auto options = loaded(
      "; share = 9\n# share = 9\n// share = 9\n  // >= 1\n  voxel_size_m =  2   // metres\nshare = 0.25 # of "
      "1\n"
      "max_iterations = $eval{2*21} ; steps\n");
  EXPECT_EQ(options.voxel_size_m, 2);
  EXPECT_EQ(options.share, 0.25);
  EXPECT_EQ(options.max_iterations, 42);
}

TEST(Options, KeysAndSectionsIgnoreCase) {
  const TemporaryFolder folder;
  IniFile ini(written(folder, "a.ini", "[SAMPLE]\nVoxel_Size_M = 2\n"));
  SampleOptions options;
  ini.load("sample", options);
  EXPECT_EQ(options.voxel_size_m, 2);
}

TEST(Options, AVariableThatIsNotDefinedIsTheUsersError) {
  EXPECT_THAT(complaint([] { (void)loaded("share = ${b}\n"); }),
              AllOf(HasSubstr("sample.ini"), HasSubstr("${b}")));
}

TEST(Options, ASectionThatIsThereTwiceIsRefused) {
  EXPECT_THAT(complaint([] { (void)loaded("share = 1\n  [Sample] // again\nshare = 0\n"); }),
              HasSubstr("section [Sample] is there twice"));
  EXPECT_NO_THROW((void)loaded("share = 1\n// [sample]\n"));
}

TEST(Options, ALineThatIsNoIniIsRefusedByItsNumber) {
  for (const std::string line : {"voxel_size_m 2", "share: 0.5", "= 3", "[sample", "\x01\x02"})
    EXPECT_THAT(complaint([&] { (void)loaded("\n# a comment\nshare = 1\n" + line + "\n"); }),
                HasSubstr("sample.ini:5: neither key = value nor [section]"))
        << line;
  const TemporaryFolder folder;
  const auto opening = [&](const std::string& text) {
    return complaint([&] { IniFile(written(folder, "a.ini", text)); });
  };
  EXPECT_THAT(opening("Dear driver,\nthis is no ini.\n"), HasSubstr("a.ini:1: neither"));
  EXPECT_THAT(opening("\nshare = 1\n[sample]\n"), HasSubstr("a.ini:2: above the first [section]"));
}

TEST(Options, WhatMrptReadsIsRead) {
  EXPECT_EQ(loaded("@define HALF 0.5\r\n\tshare = ${HALF}\r\n \r\n").share, 0.5);
  EXPECT_EQ(loaded("label = one \\\ntwo\n").label, "one two");
}

TEST(Options, AByteOrderMarkIsPassedOver) {
  const TemporaryFolder folder;
  IniFile ini(written(folder, "a.ini", "\xEF\xBB\xBF[sample]\nshare = 0.25\n"));
  SampleOptions options;
  ini.load("sample", options);
  EXPECT_EQ(options.share, 0.25);
}

TEST(Options, UnknownKeySuggestsTheNearest) {
  EXPECT_THAT(complaint([] { (void)loaded("voxel_size = 2\n"); }),
              AllOf(HasSubstr("sample.ini, section [sample]: unknown key voxel_size;"),
                    HasSubstr("did you mean voxel_size_m?")));
  EXPECT_THAT(complaint([] { (void)loaded("zzzzzzzzzz = 2\n"); }),
              HasSubstr("(known: voxel_size_m, share, max_iterations, gated, kernel, label)"));
}

TEST(Options, ValuesThatContradictEachOtherAreRefused) {
  struct Levels {
    double alarm_s = 1, all_clear_s = 2;
    void describe(OptionList& keys) {
      keys.add("alarm_s", alarm_s, atLeast(0), "of the alarm [s]");
      keys.add("all_clear_s", all_clear_s, atLeast(0), "of its end [s]");
      keys.atMost("alarm_s", alarm_s, "all_clear_s", all_clear_s);
    }
  };
  const TemporaryFolder folder;
  const auto refusal = [&](const std::string& text) {
    return complaint([&] {
      IniFile ini(written(folder, "a.ini", text));
      Levels levels;
      ini.load("levels", levels);
    });
  };
  const std::string what = "section [levels]: alarm_s = 3, but it must be at most all_clear_s = 2";
  EXPECT_EQ(refusal("[levels]\nalarm_s = 3\n"), "ini " + (folder / "a.ini") + ", " + what);
  Levels levels;
  requireConsistent("levels", levels);
  levels.alarm_s = 2;
  requireConsistent("levels", levels);  // the limit itself is inside
  levels.alarm_s = 3;
  EXPECT_EQ(complaint([&] { requireConsistent("levels", levels); }), what);
  EXPECT_THAT(iniText("levels", levels), HasSubstr("of the alarm [s]; >= 0, at most all_clear_s\n"));
}

class BadValue : public ::testing::TestWithParam<std::pair<std::string, std::string>> {};

TEST_P(BadValue, NamesKeyValueAndWhatIsAllowed) {
  const std::string line = GetParam().first;
  EXPECT_THAT(complaint([&] { (void)loaded(line + "\n"); }),
              HasSubstr("section [sample]: " + line + ", but it must be " + GetParam().second));
}

INSTANTIATE_TEST_SUITE_P(
    Options, BadValue,
    ::testing::Values(std::pair("voxel_size_m = 1,5", "> 0"), std::pair("voxel_size_m = 0x10", "> 0"),
                      std::pair("voxel_size_m = ", "> 0"), std::pair("voxel_size_m = nan", "> 0"),
                      std::pair("voxel_size_m = inf", "> 0"), std::pair("voxel_size_m = 1e999", "> 0"),
                      std::pair("voxel_size_m = 2 m", "> 0"), std::pair("voxel_size_m = 0", "> 0"),
                      std::pair("voxel_size_m = -0.5", "> 0"), std::pair("share = 1.01", "0 .. 1"),
                      std::pair("max_iterations = 0", ">= 1, whole"),
                      std::pair("max_iterations = 2.5", ">= 1, whole"),
                      std::pair("max_iterations = 99999999999", ">= 1, whole"),
                      std::pair("gated = yes", "true | false"), std::pair("gated = 1", "true | false"),
                      std::pair("kernel = laplace", "rbf | gaussian")));

TEST(Options, UnknownSectionSuggestsTheNearest) {
  EXPECT_THAT(complaint([] { (void)loaded("[sampel]\nshare = 1\n"); }),
              HasSubstr("unknown section [sampel]; did you mean sample?"));
}

TEST(Options, MissingFileIsNamed) {
  EXPECT_THAT(complaint([] { IniFile("/nonexistent/live.ini"); }),
              HasSubstr("ini /nonexistent/live.ini: cannot be read"));
}

TEST(Options, AFolderIsNoIniFile) {
  const TemporaryFolder folder;
  EXPECT_THAT(complaint([&] { IniFile(folder / "."); }), HasSubstr("cannot be read"));
}

TEST(Options, FreeFormSectionIsSortedByKey) {
  const TemporaryFolder folder;
  IniFile ini(written(folder, "columns.ini", "[columns]\nstamp_s = 3 // zero-based\nlatitude_deg = 1\n"));
  EXPECT_THAT(ini.pairs("columns"), ElementsAre(Pair("latitude_deg", "1"), Pair("stamp_s", "3")));
  EXPECT_NO_THROW(ini.rejectUnknownSections());
}

TEST(Options, AnUrlIsNoComment) {
  const TemporaryFolder folder;
  IniFile ini(written(folder, "urls.ini", "[urls]\na = udp://127.0.0.1:9750 // there\nb = x//y\n"));
  EXPECT_THAT(ini.pairs("urls"), ElementsAre(Pair("a", "udp://127.0.0.1:9750"), Pair("b", "x")));
}

TEST(Options, NearestNameIsEmptyWhenNothingIsNear) {
  EXPECT_EQ(nearestName("registraton", {"map", "registration"}), "registration");
  EXPECT_EQ(nearestName("REGISTRATION", {"map", "registration"}), "registration");
  EXPECT_EQ(nearestName("qqqqqq", {"map", "registration"}), "");
  EXPECT_EQ(nearestName("x", {}), "");
}

// ---- labels

TEST(Labels, PatternsThatMatchNothingAreNamed) {
  const std::vector<std::string> labels{"gps_left", "gps_right", "imu"};
  EXPECT_THAT(unmatchedPatterns("gps_* imu", labels), ::testing::IsEmpty());
  EXPECT_THAT(unmatchedPatterns("gps_left, gps_rear radar_?", labels), ElementsAre("gps_rear", "radar_?"));
  EXPECT_THAT(unmatchedPatterns("*", {}), ElementsAre("*"));
  EXPECT_THAT(unmatchedPatterns(" ", labels), ::testing::IsEmpty());
}

// ---- files

TEST(OutputFile, AppearsOnlyWhenCommitted) {
  const TemporaryFolder folder;
  OutputFile file(folder / "map.rlmap");
  std::ofstream(file.temporaryPath()) << "whole";
  EXPECT_THAT(file.temporaryPath(), EndsWith(".rlmap"));  // writers may look at the extension
  EXPECT_THAT(folder.names(), SizeIs(1));
  EXPECT_NE(access(file.path().c_str(), F_OK), 0);
  file.commit();
  EXPECT_THAT(folder.names(), ElementsAre("map.rlmap"));
  EXPECT_EQ(textOf(file.path()), "whole");
}

TEST(OutputFile, LeavesNothingBehindWithoutCommit) {
  const TemporaryFolder folder;
  {
    OutputFile file(folder / "map.rlmap");
    std::ofstream(file.temporaryPath()) << "half";
    const OutputFile taken(std::move(file));
  }
  EXPECT_THAT(folder.names(), IsEmpty());
}

TEST(OutputFile, KeepsTheOldFileUntilTheNewOneIsWhole) {
  const TemporaryFolder folder;
  const std::string path = written(folder, "race.tum", "old");
  {
    OutputFile file(path);
    std::ofstream(file.temporaryPath()) << "half";
  }
  EXPECT_EQ(textOf(path), "old");
  writeTextFile(path, "new");
  EXPECT_EQ(textOf(path), "new");
  EXPECT_THAT(folder.names(), ElementsAre("race.tum"));
}

TEST(OutputFile, ComplainsAtOnceWhereItCannotWrite) {
  const TemporaryFolder folder;
  const std::string file = written(folder, "file", "");
  for (const std::string& path : {folder / "missing/race.tum", file + "/race.tum", folder / "."})
    EXPECT_THAT(complaint([&] { OutputFile output(path); }),
                HasSubstr("output " + path + ": cannot be written"));
  EXPECT_THAT(folder.names(), ElementsAre("file"));
}

TEST(OutputFile, ComplainsAboutAFolderWithoutRights) {
  if (geteuid() == 0) GTEST_SKIP() << "root may write anywhere";
  const TemporaryFolder folder;
  const std::string closed = folder / "closed";
  ASSERT_EQ(mkdir(closed.c_str(), 0555), 0);
  EXPECT_THAT(complaint([&] { OutputFile output(closed + "/race.tum"); }),
              HasSubstr("closed/race.tum: cannot be written"));
}

TEST(OutputFile, ComplainsWhenItsTemporaryIsGone) {
  const TemporaryFolder folder;
  OutputFile file(folder / "race.tum");
  ASSERT_EQ(unlink(file.temporaryPath().c_str()), 0);
  EXPECT_THAT(complaint([&] { file.commit(); }), HasSubstr("race.tum: cannot be written"));
}

// ---- trajectories

constexpr char kPose[] = "1.5 1 2 3 0 0 0 1\n";

std::string tumComplaint(const std::string& text) {
  const TemporaryFolder folder;
  const std::string path = written(folder, "race.tum", text);
  return complaint([&] { (void)readTum(path); });
}

TEST(Tum, ReadsPosesOriginCommentsAndBlankLines) {
  const TemporaryFolder folder;
  const Trajectory trajectory =
      readTum(written(folder, "race.tum",
                      "# map origin (WGS84 lat_deg lon_deg height_m): 45.5 9.25 180.125\n"
                      "# stamp x y z qx qy qz qw\r\n\n"
                      "1.5 1 -2 3e0 0 0 0 1\r\n"
                      "2.5\t4 5 6 0 0 0.6 0.8\n"));
  ASSERT_TRUE(trajectory.origin);
  EXPECT_EQ(trajectory.origin->latitude_deg, 45.5);
  EXPECT_EQ(trajectory.origin->longitude_deg, 9.25);
  EXPECT_EQ(trajectory.origin->height_m, 180.125);
  ASSERT_THAT(trajectory.poses, SizeIs(2));
  EXPECT_EQ(trajectory.poses[0].stamp_s, 1.5);
  EXPECT_EQ(trajectory.poses[0].T_map_body.translation(), Eigen::Vector3d(1, -2, 3));
  EXPECT_NEAR(yawOf(trajectory.poses[1].T_map_body), 2 * std::atan2(0.6, 0.8), 1e-12);
}

TEST(Tum, ErrorsNameFileAndLine) {
  const std::string good = kPose;
  EXPECT_THAT(tumComplaint(good + "2.5 1 2 3 0 0 0\n"),
              AllOf(HasSubstr("race.tum, line 2: not eight numbers"), HasSubstr("2.5 1 2 3 0 0 0")));
  EXPECT_THAT(tumComplaint(good + "2.5 1 2 3 0 0 0 1 9\n"), HasSubstr("line 2: not eight numbers"));
  EXPECT_THAT(tumComplaint("# comment\n\n2,5 1 2 3 0 0 0 1\n"), HasSubstr("line 3: not eight numbers"));
  EXPECT_THAT(tumComplaint(good + "2.5 nan 2 3 0 0 0 1\n"), HasSubstr("line 2: not eight numbers"));
  EXPECT_THAT(tumComplaint("1.5 1 2 3 0 0 0 1.01\n"),
              HasSubstr("line 1: the quaternion is not of unit length"));
  EXPECT_THAT(tumComplaint("1.5 1 2 3 0 0 0 0\n"), HasSubstr("line 1: the quaternion is not of unit length"));
  EXPECT_THAT(tumComplaint(good + good), HasSubstr("line 2: stamps must increase"));
  EXPECT_THAT(tumComplaint(good + "1.4 1 2 3 0 0 0 1\n"), HasSubstr("line 2: stamps must increase"));
  EXPECT_THAT(tumComplaint("# map origin (WGS84 lat_deg lon_deg height_m): 45.5 east 180\n" + good),
              HasSubstr("line 1: unreadable origin"));
}

TEST(Tum, EmptyAndMissingFilesAreNamed) {
  EXPECT_THAT(tumComplaint(""), HasSubstr("race.tum: holds no pose"));
  EXPECT_THAT(tumComplaint("# only a comment\n"), HasSubstr("race.tum: holds no pose"));
  const TemporaryFolder folder;
  EXPECT_THAT(complaint([&] { (void)readTum(folder / "."); }), HasSubstr("cannot be read"));
  EXPECT_THAT(complaint([] { (void)readTum("/nonexistent/race.tum"); }),
              HasSubstr("trajectory /nonexistent/race.tum: cannot be read"));
}

TEST(Tum, OtherReadersSeeEightColumnsAndComments) {
  const TemporaryFolder folder;
  Trajectory trajectory;
  trajectory.origin = GeodeticPoint{45.5, 9.25, 180};
  trajectory.poses.push_back({1317042651.258615, poseFromRpy({1, -2, 3.5}, 0, 0, 0)});
  writeTum(folder / "race.tum", trajectory);
  EXPECT_EQ(textOf(folder / "race.tum"),
            "# map origin (WGS84 lat_deg lon_deg height_m): 45.5000000000 9.2500000000 180.0000\n"
            "# stamp_s x_m y_m z_m qx qy qz qw\n"
            "1317042651.258615 1.0000 -2.0000 3.5000 0.000000000 0.000000000 0.000000000 1.000000000\n");
}

TEST(TumWriter, WritesWhatWriteTumDoes) {
  const TemporaryFolder folder;
  const Trajectory trajectory{GeodeticPoint{45.5, 9.25, 180},
                              {{1.5, poseFromRpy({1, -2, 3.5}, 0, 0, 1)}, {2, Pose::Identity()}}};
  writeTum(folder / "whole.tum", trajectory);
  TumWriter writer(folder / "streamed.tum", trajectory.origin);
  for (const auto& pose : trajectory.poses) writer.write(pose);
  writer.commit();
  EXPECT_EQ(textOf(folder / "streamed.tum"), textOf(folder / "whole.tum"));
}

TEST(TumWriter, NothingAppearsWithoutCommit) {
  const TemporaryFolder folder;
  {
    TumWriter writer(folder / "race.tum", std::nullopt);
    writer.write({1, Pose::Identity()});
    EXPECT_THAT(folder.names(), ElementsAre("race.part.tum"));
  }
  EXPECT_THAT(folder.names(), IsEmpty());
}

TEST(PoseSpool, KeepsPosesForTheFrameThatIsKnownLast) {
  const TemporaryFolder folder;
  const Pose first = poseFromRpy({1, -2, 3.5}, 0.1, 0.2, 1), second = poseFromRpy({7, 0, 1e-9}, 0, 0, -3);
  const Pose T_map_odom = poseFromRpy({0, 0, 0}, 0.3, -0.2, 0);
  writeTum(folder / "turned.tum", {std::nullopt, {{1.5, T_map_odom * first}, {2, T_map_odom * second}}});
  TumWriter writer(folder / "spooled.tum", std::nullopt);
  {
    PoseSpool spool(folder / "spooled.tum");
    spool.add({1.5, first});
    spool.add({2, second});
    spool.writeTo(writer, T_map_odom);
  }
  writer.commit();
  EXPECT_EQ(textOf(folder / "spooled.tum"), textOf(folder / "turned.tum"));
  EXPECT_THAT(folder.names(), UnorderedElementsAre("spooled.tum", "turned.tum"));
}

constexpr double kHalfABin = 1.01e-3;

TEST(RunningQuantiles, AreThoseOfTheValuesToATenthOfAPercent) {
  RunningQuantiles running;
  EXPECT_EQ(running.at(0.5), 0);
  EXPECT_EQ(running.max(), 0);
  std::vector<double> values;
  for (int i = 0; i < 1000; ++i) values.push_back(1e-3 * std::pow(1.007, (i * 613) % 1000));
  for (const double value : values) running.add(value);
  for (const double share : {0., 0.01, 0.5, 0.99, 1.}) {
    const double expected = quantile(values, share);
    EXPECT_NEAR(running.at(share), expected, kHalfABin * expected) << share;
  }
  EXPECT_LE(running.at(1), running.max());
  EXPECT_EQ(running.max(), quantile(values, 1));
}

TEST(RunningQuantiles, WhatIsBeyondTheirRangeIsAtItsEnd) {
  RunningQuantiles running;
  for (const double value : {0., 1e9}) running.add(value);
  EXPECT_NEAR(running.at(0), 1e-6, kHalfABin * 1e-6);
  EXPECT_NEAR(running.at(1), 1e3, kHalfABin * 1e3);
  EXPECT_EQ(running.max(), 1e9);
}

TEST(TumWriter, AFolderThatIsMissingIsNamedAtOnce) {
  EXPECT_THAT(complaint([] { TumWriter("/nonexistent/race.tum", std::nullopt); }),
              HasSubstr("output /nonexistent/race.tum: cannot be written"));
}

TEST(TumWriter, AFullDiskLeavesTheOldTrajectory) {
  const TemporaryFolder folder;
  const std::string path = written(folder, "race.tum", "old");
  rlimit limit{};
  getrlimit(RLIMIT_FSIZE, &limit);
  const auto handler = std::signal(SIGXFSZ, SIG_IGN);
  for (const int poses : {10, 10'000}) {  // found out by commit(), and by write()
    const rlimit small{300, limit.rlim_max};
    setrlimit(RLIMIT_FSIZE, &small);
    int accepted = 0;
    const std::string error = complaint([&] {
      TumWriter writer(path, std::nullopt);
      for (; accepted < poses; ++accepted) writer.write({1.0 * accepted, Pose::Identity()});
      writer.commit();
    });
    setrlimit(RLIMIT_FSIZE, &limit);
    EXPECT_THAT(error, HasSubstr("output " + path + ": cannot be written"));
    EXPECT_LT(accepted, 1000);
    EXPECT_THAT(folder.names(), ElementsAre("race.tum"));
    EXPECT_EQ(textOf(path), "old");
  }
  std::signal(SIGXFSZ, handler);
}

}  // namespace
}  // namespace raceloc
