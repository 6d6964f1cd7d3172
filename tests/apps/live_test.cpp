/** \file
 * raceloc-live as it runs in a car: at the pace of a clock, on sensors, ended by a signal, heard by others. */
#include <gmock/gmock.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <regex>
#include <sstream>

#include "apps/apps.h"
#include "apps/refused.h"
#include "support/sensors.h"
#include "support/wait.h"

namespace {

using namespace raceloc::test;
using ::testing::HasSubstr;
using ::testing::MatchesRegex;
using ::testing::UnorderedElementsAre;

const DriveFiles kDrive("synthetic");

/** The shipped options with another value of a key of [live]. */
std::string liveIni(const TemporaryFolder& folder, const std::string& key, const std::string& value) {
  const auto text = readFile(ini("live.ini"));
  const auto changed =
      std::regex_replace(text, std::regex("\n" + key + " = [^\n]*"), "\n" + key + " = " + value);
  EXPECT_NE(changed, text);
  writeFile(folder / "live.ini", changed);
  return folder / "live.ini";
}

std::vector<std::string> with(std::vector<std::string> command, const std::vector<std::string>& more) {
  command.insert(command.end(), more.begin(), more.end());
  return command;
}

TEST(Live, PlayingItsBlackBoxGivesTheSameBits) {
  const TemporaryFolder live, again, from_log;
  const auto paced = require(runCommand(with(liveCommand(ini("live.ini"), kDrive.map(), kDrive.race(), live),
                                             {"--speed", "8", "--record", live / "box.rawlog"})));
  (void)require(runCommand(liveCommand(ini("live.ini"), kDrive.map(), live / "box.rawlog", again)));
  EXPECT_GT(readFile(live / "race.tum").size(), 1000U);
  EXPECT_EQ(readFile(live / "race.tum"), readFile(again / "race.tum"));
  EXPECT_TRUE(readFile(live / "out.rawlog") == readFile(again / "out.rawlog"));
  EXPECT_THAT(live.names(), UnorderedElementsAre("box.rawlog", "out.rawlog", "race.tum"));
  if (paced.out.find("dropped, the localizer was too slow") != std::string::npos)
    return;  // a slow machine, on which the log cannot be kept up with
  (void)require(runCommand(liveCommand(ini("live.ini"), kDrive.map(), kDrive.race(), from_log)));
  EXPECT_EQ(readFile(live / "race.tum"), readFile(from_log / "race.tum"));
}

TEST(Live, ARunThatDropsScansIsReplayedToo) {
  const TemporaryFolder live, again;
  const auto few = liveIni(live, "queue_length", "3");
  const auto paced = require(runCommand(with(liveCommand(few, kDrive.map(), kDrive.race(), live),
                                             {"--speed", "1000", "--record", live / "box.rawlog"})));
  EXPECT_THAT(paced.out, HasSubstr("dropped, the localizer was too slow"));
  const auto replayed = runCommand(liveCommand(few, kDrive.map(), live / "box.rawlog", again));
  if (paced.out.find("start            NONE") != std::string::npos) {
    EXPECT_EQ(replayed.exit_code, 2);
    return;
  }
  EXPECT_EQ(replayed.exit_code, 0) << replayed.err;
  EXPECT_EQ(readFile(live / "race.tum"), readFile(again / "race.tum"));
  EXPECT_TRUE(readFile(live / "out.rawlog") == readFile(again / "out.rawlog"));
}

// ---- the stream, with the clients that are shipped

const std::string kPythonClient = std::string(ROOT) + "/share/clients/pose_client.py";

/** What a program names after `words` on stderr, up to the end of the line. */
std::string named(const RunningCommand& program, const std::string& words) {
  std::smatch found;
  std::string text;
  const bool came = comesTrue([&] {
    text = program.errSoFar();
    return std::regex_search(text, found, std::regex(words + "([^\n]*)\n"));
  });
  return came ? found[1].str() : "nothing";
}

/** Lines of a client say what the trajectory says. */
void expectPosesOf(const std::string& trajectory, const std::string& lines, int count) {
  std::vector<std::array<double, 3>> poses;  // stamp, x, y
  std::istringstream tum(trajectory);
  for (std::string line; std::getline(tum, line);) {
    std::array<double, 3> pose{};
    if (std::sscanf(line.c_str(), "%lf %lf %lf", &pose[0], &pose[1], &pose[2]) == 3) poses.push_back(pose);
  }
  std::istringstream said(lines);
  int matched = 0;
  for (std::string line; std::getline(said, line);) {
    SCOPED_TRACE(line);
    double stamp_s = 0, x_m = 0, y_m = 0;
    ASSERT_EQ(std::sscanf(std::regex_replace(line, std::regex(" age [^ ]+"), "").c_str(), "%lf x %lf y %lf",
                          &stamp_s, &x_m, &y_m),
              3);
    matched += static_cast<int>(std::count_if(poses.begin(), poses.end(), [&](const auto& pose) {
      constexpr double kDigits = 1e-3;  // that the clients print
      return std::abs(pose[0] - stamp_s) < kDigits && std::abs(pose[1] - x_m) < kDigits &&
             std::abs(pose[2] - y_m) < kDigits;
    }));
  }
  EXPECT_GE(matched, count);
}

TEST(Live, ClientsReadTheStreamOverTcp) {
  const TemporaryFolder out;
  RunningCommand live(
      with(liveCommand(liveIni(out, "stream", "tcp://127.0.0.1:0"), kDrive.map(), kDrive.race(), out),
           {"--speed", "1"}));
  const auto url = named(live, "stream ");
  ASSERT_THAT(url, MatchesRegex("tcp://127.0.0.1:[0-9]+"));
  RunningCommand python({kPythonClient, url, "--count", "5"}), cpp({app("pose_client"), url, "5"});
  const auto a = require(python.wait()), b = require(cpp.wait());
  const auto run = require(live.wait());
  expectPosesOf(readFile(out / "race.tum"), a.out, 5);
  expectPosesOf(readFile(out / "race.tum"), b.out, 5);
  EXPECT_TRUE(std::regex_search(a.out, std::regex("age [0-9]+\\.[0-9]")))
      << a.out;  // by the clock of the log
  EXPECT_THAT(run.err, HasSubstr("outputs/s"));
  EXPECT_THAT(run.err, HasSubstr("CPU"));
}

class LiveClient : public ::testing::TestWithParam<std::vector<std::string>> {};
INSTANTIATE_TEST_SUITE_P(
    Clients, LiveClient,
    ::testing::Values(std::vector<std::string>{kPythonClient, "udp://127.0.0.1:0", "--count", "5"},
                      std::vector<std::string>{app("pose_client"), "udp://127.0.0.1:0", "5"}),
    [](const auto& test) { return test.param[0] == kPythonClient ? "python" : "cpp"; });

TEST_P(LiveClient, ReadsTheStreamOverUdp) {
  const TemporaryFolder out;
  RunningCommand client(GetParam());
  const auto url = named(client, "listening on ");
  (void)require(runCommand(liveCommand(liveIni(out, "stream", url), kDrive.map(), kDrive.race(), out)));
  expectPosesOf(readFile(out / "race.tum"), require(client.wait()).out, 5);
}

// ---- sensors, and the end of a run

std::string gpsSection(const std::string& port) {
  return "[gps]\ndriver = CGPSInterface\nsensorLabel = gps_left\nCOM_port_LIN = " + port +
         "\nbaudRate = 115200\n";
}
std::string lidarSection() {
  return "[lidar]\ndriver = CVelodyneScanner\nsensorLabel = lidar_top\nmodel = VLP16\ndata_port = " +
         std::to_string(freeUdpPort()) + "\nposition_port = " + std::to_string(freeUdpPort()) + "\n";
}
std::vector<std::string> sensorsCommand(const std::string& sensors_ini, const TemporaryFolder& out) {
  return {app("raceloc-live"), "-c", ini("live.ini"),    "-m",           kDrive.map(),     "--sensors",
          sensors_ini,         "-o", out / "out.rawlog", "--trajectory", out / "race.tum", "--record",
          out / "box.rawlog"};
}

class LiveSignal : public ::testing::TestWithParam<int> {};
INSTANTIATE_TEST_SUITE_P(Signals, LiveSignal, ::testing::Values(SIGINT, SIGTERM),
                         [](const auto& test) { return test.param == SIGINT ? "ctrl_c" : "sigterm"; });

TEST_P(LiveSignal, EndsARunOnSensorsAndKeepsItsFilesWhole) {
  const TemporaryFolder in, out;
  const SerialLine line;
  writeFile(in / "sensors.ini", gpsSection(line.port()) + lidarSection());
  RunningCommand live(sensorsCommand(in / "sensors.ini", out));
  EXPECT_THAT(named(live, "lidar_top SILENT"), HasSubstr("for"));  // and so the line is open
  line.send("GPRMC,120000.00,A,4858.92,N,00823.424,E,10.0,90.0,280325,,,A");
  line.send("GPGGA,120000.00,4858.92,N,00823.424,E,4,12,0.8,116.4,M,48.0,M,,");
  EXPECT_THAT(named(live, "gps_left (?!0\\.0|SILENT)"), HasSubstr("Hz"));
  live.kill(GetParam());
  const auto run = live.wait();
  EXPECT_EQ(run.exit_code, 128 + GetParam());
  EXPECT_THAT(run.err, HasSubstr("stopped after"));
  EXPECT_THAT(run.err, HasSubstr(out / "box.rawlog (2 observations)"));
  EXPECT_THAT(run.out, HasSubstr("start            NONE"));
  EXPECT_THAT(out.names(), UnorderedElementsAre("box.rawlog", "out.rawlog"));  // no pose, no trajectory
  const auto replayed = runCommand(liveCommand(ini("live.ini"), kDrive.map(), out / "box.rawlog", out));
  EXPECT_THAT(replayed.err,
              HasSubstr("no LiDAR observation"));  // it is read to its end, and says what is missing
}

TEST_P(LiveSignal, EndsAPacedLogAndKeepsItsFilesWhole) {
  const TemporaryFolder out, again;
  RunningCommand live(
      with(liveCommand(liveIni(out, "stream", "tcp://127.0.0.1:0"), kDrive.map(), kDrive.race(), out),
           {"--speed", "1", "--record", out / "box.rawlog"}));
  (void)require(RunningCommand({app("pose_client"), named(live, "stream "), "5"}).wait());  // it has started
  live.kill(GetParam());
  const auto run = live.wait();
  EXPECT_EQ(run.exit_code, 128 + GetParam());
  EXPECT_THAT(run.err, HasSubstr("kept " + out / "box.rawlog"));
  (void)require(runCommand(liveCommand(ini("live.ini"), kDrive.map(), out / "box.rawlog", again)));
  EXPECT_EQ(readFile(out / "race.tum"), readFile(again / "race.tum"));
  EXPECT_TRUE(readFile(out / "out.rawlog") == readFile(again / "out.rawlog"));
}

class BadLive : public BadInput {
 protected:
  void expectRefusedSensors(const std::string& sensors, const std::vector<std::string>& said) {
    writeFile(in / "sensors.ini", sensors);
    auto all = said;
    all.push_back(in / "sensors.ini");
    expectRefused(sensorsCommand(in / "sensors.ini", out), all);
  }
};

TEST_F(BadLive, SensorsAreRefusedInOneLine) {
  expectRefused(sensorsCommand(in / "nowhere.ini", out), {in / "nowhere.ini"});
  expectRefusedSensors("[gps]\ndriver = CGpsInterface\nsensorLabel = gps\n",
                       {"[gps]", "did you mean CGPSInterface"});
  expectRefusedSensors("[gps]\ndriver = CGPSInterface\nsensorLabel = gps\nbaudRate = 9600\n",
                       {"[gps]", "COM_port_LIN"});
  expectRefusedSensors(gpsSection("/dev/nowhere"), {"[gps]", "/dev/nowhere", "No such file"});
  expectRefusedSensors(gpsSection(in / "sensors.ini"), {"[gps]", "CGPSInterface cannot be opened"});
}

TEST_F(BadLive, ArgumentsThatDoNotGoTogether) {
  const auto play = liveCommand(ini("live.ini"), kDrive.map(), kDrive.race(), out);
  expectRefused(with(play, {"--speed", "0"}), {"--speed"});
  expectRefused(with(play, {"--record", out / "box.rawlog"}), {"--record"});
  expectRefused(with(play, {"--speed", "1", "--record", kDrive.race()}), {kDrive.race(), "is an input too"});
  expectRefused(with(play, {"--speed", "1", "--record", out / "out.rawlog"}), {"written twice"});
  expectRefused(with(play, {"--sensors", in / "s.ini"}), {"not both"});
  expectRefused({app("raceloc-live"), "-c", ini("live.ini"), "--odometry-only", "-i", kDrive.race(),
                 "--speed", "1", "--trajectory", out / "x.tum"},
                {"--odometry-only"});
}

TEST_F(BadLive, RaceLineIsMissingOrOfAnotherPlace) {
  const auto play = liveCommand(ini("live.ini"), kDrive.map(), kDrive.race(), out);
  expectRefused(with(play, {"--race-line", in / "nowhere.csv"}), {in / "nowhere.csv"});
  std::string far = "x_m,y_m\n";
  for (int i = 0; i < 20; ++i)
    far += std::to_string(1e5 + 30 * std::cos(0.1 * M_PI * i)) + "," +
           std::to_string(30 * std::sin(0.1 * M_PI * i)) + "\n";
  writeFile(in / "far.csv", far);
  expectRefused(with(play, {"--race-line", in / "far.csv"}), {"race line", "nowhere driven along it"});
  expectRefused({app("raceloc-live"), "-c", ini("live.ini"), "--odometry-only", "-i", kDrive.race(),
                 "--race-line", in / "far.csv", "--trajectory", out / "x.tum"},
                {"--odometry-only"});
}

TEST_F(BadLive, StreamGoesNowhere) {
  for (const auto& [url, said] : {std::pair{"pigeon://127.0.0.1:9750", "udp://HOST:PORT"},
                                  {"udp://127.0.0.1:0", "port 0"},
                                  {"tcp://192.0.2.1:9750", "cannot listen there"}})
    expectRefused(liveCommand(liveIni(in, "stream", url), kDrive.map(), kDrive.race(), out), {url, said});
}

}  // namespace
