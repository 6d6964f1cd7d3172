/** \file
 * Surveys of whole laps to a map: given ..., when ..., then ... . */
#include <gmock/gmock.h>
#include <poll.h>
#include <sys/inotify.h>
#include <sys/syscall.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <regex>
#include <utility>

#include "apps/apps.h"
#include "eval/trajectory_errors.h"
#include "map/map_file.h"

namespace {

using namespace raceloc::test;
using ::testing::HasSubstr;
using ::testing::Not;

/** Two laps and a bit of Lucas Oil Raceway, and one lap of another day, as tests/apps/CMakeLists.txt simulates them. */
class Survey : public ::testing::Test {
 protected:
  static std::string log(const std::string& name) { return DATA "survey/" + name + ".rawlog"; }

  [[nodiscard]] std::vector<std::string> mapping(const std::vector<std::string>& logs,
                                                 const std::vector<std::string>& options = {}) const {
    std::vector<std::string> command{app("raceloc-map"), "-c",           ini("map.ini"),  "-o",
                                     out / "map.rlmap",  "--trajectory", out / "keys.tum"};
    command.insert(command.end(), options.begin(), options.end());
    command.insert(command.end(), logs.begin(), logs.end());
    return command;
  }
  /** The key poses against the truth of a drive. */
  [[nodiscard]] raceloc::Evaluation errors(const std::string& name) const {
    return raceloc::evaluate(raceloc::readTrajectoryFile(DATA "survey/" + name + "_truth.tum"),
                             raceloc::readTrajectoryFile(out / "keys.tum"), {});
  }
  /** Reads the folder's events until there were `events`; false when the program ends before. */
  [[nodiscard]] bool waitFor(int events, const RunningCommand& program, int watch) const {
    const int process = static_cast<int>(syscall(SYS_pidfd_open, program.pid(), 0));
    if (process < 0) throw std::runtime_error("cannot watch the program");
    bool seen = true;
    while (events > 0 && seen) {
      std::array<pollfd, 2> either{pollfd{watch, POLLIN, 0}, pollfd{process, POLLIN, 0}};
      constexpr int kLimit_ms = 300'000;
      seen = poll(either.data(), either.size(), kLimit_ms) > 0 && (either[0].revents & POLLIN) != 0;
      alignas(inotify_event) std::array<char, 4096> buffer{};
      const auto size = seen ? read(watch, buffer.data(), buffer.size()) : 0;
      for (ssize_t at = 0; at < size; --events)
        at += static_cast<ssize_t>(
            sizeof(inotify_event) +
            reinterpret_cast<const inotify_event*>(buffer.data() + at)->len);  // NOLINT: as inotify(7) has it
    }
    close(process);
    return seen;
  }

  const TemporaryFolder out;
};

/** Whether a span of this receiver is told, within two key poses. */
bool isRefused(const std::string& said, const std::string& receiver, double from_s, double to_s) {
  constexpr double kNear_s = 0.2;
  const std::regex line("GPS REFUSED +" + receiver + ", ([0-9.]+) .. ([0-9.]+) s");
  for (std::sregex_iterator span(said.begin(), said.end(), line), end; span != end; ++span)
    if (std::abs(std::stod((*span)[1]) - from_s) < kNear_s &&
        std::abs(std::stod((*span)[2]) - to_s) < kNear_s)
      return true;
  return false;
}

/** The project's figures for a key pose, rmse. */
constexpr double kLateral_m = 0.05, kAlong_m = 0.10, kHeight_m = 0.05;

TEST_F(Survey, TwoLapsCloseAndReceiversThatLieAreNamed) {
  // One receiver, then both by the same 3 m, then noise of 10 m that claims 2 cm.
  writeFile(
      out / "faults.ini",
      "[fault_01]\nkind = gps_step\nlabels = gps_left\nfrom_s = 12\nto_s = 18\neast_m = 4\nnorth_m = 2\n"
      "[fault_02]\nkind = gps_step\nlabels = gps_*\nfrom_s = 30\nto_s = 32\neast_m = -2\nnorth_m = 2\n"
      "[fault_03]\nkind = gps_noise\nlabels = gps_right\nfrom_s = 45\nto_s = 48\nsigma_m = 10\n");
  require(runCommand({app("raceloc-sim"), "inject", "--faults", out / "faults.ini", "-i", log("two_laps"),
                      "-o", out / "faulty.rawlog"}));
  const std::string said = require(runCommand(mapping({out / "faulty.rawlog"}))).out;

  // Times are told from the first key pose, and a fix counts for the key poses beside it: one every 0.1 s.
  const double first_s =
      raceloc::readTrajectoryFile(out / "keys.tum").trajectory.poses.front().stamp_s -
      raceloc::readTrajectoryFile(DATA "survey/two_laps_truth.tum").trajectory.poses.front().stamp_s;
  struct Span {
    const char* receiver;
    double from_s, to_s;
  };
  for (const Span& span :
       {Span{"gps_left", 12, 18}, {"gps_left", 30, 32}, {"gps_right", 30, 32}, {"gps_right", 45, 48}})
    EXPECT_TRUE(isRefused(said, span.receiver, span.from_s - first_s, span.to_s - first_s))
        << span.receiver << " " << span.from_s << "\n"
        << said;
  std::size_t spans = 0;
  for (auto at = said.find("GPS REFUSED"); at != std::string::npos; at = said.find("GPS REFUSED", at + 1))
    ++spans;
  EXPECT_EQ(spans, 4U) << said;
  const auto e = errors("two_laps");
  EXPECT_LT(e.lateral_m.rmse, kLateral_m);
  EXPECT_LT(e.longitudinal_m.rmse, kAlong_m);
  EXPECT_LT(e.height_m.rmse, kHeight_m);

  const raceloc::MapFile map(out / "map.rlmap");
  EXPECT_NO_THROW(map.verify());
  const raceloc::MapContent& content = map.content();
  std::size_t loops = 0, with_id = 0;
  for (const auto& edge : content.edges) loops += edge.kind == raceloc::EdgeKind::loop ? 1 : 0;
  for (const auto& k : content.key_poses) with_id += k.racetrack_id ? 1 : 0;
  EXPECT_GT(loops, 10U);
  EXPECT_EQ(with_id, content.key_poses.size());
  EXPECT_GT(content.road.size(), content.waypoints.size() * 9 / 10);
  EXPECT_GT(content.walls.size(), content.waypoints.size());  // both sides have walls nearly everywhere
}

TEST_F(Survey, WithoutGpsForHalfALapItClosesOnTheNext) {
  writeFile(out / "faults.ini", "[fault_01]\nkind = gps_outage\nlabels = gps_*\nfrom_s = 20\nto_s = 38\n");
  require(runCommand({app("raceloc-sim"), "inject", "--faults", out / "faults.ini", "-i", log("two_laps"),
                      "-o", out / "faulty.rawlog"}));
  require(runCommand(mapping({out / "faulty.rawlog"})));
  constexpr double kCloses_m = 0.3;  // the project's figure
  EXPECT_LT(errors("two_laps").position_plane_m.max, kCloses_m);
}

TEST_F(Survey, AnotherDayComesIntoTheSameMap) {
  const std::string said = require(runCommand(mapping({log("two_laps"), log("one_lap")}))).out;
  EXPECT_THAT(said, HasSubstr("session          two_laps.rawlog"));
  EXPECT_THAT(said, HasSubstr("session          one_lap.rawlog"));
  const raceloc::MapContent content = raceloc::MapFile(out / "map.rlmap").content();
  ASSERT_THAT(content.info.sessions, ::testing::ElementsAre("two_laps.rawlog", "one_lap.rawlog"));
  std::size_t across = 0;
  for (const auto& edge : content.edges)
    if (edge.kind == raceloc::EdgeKind::loop &&
        content.key_poses[static_cast<std::size_t>(edge.i)].session !=
            content.key_poses[static_cast<std::size_t>(edge.j)].session)
      ++across;
  EXPECT_GT(across, 5U);
}

TEST_F(Survey, ALogThatIsAddedLaterMakesTheSameMap) {
  require(runCommand(mapping({log("one_lap"), log("two_laps")})));
  const std::string at_once = readFile(out / "map.rlmap");
  require(runCommand(mapping({log("one_lap")}, {"--replace", "--keep"})));
  const auto added = require(runCommand(mapping({log("one_lap"), log("two_laps")}, {"--resume"})));
  EXPECT_THAT(added.out, HasSubstr("session          one_lap.rawlog, read before"));
  EXPECT_THAT(added.out, HasSubstr("session          two_laps.rawlog\n"));
  EXPECT_TRUE(readFile(out / "map.rlmap") == at_once);
}

TEST_F(Survey, ALogThatWasKeptIsNotLost) {
  require(runCommand(mapping({log("one_lap")}, {"--keep"})));
  const std::string before = readFile(out / "map.rlmap");
  const auto other = runCommand(mapping({log("two_laps")}, {"--resume"}));
  EXPECT_EQ(other.exit_code, 2);
  EXPECT_THAT(other.err, HasSubstr("rawlog one_lap.rawlog: was read"));
  std::filesystem::rename(out / "map.rlmap", out / "aside.rlmap");
  const auto anew = runCommand(mapping({log("two_laps")}));
  EXPECT_EQ(anew.exit_code, 2);
  EXPECT_THAT(anew.err, HasSubstr("map.rlmap.build is there; --resume"));
  EXPECT_TRUE(readFile(out / "aside.rlmap") == before);
}

TEST_F(Survey, NoOutputIsAnInputOrAnotherOutput) {
  std::filesystem::copy_file(log("one_lap"), out / "lap.rawlog");
  const std::string whole = readFile(out / "lap.rawlog");
  const std::vector<std::string> base{app("raceloc-map"), "-c", ini("map.ini"), "-o", out / "map.rlmap"};
  for (const std::string& path : {out / "lap.rawlog", out / "map.rlmap", out / "./map.json"}) {
    auto command = base;
    command.insert(command.end(), {"--trajectory", path, out / "lap.rawlog"});
    const auto result = runCommand(command);
    EXPECT_EQ(result.exit_code, 2);
    EXPECT_THAT(result.err, HasSubstr("output " + path));
  }
  EXPECT_TRUE(readFile(out / "lap.rawlog") == whole);
}

TEST_F(Survey, ARaceLineOfAnotherPlaceIsRefused) {
  std::string line = "x_m,y_m\n";
  for (int k = 0; k < 100; ++k)
    line += std::to_string(5000 + 100 * std::cos(0.02 * M_PI * k)) + "," +
            std::to_string(100 * std::sin(0.02 * M_PI * k)) + "\n";
  writeFile(out / "line.csv", line);
  const auto result = runCommand(mapping({log("one_lap")}, {"--race-line", out / "line.csv"}));
  EXPECT_EQ(result.exit_code, 2);
  EXPECT_THAT(result.err, HasSubstr("race line: the survey is nowhere near it"));
}

TEST_F(Survey, ARefusedLogIsRefusedAgainInTheSameWords) {
  std::string options = readFile(ini("map.ini"));
  const std::regex gap("\ngps_max_gap_s = [0-9.]+\n");
  ASSERT_TRUE(std::regex_search(options, gap));
  writeFile(out / "map.ini", std::regex_replace(options, gap, "\ngps_max_gap_s = 0.001\n"));
  auto command = mapping({log("one_lap")});
  *std::find(command.begin(), command.end(), ini("map.ini")) = out / "map.ini";
  const auto first = runCommand(command), second = runCommand(command);
  EXPECT_EQ(first.exit_code, 2);
  EXPECT_THAT(first.err, HasSubstr("one_lap.rawlog: GPS fixes"));
  EXPECT_EQ(second.err, first.err);
}

TEST_F(Survey, OneThreadMakesTheSameMapAsTwo) {
  const auto hash = [&] { return raceloc::MapFile(out / "map.rlmap").contentHash(); };
  require(runCommand(mapping({log("one_lap")})));
  const std::string two = hash();
  auto one = mapping({log("one_lap")}, {"--replace"});
  std::string options = readFile(ini("map.ini"));
  const std::string threads = "\nthreads = 2\n";
  ASSERT_NE(options.find(threads), std::string::npos);
  writeFile(out / "map.ini", options.replace(options.find(threads), threads.size(), "\nthreads = 1\n"));
  *std::find(one.begin(), one.end(), ini("map.ini")) = out / "map.ini";
  require(runCommand(one));
  EXPECT_EQ(hash(), two);
}

TEST_F(Survey, TwoLogsOfOneNameAreRefused) {
  const auto result = runCommand(mapping({log("one_lap"), log("one_lap")}));
  EXPECT_EQ(result.exit_code, 2);
  EXPECT_THAT(result.err, HasSubstr(log("one_lap")));
  EXPECT_THAT(result.err, HasSubstr("have one name"));
}

TEST_F(Survey, AMapThatIsThereStays) {
  writeFile(out / "map.rlmap", "a map");
  for (const std::vector<std::string>& options : {std::vector<std::string>{}, {"--resume"}}) {
    const auto result = runCommand(mapping({log("one_lap")}, options));
    EXPECT_EQ(result.exit_code, 2);
    EXPECT_THAT(result.err, HasSubstr("map.rlmap: is there already"));
    EXPECT_THAT(result.err, HasSubstr("--replace"));
  }
  EXPECT_EQ(readFile(out / "map.rlmap"), "a map");
  std::filesystem::remove(out / "map.rlmap");
  for (const std::string name : {"map.html", "map.json", "map.simplemap", "map.3Dscene"}) {
    writeFile(out / name, "mine");
    const auto result = runCommand(mapping({log("one_lap")}));
    EXPECT_EQ(result.exit_code, 2);
    EXPECT_THAT(result.err, HasSubstr(name + ": is there already"));
    EXPECT_EQ(readFile(out / name), "mine");
    std::filesystem::remove(out / name);
  }
}

TEST_F(Survey, StoppedItSaysHowToGoOnAndMakesTheSameMap) {
  require(runCommand(mapping({log("one_lap")})));
  const std::string whole = readFile(out / "map.rlmap");
  for (const int signal : {SIGINT, SIGTERM}) {
    RunningCommand map(mapping({log("one_lap")}, {"--replace"}));
    const int watch = inotify_init1(IN_CLOEXEC);
    ASSERT_GE(watch, 0);
    ASSERT_GE(inotify_add_watch(watch, (out / "").c_str(), IN_MODIFY), 0);
    ASSERT_TRUE(waitFor(300, map, watch));
    close(watch);
    map.kill(signal);
    const auto stopped = map.wait();
    EXPECT_EQ(stopped.exit_code, 128 + signal);
    EXPECT_THAT(stopped.err,
                HasSubstr("raceloc-map: stopped; what is done is kept in " + (out / "map.rlmap.build")));
    EXPECT_THAT(stopped.err, HasSubstr("--resume"));
    EXPECT_EQ(std::count(stopped.err.begin(), stopped.err.end(), '\n'), 1) << stopped.err;
    EXPECT_TRUE(readFile(out / "map.rlmap") == whole);
  }
  require(runCommand(mapping({log("one_lap")}, {"--resume"})));
  EXPECT_TRUE(readFile(out / "map.rlmap") == whole);
  EXPECT_FALSE(std::filesystem::exists(out / "map.rlmap.build"));
}

TEST_F(Survey, WhatIsWrongWithALogIsNamedAndInItsVerdict) {
  writeFile(out / "faults.ini",
            "[fault_01]\nkind = lidar_times_absent\nlabels = lidar_front\nfrom_s = 5\nto_s = 7\n"
            "[fault_02]\nkind = stamp_jump\nlabels = gps_left\nfrom_s = 10\nto_s = 10.04\njump_s = 3600\n"
            "[fault_03]\nkind = lidar_off\nlabels = lidar_front\nfrom_s = 15\nto_s = 15.5\n");
  require(runCommand({app("raceloc-sim"), "inject", "--faults", out / "faults.ini", "-i", log("one_lap"),
                      "-o", out / "faulty.rawlog"}));
  std::string options = readFile(ini("map.ini"));
  const std::string all = "\ngps_labels = *\n";
  ASSERT_NE(options.find(all), std::string::npos);
  writeFile(out / "map.ini",
            options.replace(options.find(all), all.size(), "\ngps_labels = gps_* gnss_top\n"));
  auto command = mapping({out / "faulty.rawlog"});
  *std::find(command.begin(), command.end(), ini("map.ini")) = out / "map.ini";
  const std::string said = require(runCommand(command)).out;
  EXPECT_THAT(said, Not(HasSubstr("dropped ")));
  const auto figures = nlohmann::json::parse(readFile(out / "map.json"));
  const std::string verdict = figures.at("verdict"), page = readFile(out / "map.html");
  const std::string faults = figures.at("sessions").at(0).at("faults").dump();
  for (const std::string fault :
       {"LiDAR lidar_front: no point times, scan taken as it is", "LiDAR lidar_front: silent",
        "gps_left: stamp far ahead of all others', sample left out",
        "GPS gnss_top: not in the log, which has gps_left, gps_right"}) {
    EXPECT_THAT(said, HasSubstr("DEGRADED         " + fault));
    EXPECT_THAT(verdict, HasSubstr(fault));
    EXPECT_THAT(faults, HasSubstr(fault));
    EXPECT_THAT(page, HasSubstr(fault.substr(0, fault.find('\''))));  // which HTML spells otherwise
  }
  EXPECT_THAT(verdict, HasSubstr("; scans used as they are: LiDAR lidar_front"));
  EXPECT_LT(errors("one_lap").lateral_m.rmse, kLateral_m);
}

TEST_F(Survey, KilledAtAnyMomentItGoesOnAndMakesTheSameMap) {
  require(runCommand(mapping({log("one_lap")})));
  const std::string whole = readFile(out / "map.rlmap");
  for (const std::string name : {"rlmap", "html", "json", "simplemap", "3Dscene"})
    std::filesystem::remove(out / "map." + name);
  for (const int events : {5, 300, 900}) {  // about: equal events that are not yet read become one
    const int watch = inotify_init1(IN_CLOEXEC);
    ASSERT_GE(watch, 0);
    ASSERT_GE(inotify_add_watch(watch, (out / "").c_str(), IN_MODIFY), 0);
    RunningCommand map(mapping({log("one_lap")}, {"--resume"}));
    ASSERT_TRUE(waitFor(events, map, watch));
    map.kill();
    EXPECT_EQ(map.wait().exit_code, 128 + SIGKILL);
    close(watch);
    EXPECT_FALSE(std::filesystem::exists(out / "map.rlmap"));
  }
  require(runCommand(mapping({log("one_lap")}, {"--resume"})));
  EXPECT_TRUE(readFile(out / "map.rlmap") == whole);
  for (const auto& name : out.names()) {
    EXPECT_THAT(name, Not(HasSubstr(".part")));
    EXPECT_THAT(name, Not(HasSubstr(".build")));
  }
}

TEST_F(Survey, ALogWithoutGpsAmongOthersIsNamed) {
  require(
      runCommand({app("raceloc-sim"), "--track", ROOT "/share/tracks/lor.ini", "--car", ini("sim/indy.ini"),
                  "--devices", "lidar_front imu vehicle", "--laps", "0.2", "-o", out / "blind.rawlog"}));
  const auto result = runCommand(mapping({log("one_lap"), out / "blind.rawlog"}));
  EXPECT_EQ(result.exit_code, 2);
  EXPECT_THAT(result.err, HasSubstr("blind.rawlog: no GPS"));
}

TEST_F(Survey, AnotherTrackIsNamed) {
  require(
      runCommand({app("raceloc-sim"), "--track", ROOT "/share/tracks/ims.ini", "--car", ini("sim/indy.ini"),
                  "--devices", "lidar_front gps_* imu vehicle", "--laps", "0.1", "-o", out / "ims.rawlog"}));
  const auto result = runCommand(mapping({log("one_lap"), out / "ims.rawlog"}));
  EXPECT_EQ(result.exit_code, 2);
  EXPECT_THAT(result.err, HasSubstr("ims.rawlog: "));
  EXPECT_THAT(result.err, HasSubstr("of another place"));
}

}  // namespace
