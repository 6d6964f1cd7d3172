/** \file
 * What a user can get wrong ends in one clear line and exit 2, and leaves no file behind. */
#include <gmock/gmock.h>
#include <mrpt/io/CFileGZInputStream.h>
#include <mrpt/io/CFileGZOutputStream.h>
#include <mrpt/maps/registerAllClasses.h>
#include <mrpt/obs/CObservationGPS.h>
#include <mrpt/obs/CObservationIMU.h>
#include <mrpt/obs/CObservationPointCloud.h>
#include <mrpt/serialization/CArchive.h>

#include <algorithm>
#include <chrono>
#include <filesystem>
#include <fstream>
#include <regex>
#include <sstream>

#include "apps/refused.h"

namespace {

namespace fs = std::filesystem;
using namespace raceloc::test;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::StartsWith;

const DriveFiles kDrive("synthetic");

// ---- logs and ini files: raceloc-map and raceloc-live read them alike

class BadLogOrIni : public BadInput, public ::testing::WithParamInterface<std::string> {
 protected:
  [[nodiscard]] std::vector<std::string> command(const std::string& ini_path, const std::string& log) const {
    return GetParam() == "map" ? mapCommand(ini_path, log, out)
                               : liveCommand(ini_path, kDrive.map(), log, out);
  }
  [[nodiscard]] std::string goodIni() const { return ini(GetParam() + ".ini"); }
  [[nodiscard]] std::string goodLog() const { return GetParam() == "map" ? kDrive.survey() : kDrive.race(); }
  /** The shipped ini file with the first match of `pattern` replaced. */
  [[nodiscard]] std::string changedIni(const std::string& pattern, const std::string& replacement) const {
    const auto text = readFile(goodIni());
    const auto changed = std::regex_replace(text, std::regex(pattern, std::regex::multiline), replacement,
                                            std::regex_constants::format_first_only);
    EXPECT_NE(changed, text) << pattern;
    writeFile(in / "changed.ini", changed);
    return in / "changed.ini";
  }
};
INSTANTIATE_TEST_SUITE_P(Apps, BadLogOrIni, ::testing::Values("map", "live"),
                         [](const auto& test) { return test.param; });

TEST_P(BadLogOrIni, LogIsMissing) {
  expectRefused(command(goodIni(), in / "nowhere.rawlog"), {in / "nowhere.rawlog"});
}

TEST_P(BadLogOrIni, LogIsEmpty) {
  writeFile(in / "empty.rawlog", "");
  expectRefused(command(goodIni(), in / "empty.rawlog"), {in / "empty.rawlog"});
}

TEST_P(BadLogOrIni, LogIsSomethingElse) {
  writeFile(in / "letter.rawlog", "Dear driver,\nthis is not a log.\n");
  expectRefused(command(goodIni(), in / "letter.rawlog"), {in / "letter.rawlog: not a rawlog"});
}

TEST_P(BadLogOrIni, LogIsTruncated) {
  for (const double share : {0.1, 0.5, 0.9}) {
    SCOPED_TRACE(share);
    const auto cut = in / "cut.rawlog";
    fs::copy_file(goodLog(), cut, fs::copy_options::overwrite_existing);
    fs::resize_file(cut, static_cast<std::uintmax_t>(share * static_cast<double>(fs::file_size(goodLog()))));
    expectRefused(command(goodIni(), cut), {cut});
  }
}

/** Copies the objects of a log for which `keep`, which may change them, says so. */
template <class Keep>
void copyLog(const fs::path& log, const fs::path& copy, const Keep& keep) {
  mrpt::maps::registerAllClasses_mrpt_maps();
  mrpt::io::CFileGZInputStream all(log);
  mrpt::io::CFileGZOutputStream kept(copy);
  auto from = mrpt::serialization::archiveFrom(all);
  auto to = mrpt::serialization::archiveFrom(kept);
  try {
    for (;;) {
      const auto object = from.ReadObject();
      if (keep(object)) to << *object;
    }
  } catch (const mrpt::serialization::CExceptionEOF&) {
  }
}

TEST_P(BadLogOrIni, LogHasNoLidar) {
  const auto blind = in / "blind.rawlog";
  copyLog(goodLog(), blind, [](const auto& object) {
    return !std::dynamic_pointer_cast<mrpt::obs::CObservationPointCloud>(object);
  });
  expectRefused(command(goodIni(), blind), {blind, "LiDAR"});
}

TEST_P(BadLogOrIni, ImuHasAClockOfItsOwn) {
  for (const bool ahead : {false, true}) {
    const auto log = in / (ahead ? "ahead.rawlog" : "uptime.rawlog");
    copyLog(goodLog(), log, [&](const auto& object) {
      using namespace std::chrono_literals;
      if (const auto imu = std::dynamic_pointer_cast<mrpt::obs::CObservationIMU>(object))
        imu->timestamp += ahead ? 24h : -24h;
      return true;
    });
    expectRefused(command(goodIni(), log),
                  {log, "imu", ahead ? "after the last scan" : "before the first scan"});
  }
}

TEST_P(BadLogOrIni, GpsWeekHasRolledOver) {
  const auto log = in / "rollover.rawlog";
  copyLog(goodLog(), log, [](const auto& object) {
    if (const auto gps = std::dynamic_pointer_cast<mrpt::obs::CObservationGPS>(object))
      gps->timestamp -= std::chrono::hours(1024 * 7 * 24);
    return true;
  });
  expectRefused(command(goodIni(), log), {log, "gps", "week number"});
}

TEST_P(BadLogOrIni, LabelIsNotInTheLog) {
  expectRefused(command(changedIni("^lidar_labels *=[^/#;\n]*", "lidar_labels = lidar_roof "), goodLog()),
                {goodLog(), "lidar_roof"});
  expectRefused(command(changedIni("^imu_labels *=[^/#;\n]*", "imu_labels = imu_roof "), goodLog()),
                {goodLog(), "imu_roof", "IMU labels in it: "});
}

TEST_P(BadLogOrIni, IniIsMissing) {
  expectRefused(command(in / "nowhere.ini", goodLog()), {in / "nowhere.ini"});
}

TEST_P(BadLogOrIni, IniIsSomethingElse) {
  writeFile(in / "letter.ini", "Dear driver,\nthis is no ini.\n");
  expectRefused(command(in / "letter.ini", goodLog()), {in / "letter.ini:1: ", "Dear driver"});
}

TEST_P(BadLogOrIni, IniHasALineWithoutEquals) {
  expectRefused(command(changedIni("^voxel_size_m *= *", "voxel_size_m "), goodLog()),
                {in / "changed.ini:", "voxel_size_m 1"});
}

TEST_P(BadLogOrIni, KeyIsMisspelled) {
  const auto path = changedIni("^voxel_size_m", "voxel_sise_m");
  expectRefused(command(path, goodLog()), {path, "voxel_sise_m", "voxel_size_m"});
}

TEST_P(BadLogOrIni, SectionIsMisspelled) {
  const auto path = changedIni("^\\[registration\\]", "[regstration]");
  expectRefused(command(path, goodLog()), {path, "regstration"});
}

TEST_P(BadLogOrIni, ValueIsNoNumber) {
  const auto path = changedIni("^voxel_size_m *=[^/#;\n]*", "voxel_size_m = one ");
  expectRefused(command(path, goodLog()), {path, "voxel_size_m", "one"});
}

TEST_P(BadLogOrIni, ValueIsOutOfRange) {
  const auto path = changedIni("^voxel_size_m *=[^/#;\n]*", "voxel_size_m = -1 ");
  expectRefused(command(path, goodLog()), {path, "voxel_size_m", "-1"});
}

// ---- outputs, of whichever app

/** A command line and the option whose value is an output. */
struct Output {
  std::string name;
  std::vector<std::string>
      command;  ///< `%` stands for the output under test, `@` for the folder of the others
};
std::string paramName(const ::testing::TestParamInfo<Output>& info) { return info.param.name; }

const std::string kKittiFolder = DATA "synthetic/2020_01_01/2020_01_01_drive_0001_sync";

class BadOutput : public BadInput, public ::testing::WithParamInterface<Output> {
 protected:
  [[nodiscard]] std::vector<std::string> commandWriting(const std::string& path) const {
    auto words = GetParam().command;
    words[0] = app(words[0]);
    for (auto& word : words) {
      if (word == "%") word = path;
      if (word[0] == '@') word = out / word.substr(1);
    }
    return words;
  }
};
INSTANTIATE_TEST_SUITE_P(
    Apps, BadOutput,
    ::testing::Values(
        Output{"import_log", {"raceloc-import", "kitti-raw", kKittiFolder, "-o", "%"}},
        Output{"import_truth",
               {"raceloc-import", "kitti-raw", kKittiFolder, "-o", "@x.rawlog", "--truth", "%"}},
        Output{"map", {"raceloc-map", "-c", ini("map.ini"), "-o", "%", kDrive.survey()}},
        Output{"live_log",
               {"raceloc-live", "-c", ini("live.ini"), "-m", kDrive.map(), "-i", kDrive.race(), "-o", "%"}},
        Output{"live_trajectory",
               {"raceloc-live", "-c", ini("live.ini"), "-m", kDrive.map(), "-i", kDrive.race(), "-o",
                "@x.rawlog", "--trajectory", "%"}},
        Output{"eval_report",
               {"raceloc-eval", "--truth", kDrive.truth(), "--estimate", kDrive.truth(), "--report", "%"}},
        Output{"eval_json",
               {"raceloc-eval", "--truth", kDrive.truth(), "--estimate", kDrive.truth(), "--json", "%"}}),
    paramName);

TEST_P(BadOutput, FolderIsMissing) {
  const auto path = in / "nowhere/file";
  expectRefused(commandWriting(path), {path});
}

TEST_P(BadOutput, IsAFolder) {
  fs::create_directory(in / "folder");
  expectRefused(commandWriting(in / "folder"), {in / "folder"});
  EXPECT_TRUE(fs::is_empty(in / "folder"));
  EXPECT_THAT(in.names(), ::testing::ElementsAre("folder"));
}

// ---- the map of raceloc-live

class BadMap : public BadInput {
 protected:
  void expectRefusedMap(const std::string& path) const {
    expectRefused(liveCommand(ini("live.ini"), path, kDrive.race(), out), {path});
  }
};

TEST_F(BadMap, IsMissing) { expectRefusedMap(in / "nowhere.rlmap"); }

TEST_F(BadMap, IsEmpty) {
  writeFile(in / "empty.rlmap", "");
  expectRefusedMap(in / "empty.rlmap");
}

TEST_F(BadMap, IsSomethingElse) { expectRefusedMap(kDrive.race()); }

TEST_F(BadMap, IsTruncated) {
  for (const double share : {0.1, 0.5, 0.9}) {
    SCOPED_TRACE(share);
    const auto cut = in / "cut.rlmap";
    fs::copy_file(kDrive.map(), cut, fs::copy_options::overwrite_existing);
    fs::resize_file(cut, static_cast<std::uintmax_t>(share * static_cast<double>(fs::file_size(cut))));
    expectRefusedMap(cut);
  }
}

TEST_F(BadMap, HasAnotherHash) {
  auto command = liveCommand(ini("live.ini"), kDrive.map(), kDrive.race(), out);
  command.insert(command.end(), {"--map-hash", "md5:0123"});
  expectRefused(command, {kDrive.map(), "content hash is md5:", "map_hash asks for md5:0123"});
}

TEST_F(BadMap, HasADamagedTile) {
  const auto path = in / "damaged.rlmap";
  auto bytes = readFile(kDrive.map());
  const auto middle = static_cast<std::ptrdiff_t>(bytes.size() / 2);
  for (auto byte = bytes.begin() + middle; byte != bytes.begin() + middle + 512; ++byte)
    *byte = static_cast<char>(~*byte);
  writeFile(path, bytes);
  const auto result = runCommand(liveCommand(ini("live.ini"), path, kDrive.race(), out));
  EXPECT_EQ(result.exit_code, 0) << result.err;  // the car goes on without it
  EXPECT_THAT(result.out, HasSubstr("DEGRADED         map " + path + ": damaged: tile ("));
  EXPECT_THAT(result.out, HasSubstr("outputs: a tile of the map near the car is damaged"));
}

TEST_F(BadMap, DisabledLabelIsNotInTheLog) {
  auto command = liveCommand(ini("live.ini"), kDrive.map(), kDrive.race(), out);
  command.insert(command.end(), {"--disable", "gps_* gnss_*"});
  expectRefused(command, {kDrive.race(), "labelled gnss_*"});
}

// ---- recordings for raceloc-import

class BadRecording : public BadInput {
 protected:
  void SetUp() override {
    fs::copy(fs::path(kKittiFolder).parent_path(), in / "day", fs::copy_options::recursive);
  }
  [[nodiscard]] std::string drive() const { return in / "day/2020_01_01_drive_0001_sync"; }
  void expectRefusedDrive(const std::vector<std::string>& named,
                          const std::vector<std::string>& options = {}) const {
    std::vector<std::string> command{app("raceloc-import"), "kitti-raw", drive(),      "-o",
                                     out / "x.rawlog",      "--truth",   out / "x.tum"};
    command.insert(command.end(), options.begin(), options.end());
    expectRefused(command, named);
  }
};

TEST_F(BadRecording, FolderIsMissing) {
  fs::remove_all(drive());
  expectRefusedDrive({drive()});
}

TEST_F(BadRecording, CalibrationIsMissing) {
  fs::remove(in / "day/calib_imu_to_velo.txt");
  expectRefusedDrive({"calib_imu_to_velo.txt"});
}

TEST_F(BadRecording, CalibrationIsEmpty) {
  writeFile(in / "day/calib_imu_to_velo.txt", "");
  expectRefusedDrive({"calib_imu_to_velo.txt"});
}

TEST_F(BadRecording, ScanIsTruncated) {
  const auto scan = drive() + "/velodyne_points/data/0000000010.bin";
  fs::resize_file(scan, fs::file_size(scan) - 7);
  expectRefusedDrive({scan});
}

TEST_F(BadRecording, PacketIsNoNumber) {
  const auto packet = drive() + "/oxts/data/0000000010.txt";
  writeFile(packet, "x" + readFile(packet));
  expectRefusedDrive({packet});
}

TEST_F(BadRecording, StampsAreMissing) {
  fs::remove(drive() + "/velodyne_points/timestamps.txt");
  expectRefusedDrive({drive() + "/velodyne_points/timestamps.txt"});
}

TEST_F(BadRecording, StampsAreTooFew) {
  const auto path = drive() + "/velodyne_points/timestamps_start.txt";
  const auto text = readFile(path);
  writeFile(path, text.substr(0, text.find('\n') + 1));
  expectRefusedDrive({path});
}

TEST_F(BadRecording, OptionsAreWrong) {
  expectRefusedDrive({"--decimate", "some"}, {"--decimate", "some"});
  expectRefusedDrive({"--gps-noise-m", "-3"}, {"--gps-noise-m=-3"});
}

TEST_F(BadInput, FormatIsUnknown) {
  expectRefused({app("raceloc-import"), "kitty-raw", kKittiFolder, "-o", out / "x.rawlog"},
                {"kitty-raw", "kitti-raw"});
}

// ---- trajectories for raceloc-eval

class BadTrajectory : public BadInput {
 protected:
  void expectRefusedEstimate(const std::string& path, const std::vector<std::string>& named = {}) const {
    auto all = named;
    all.push_back(path);
    expectRefused({app("raceloc-eval"), "--truth", kDrive.truth(), "--estimate", path, "--report",
                   out / "r.html", "--json", out / "f.json"},
                  all);
  }
};

TEST_F(BadTrajectory, IsMissing) { expectRefusedEstimate(in / "nowhere.tum"); }

TEST_F(BadTrajectory, IsEmpty) {
  writeFile(in / "empty.tum", "");
  expectRefusedEstimate(in / "empty.tum");
}

TEST_F(BadTrajectory, IsTruncated) {
  const auto text = readFile(kDrive.truth());
  writeFile(in / "cut.tum", text.substr(0, text.rfind(' ')));
  expectRefusedEstimate(in / "cut.tum");
}

TEST_F(BadTrajectory, IsOfAnotherTime) {
  writeFile(in / "late.tum", "1e9 0 0 0 0 0 0 1\n1000000001 1 0 0 0 0 0 1\n");
  expectRefusedEstimate(in / "late.tum", {kDrive.truth()});
}

// ---- command lines

class CommandLines : public BadInput, public ::testing::WithParamInterface<std::string> {};
INSTANTIATE_TEST_SUITE_P(Apps, CommandLines,
                         ::testing::Values("raceloc-import", "raceloc-map", "raceloc-live", "raceloc-eval",
                                           "raceloc-sim"),
                         [](const auto& test) { return test.param.substr(8); });

TEST_P(CommandLines, HelpIsAManual) {
  const auto result = runCommand({app(GetParam()), "--help"});
  EXPECT_EQ(result.exit_code, 0);
  EXPECT_THAT(result.err, IsEmpty());
  for (const std::string part : {"NAME", "EXAMPLE", "EXIT STATUS", "OPTIONS"})
    EXPECT_THAT(result.out, HasSubstr(part));
  EXPECT_THAT(result.out, HasSubstr(GetParam() + " - "));
}

TEST_P(CommandLines, VersionIsOneLine) {
  const auto result = runCommand({app(GetParam()), "--version"});
  EXPECT_EQ(result.exit_code, 0);
  EXPECT_THAT(result.out, ::testing::MatchesRegex(GetParam() + " [0-9]+\\.[0-9]+\\.[0-9]+\n"));
  EXPECT_THAT(result.err, IsEmpty());
}

TEST_P(CommandLines, NoArgumentIsRefused) { expectRefused({app(GetParam())}, {}); }

TEST_P(CommandLines, UnknownOptionIsNamed) {
  expectRefused({app(GetParam()), "--frobnicate"}, {"--frobnicate"});
}

TEST(ShippedIni, HoldsEveryOptionAtItsDefault) {
  for (const std::string name : {"map", "live"}) {
    const auto printed = runCommand({app("raceloc-" + name), "--print-ini"});
    EXPECT_EQ(printed.exit_code, 0);
    std::ifstream in(INI + name + ".ini");
    std::stringstream shipped;
    shipped << in.rdbuf();
    EXPECT_THAT(shipped.str(), ::testing::EndsWith("\n\n" + printed.out));  // behind its title
  }
}

}  // namespace
