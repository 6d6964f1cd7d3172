/** \file
 * raceloc-sim as its users run it. */
#include <gmock/gmock.h>

#include <fstream>
#include <map>
#include <regex>
#include <sstream>

#include "apps/refused.h"
#include "core/trajectory.h"

namespace {

using namespace raceloc::test;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Not;
using ::testing::UnorderedElementsAre;

std::string track(const std::string& name) { return ROOT "/share/tracks/" + name + ".ini"; }
std::string fault(const std::string& name) { return ini("sim/faults/" + name + ".ini"); }

/** The Indy car with LiDARs of 8 x 60 points: all devices, little data. */
std::string smallCar(const TemporaryFolder& folder) {
  const auto text = readFile(ini("sim/indy.ini"));
  auto small = std::regex_replace(text, std::regex("\nbeams = [0-9]+"), "\nbeams = 8");
  small = std::regex_replace(small, std::regex("\ncolumns = [0-9]+"), "\ncolumns = 60");
  writeFile(folder / "small.ini", small);
  return folder / "small.ini";
}

std::vector<std::string> simCommand(const std::string& car, const std::string& log,
                                    const std::vector<std::string>& more = {},
                                    const std::string& track_path = track("lor")) {
  std::vector<std::string> command{app("raceloc-sim"), "--track", track_path, "--car", car, "-o", log};
  if (std::find(more.begin(), more.end(), "--laps") == more.end())
    command.insert(command.end(), {"--laps", "0.1"});
  command.insert(command.end(), more.begin(), more.end());
  return command;
}

void run(const std::vector<std::string>& command) {
  const auto result = runCommand(command);
  ASSERT_EQ(result.exit_code, 0) << result.err;
}

/** What a line of shell prints. */
std::string shell(const std::string& line) { return runCommand({"sh", "-c", line}).out; }

class Sim : public ::testing::Test {
 protected:
  TemporaryFolder in, out;
  const std::string car = smallCar(in);
};

TEST_F(Sim, WritesLogTruthAndManifest) {
  run(simCommand(car, out / "a.rawlog"));
  EXPECT_THAT(out.names(), UnorderedElementsAre("a.rawlog", "a_truth.tum", "a_manifest.ini"));
  const auto truth = raceloc::readTum(out / "a_truth.tum");
  ASSERT_TRUE(truth.origin.has_value());
  EXPECT_GT(truth.poses.size(), 250U);  // 0.1 of 1104 m at 27.7 m/s at most, 100 a second
  for (std::size_t i = 1; i < truth.poses.size(); ++i)
    EXPECT_NEAR(truth.poses[i].stamp_s - truth.poses[i - 1].stamp_s, 0.01, 2e-6);
  const auto manifest = readFile(out / "a_manifest.ini");
  for (const std::string part : {"lor.ini", "seed = 1", "laps = 0.1", "version = "})
    EXPECT_THAT(manifest, HasSubstr(part));
}

TEST_F(Sim, SameSeedSameBytesOnAnyNumberOfThreads) {
  run(simCommand(car, out / "a.rawlog", {"--threads", "1"}));
  run(simCommand(car, out / "b.rawlog", {"--threads", "2"}));
  run(simCommand(car, out / "c.rawlog", {"--seed", "2"}));
  for (const std::string ending : {".rawlog", "_truth.tum", "_manifest.ini"})
    EXPECT_TRUE(readFile(out / ("a" + ending)) == readFile(out / ("b" + ending))) << ending;
  EXPECT_FALSE(readFile(out / "a.rawlog") == readFile(out / "c.rawlog"));
}

TEST_F(Sim, GoldenLog) {
  // The bytes of a log before compression. They change with every change of the simulated world: a new hash is
  // committed only with the reason for it.
  writeFile(in / "f.ini",
            "[fault_01]\nkind = gps_noise\nlabels = gps_right\nfrom_s = 1\nto_s = 2\nsigma_m = 5\n");
  run(simCommand(car, out / "golden.rawlog", {"--faults", in / "f.ini", "--traffic", "2"}));
  EXPECT_EQ(shell("zcat '" + (out / "golden.rawlog") + "' | sha256sum"),
            readFile(ROOT "/tests/golden/lor_rawlog.sha256"));
}

TEST_F(Sim, OpensInMrptWithAllDevices) {
  if (runCommand({"which", "rawlog-edit"}).exit_code != 0)
    GTEST_SKIP() << "rawlog-edit is not installed (mrpt-apps)";
  run(simCommand(car, out / "a.rawlog"));
  const auto info = runCommand({"rawlog-edit", "--info", "-i", out / "a.rawlog"});
  EXPECT_EQ(info.exit_code, 0) << info.err;
  for (const std::string label : {"lidar_front", "lidar_left", "lidar_right", "gps_left", "gps_right",
                                  "gps_left_pose", "imu", "vehicle", "truth"})
    EXPECT_THAT(info.out, HasSubstr(label + " /"));
}

TEST_F(Sim, FaultsAreInTheHeaderAndChangeOnlyTheirInterval) {
  writeFile(in / "f.ini",
            "[fault_01]\nkind = gps_step\nlabels = gps_left\nfrom_s = 1\nto_s = 2\neast_m = 5\n");
  run(simCommand(car, out / "clean.rawlog"));
  run(simCommand(car, out / "faulty.rawlog", {"--faults", in / "f.ini"}));
  run({app("raceloc-sim"), "inject", "--faults", in / "f.ini", "-i", out / "clean.rawlog", "-o",
       out / "injected.rawlog"});
  EXPECT_THAT(shell("zcat '" + (out / "faulty.rawlog") + "' | strings | head -80"),
              HasSubstr("kind = gps_step"));
  EXPECT_THAT(shell("zcat '" + (out / "injected.rawlog") + "' | strings | head -80"),
              HasSubstr("kind = gps_step"));
  if (runCommand({"which", "rawlog-edit"}).exit_code != 0)
    GTEST_SKIP() << "rawlog-edit is not installed (mrpt-apps)";

  // rawlog-edit writes a line a fix into NAME_LABEL_MSG_NMEA_GGA.txt, in the folder where it runs.
  const auto fixes = [&](const std::string& name, const std::string& label) {
    run({"sh", "-c", "cd '" + (out / "") + "' && rawlog-edit --export-gps-all -q -i " + name});
    std::vector<std::string> lines;
    for (const auto& file : out.names()) {
      // lines that begin with % are headers
      if (file.rfind(name.substr(0, name.find('.')), 0) != 0 || file.find(label) == std::string::npos ||
          file.find("GGA") == std::string::npos)
        continue;
      std::istringstream text(readFile(out / file));
      for (std::string line; std::getline(text, line);)
        if (!line.empty() && line[0] != '%') lines.push_back(line);
    }
    return lines;
  };
  for (const std::string label : {"gps_left", "gps_right"}) {
    const auto clean = fixes("clean.rawlog", label), faulty = fixes("faulty.rawlog", label),
               injected = fixes("injected.rawlog", label);
    ASSERT_GT(clean.size(), 60U) << label;
    ASSERT_EQ(clean.size(), faulty.size());
    ASSERT_EQ(clean.size(), injected.size());
    std::size_t changed = 0;
    for (std::size_t i = 0; i < clean.size(); ++i) changed += clean[i] == faulty[i] ? 0 : 1;
    EXPECT_EQ(changed, label == "gps_left" ? 20U : 0U);  // one second at 20 Hz
    changed = 0;
    for (std::size_t i = 0; i < clean.size(); ++i) changed += clean[i] == injected[i] ? 0 : 1;
    EXPECT_EQ(changed, label == "gps_left" ? 20U : 0U);
  }
}

TEST_F(Sim, MakesAPreview) {
  run({app("raceloc-sim"), "--track", track("monza_like"), "--car", car, "--preview", out / "t.png"});
  EXPECT_THAT(out.names(), ElementsAre("t.png"));
  EXPECT_EQ(readFile(out / "t.png").substr(1, 3), "PNG");
}

TEST_F(Sim, APreviewRunsNoCommandsOfTheTracksName) {
  const auto text = std::regex_replace(readFile(track("lor")), std::regex("\nname = [^\n]*"),
                                       "\nname = `touch " + (out / "owned") + "` \" ' \\");
  writeFile(in / "t.ini", text);
  run({app("raceloc-sim"), "--track", in / "t.ini", "--car", car, "--preview", out / "t.png"});
  EXPECT_THAT(out.names(), ElementsAre("t.png"));
}

TEST_F(Sim, InjectsTwice) {
  writeFile(in / "f.ini", "[fault_01]\nkind = gps_outage\nlabels = gps_left\nfrom_s = 1\nto_s = 2\n");
  run(simCommand(car, out / "a.rawlog", {"--faults", in / "f.ini"}));
  for (const auto& [from, to] : {std::pair("a.rawlog", "b.rawlog"), {"b.rawlog", "c.rawlog"}})
    run({app("raceloc-sim"), "inject", "--seed", "7", "--faults", in / "f.ini", "-i", out / from, "-o",
         out / to});
  const auto header = shell("zcat '" + (out / "c.rawlog") + "' | strings | head -120");
  for (const std::string part : {"[fault_01]", "[injection_1]", "[injection_1_fault_01]", "[injection_2]",
                                 "log = b.rawlog", "seed = 7"})
    EXPECT_THAT(header, HasSubstr(part));
}

TEST_F(Sim, DrivesACentreLine) {
  std::string csv = "# x_m,y_m,w_tr_right_m,w_tr_left_m\n";
  for (int i = 0; i < 100; ++i) {
    const double a = 2 * M_PI * i / 100;
    csv += std::to_string(80 * std::cos(a)) + "," + std::to_string(60 * std::sin(a)) + ",5,5\n";
  }
  writeFile(in / "my.csv", csv);
  run(simCommand(car, out / "a.rawlog", {}, in / "my.csv"));
}

class EveryFault : public Sim, public ::testing::WithParamInterface<std::string> {};
INSTANTIATE_TEST_SUITE_P(Of, EveryFault, ::testing::Values("indy", "road_car"),
                         [](const auto& test) { return test.param; });

TEST_P(EveryFault, ShippedActsOnThisCar) {
  auto car_text = std::regex_replace(readFile(ini("sim/" + GetParam() + ".ini")),
                                     std::regex("\nbeams = [0-9]+"), "\nbeams = 4");
  writeFile(in / "car.ini", std::regex_replace(car_text, std::regex("\ncolumns = [0-9]+"), "\ncolumns = 20"));
  // Everything behind the header, which lists the faults.
  const auto messages = [&](const std::vector<std::string>& more) {
    run(simCommand(in / "car.ini", out / "f.rawlog", more));
    const auto bytes = shell("zcat '" + (out / "f.rawlog") + "'");
    return bytes.substr(std::min(bytes.size(), bytes.find("CObservationRobotPose")));
  };
  const auto clean = messages({});
  ASSERT_GT(clean.size(), 10'000U);
  for (const auto& file : std::filesystem::directory_iterator(ini("sim/faults"))) {
    auto text = readFile(file.path());
    text = std::regex_replace(text, std::regex("\nfrom_s = [0-9.]+"),
                              "\nfrom_s = 1");  // into the four seconds that it drives
    text = std::regex_replace(text, std::regex("\nto_s = [0-9.]+"), "\nto_s = 3");
    writeFile(in / "f.ini", text);
    EXPECT_FALSE(messages({"--faults", in / "f.ini"}) == clean) << file.path();
  }
}

class EveryTrack : public Sim, public ::testing::WithParamInterface<std::string> {};
INSTANTIATE_TEST_SUITE_P(Shipped, EveryTrack,
                         ::testing::Values("lvms", "ims", "tms", "lor", "monza_like", "everland_like"),
                         [](const auto& test) { return test.param; });

TEST_P(EveryTrack, ThreeLapsComplete) {  // without LiDARs, which take minutes
  run(simCommand(ini("sim/indy.ini"), out / "a.rawlog", {"--laps", "3", "--devices", "gps_* imu vehicle"},
                 track(GetParam())));
}

// ---- Bad input

class BadSim : public BadInput {
 protected:
  void expectRefusedTrack(const std::string& pattern, const std::string& replacement,
                          const std::vector<std::string>& named) const {
    const auto text = readFile(track("lor"));
    const auto changed =
        std::regex_replace(text, std::regex(pattern), replacement, std::regex_constants::format_first_only);
    ASSERT_NE(text, changed) << pattern;
    writeFile(in / "my_track.ini", changed);
    auto all = named;
    all.push_back(in / "my_track.ini");
    expectRefused(simCommand(ini("sim/indy.ini"), out / "a.rawlog", {}, in / "my_track.ini"), all);
  }
  void expectRefusedFault(const std::string& text, const std::vector<std::string>& named) const {
    writeFile(in / "my_faults.ini", text);
    auto all = named;
    all.push_back(in / "my_faults.ini");
    expectRefused(simCommand(ini("sim/indy.ini"), out / "a.rawlog", {"--faults", in / "my_faults.ini"}), all);
  }
};

TEST_F(BadSim, TrackDoesNotClose) {
  expectRefusedTrack("(segment_01\\]\n(//.*\n)*length_m = )[0-9.]+", "$012000", {"do not close", " m ("});
}
TEST_F(BadSim, WidthIsNegative) {
  expectRefusedTrack("\nright_m = [0-9.]+", "\nright_m = -4", {"[segments]", "right_m = -4"});
}
TEST_F(BadSim, TrackKeyIsUnknown) {
  expectRefusedTrack("\nright_m =", "\nrigth_m =", {"rigth_m", "right_m"});
}
TEST_F(BadSim, TrackIsMissing) {
  expectRefused(simCommand(ini("sim/indy.ini"), out / "a.rawlog", {}, in / "nowhere.ini"),
                {in / "nowhere.ini"});
}
TEST_F(BadSim, CentreLineDoesNotClose) {
  std::string csv;
  for (int i = 0; i < 100; ++i) csv += std::to_string(5 * i) + ",0,4,4\n";
  writeFile(in / "line.csv", csv);
  expectRefused(simCommand(ini("sim/indy.ini"), out / "a.rawlog", {}, in / "line.csv"),
                {in / "line.csv", "does not close"});
}
TEST_F(BadSim, CentreLineIsNegativelyWide) {
  writeFile(in / "line.csv", "0,0,4,4\n5,0,4,-2\n");
  expectRefused(simCommand(ini("sim/indy.ini"), out / "a.rawlog", {}, in / "line.csv"),
                {in / "line.csv", "line 2", "w_tr_left_m", "-2"});
}
TEST_F(BadSim, FaultIsUnknown) {
  expectRefusedFault("[fault_01]\nkind = gps_stepp\n", {"[fault_01]", "gps_stepp", "gps_step"});
}
TEST_F(BadSim, FaultIsForADeviceThatTheCarLacks) {
  expectRefusedFault("[fault_01]\nkind = gps_step\nlabels = gps_rear\n",
                     {"[fault_01]", "gps_rear", "gps_left"});
  expectRefusedFault("[fault_01]\nkind = gps_step\nlabels = gps_left gps_rear\n",
                     {"[fault_01]", "called gps_rear", "gps_right"});
}
TEST_F(BadSim, DeviceIsNotInTheCar) {
  expectRefused(simCommand(ini("sim/indy.ini"), out / "a.rawlog", {"--devices", "radar_*"}),
                {"radar_*", "lidar_front"});
}
TEST_F(BadSim, CarKeyIsOutOfRange) {
  writeFile(in / "car.ini", std::regex_replace(readFile(ini("sim/indy.ini")), std::regex("\nmass_kg = 750"),
                                               "\nmass_kg = -1"));
  expectRefused(simCommand(in / "car.ini", out / "a.rawlog"), {in / "car.ini", "[car]", "mass_kg = -1"});
}
TEST_F(BadSim, OutputCannotBeWritten) {
  expectRefused(simCommand(ini("sim/indy.ini"), out / "no_folder/a.rawlog"), {out / "no_folder/a.rawlog"});
}
TEST_F(BadSim, OutputHasTheWrongEnding) {
  expectRefused(simCommand(ini("sim/indy.ini"), out / "a.log"), {out / "a.log", ".rawlog"});
}
TEST_F(BadSim, OptionsAreWrong) {
  for (const auto& [option, value] :
       {std::pair("--threads", "none"), {"--seed", "1.5"}, {"--start-speed", "-3"}, {"--traffic", "900"}})
    expectRefused(simCommand(ini("sim/indy.ini"), out / "a.rawlog", {option + std::string("=") + value}),
                  {option, value});
  expectRefused(simCommand(ini("sim/indy.ini"), out / "a.rawlog", {"--stand", "3"}), {"--start-speed 0"});
}
class FullDisk : public BadSim, public ::testing::WithParamInterface<std::string> {};
INSTANTIATE_TEST_SUITE_P(After, FullDisk, ::testing::Values("45", "100", "400"),
                         [](const auto& test) { return test.param + "_KiB"; });

TEST_P(FullDisk, LeavesNothing) {  // also when only the last bytes do not fit
  // The shell's limit on the size of a file stands for it; the signal that comes with it is ignored, as the disk
  // sends none.
  std::string line = "trap '' XFSZ; ulimit -f " + GetParam() + ";";
  for (const auto& word : simCommand(ini("sim/indy.ini"), out / "a.rawlog")) line += " '" + word + "'";
  expectRefused({"bash", "-c", line}, {out / "a.rawlog", "cannot be written"}, "raceloc-sim");
}
TEST_F(BadSim, CentreLineIsTooWide) {
  writeFile(in / "line.csv", "0,0,4,4\n5,0,4,1000000\n");
  expectRefused(simCommand(ini("sim/indy.ini"), out / "a.rawlog", {}, in / "line.csv"),
                {in / "line.csv", "line 2", "1000000"});
}
TEST_F(BadSim, VibrationNeedsAVehicle) {
  expectRefused(simCommand(ini("sim/indy.ini"), out / "a.rawlog",
                           {"--devices", "gps_*", "--faults", fault("gps_vibration")}),
                {"gps_vibration", "vehicle"});
}
TEST_F(BadSim, PreviewIsNoPicture) {
  const auto track_text = readFile(track("lor"));
  writeFile(in / "t.ini", track_text);
  expectRefused(
      {app("raceloc-sim"), "--track", in / "t.ini", "--car", ini("sim/indy.ini"), "--preview", in / "t.ini"},
      {in / "t.ini", ".png"});
  EXPECT_EQ(readFile(in / "t.ini"), track_text);
}
TEST_F(BadSim, ManifestWouldFallOnAnInput) {
  const auto text = readFile(ini("sim/indy.ini"));
  writeFile(in / "x_manifest.ini", text);
  expectRefused(simCommand(in / "x_manifest.ini", in / "x.rawlog"), {in / "x_manifest.ini", "input"});
  EXPECT_EQ(readFile(in / "x_manifest.ini"), text);
}
TEST_F(BadSim, OneOfTheDevicesIsMistyped) {
  expectRefused(simCommand(ini("sim/indy.ini"), out / "a.rawlog", {"--devices", "imu nope"}),
                {"nope", "lidar_front"});
  expectRefused(simCommand(ini("sim/indy.ini"), out / "a.rawlog", {"--devices", "imu,nope"}),
                {"nope", "lidar_front"});
}
TEST_F(BadSim, StartIsFasterThanTheTopSpeed) {
  expectRefused(
      simCommand(ini("sim/indy.ini"), out / "a.rawlog", {"--start-speed", "50", "--top-speed", "10"}),
      {"--start-speed", "10 m/s"});
}
TEST_F(BadSim, TrackHasAnUnknownVariable) {
  expectRefusedTrack("\nright_m = [0-9.]+", "\nright_m = $${b}", {"${b}"});
}
TEST_F(BadSim, InjectedLogIsMissing) {
  expectRefused({app("raceloc-sim"), "inject", "--faults", fault("gps_outage"), "-i", in / "no.rawlog", "-o",
                 out / "o.rawlog"},
                {in / "no.rawlog"});
}
TEST_F(BadSim, InjectedLogLacksTheDevice) {
  run(simCommand(ini("sim/indy.ini"), in / "a.rawlog", {"--devices", "imu vehicle"}));
  expectRefused({app("raceloc-sim"), "inject", "--faults", fault("gps_outage"), "-i", in / "a.rawlog", "-o",
                 out / "o.rawlog"},
                {"gps_*", "[fault_"});
}

}  // namespace
