/** \file
 * raceloc-map info, export and check. */
#include <algorithm>
#include <nlohmann/json.hpp>

#include "apps/refused.h"
#include "map/map_file.h"
#include "support/some_map.h"

namespace {

using namespace raceloc::test;
using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::StartsWith;
using ::testing::UnorderedElementsAre;

class MapTools : public BadInput {
 protected:
  MapTools() { save(); }
  void save() { raceloc::saveMap(map_, groundMap(32, 64, 2), content_); }
  [[nodiscard]] std::vector<std::string> exporting(std::vector<std::string> formats) const {
    formats.insert(formats.begin(), {app("raceloc-map"), "export", map_, "-o", out / "x"});
    return formats;
  }
  Random rnd_{2};
  raceloc::MapContent content_ = someContent(rnd_, 32);
  std::string map_ = in / "some.rlmap";
};

TEST_F(MapTools, InfoTellsWhatIsInTheMap) {
  const auto result = runCommand({app("raceloc-map"), "info", map_});
  EXPECT_EQ(result.exit_code, 0) << result.err;
  for (const std::string line :
       {"origin 48.982000000 8.390400000 deg, 116.400 m", "noon: 8 key poses", "19 odometry edges, 1 loops",
        "gps_left: 10, of which", "40 way-points every 6.28 m, 251 m in all; 19 key poses have an ID",
        "40 stations: height", "37 stations on the left, 37 on the right", "4096 in 16 tiles of 32 m"})
    EXPECT_THAT(result.out, HasSubstr(line));
}

TEST_F(MapTools, CheckSaysThatAGoodMapIsGood) {
  const auto result = runCommand({app("raceloc-map"), "check", map_});
  EXPECT_EQ(result.exit_code, 0) << result.err;
  EXPECT_THAT(result.out, AllOf(StartsWith("good  "), HasSubstr("16 tiles, 20 key poses, 40 way-points"),
                                HasSubstr(raceloc::MapFile(map_).contentHash())));
}

TEST_F(MapTools, CheckSaysWhatIsWrong) {
  const std::string clean = readFile(map_);
  for (const auto& [needle, part] : std::vector<std::pair<std::string, std::string>>{
           {"gps_left", "fixes does not fit its checksum"}, {"tile_size_m = 32", "info does not fit"}}) {
    std::string bytes = clean;
    bytes[bytes.find(needle)] ^= 1;
    writeFile(map_, bytes);
    expectRefused({app("raceloc-map"), "check", map_}, {map_, "damaged", part});
  }
  writeFile(map_, clean.substr(0, clean.size() / 2));
  expectRefused({app("raceloc-map"), "check", map_}, {map_, "cut short"});
  std::string bytes = clean;
  bytes[63] = 1;  // sqlite.org/fileformat.html: the user version
  writeFile(map_, bytes);
  expectRefused({app("raceloc-map"), "check", map_}, {map_, "map format 1", "build the map again"});

  content_.key_poses[5].racetrack_id = *content_.key_poses[5].racetrack_id + 20;
  save();
  expectRefused({app("raceloc-map"), "check", map_}, {map_, "key pose 5", "racetrack ID 35"});
}

TEST_F(MapTools, ExportWritesEveryFormat) {
  const auto result = runCommand(
      exporting({"--ply", "--pcd", "--tum", "--geojson", "--kml", "--g2o", "--simplemap", "--3dscene"}));
  EXPECT_EQ(result.exit_code, 0) << result.err;
  EXPECT_THAT(out.names(), UnorderedElementsAre("x.origin.json", "x.ply", "x.pcd", "x.tum", "x_gps_graph.tum",
                                                "x_lidar_graph.tum", "x.geojson", "x.kml", "x.g2o",
                                                "x.simplemap", "x.3Dscene"));
  EXPECT_EQ(nlohmann::json::parse(readFile(out / "x.origin.json")).at("latitude_deg"), 48.982);
  const auto lines = [&](const std::string& name) {
    const std::string text = readFile(out / name);
    return std::count(text.begin(), text.end(), '\n');
  };
  EXPECT_EQ(lines("x.tum"), 20 + 2);
  EXPECT_EQ(lines("x_gps_graph.tum"), 19 + 2);  // the last key pose has none
  EXPECT_EQ(lines("x_lidar_graph.tum"), 20 + 2);
}

TEST_F(MapTools, ExportWritesWhatIsAskedForAlone) {
  for (raceloc::KeyPose& k : content_.key_poses) k.T_map_body_gps.reset();
  save();
  const auto result = runCommand(exporting({"--tum"}));
  EXPECT_EQ(result.exit_code, 0) << result.err;
  EXPECT_THAT(out.names(), UnorderedElementsAre("x.origin.json", "x.tum", "x_lidar_graph.tum"));
  EXPECT_THAT(result.out, HasSubstr("left out         " + (out / "x_gps_graph.tum")));
}

TEST_F(MapTools, ExportReplacesAFileOnlyWhenAsked) {
  for (const std::string name : {"x.ply", "x.3Dscene", "x_gps_graph.tum", "x.origin.json"}) {
    writeFile(out / name, "mine");
    const auto result = runCommand(exporting({"--ply", "--3dscene", "--tum"}));
    EXPECT_EQ(result.exit_code, 2);
    EXPECT_THAT(result.err,
                AllOf(HasSubstr("output " + (out / name) + ": is there already"), HasSubstr("--replace")));
    EXPECT_THAT(out.names(), UnorderedElementsAre(name));
    EXPECT_EQ(readFile(out / name), "mine");
    std::filesystem::remove(out / name);
  }
  writeFile(out / "x.ply", "mine");
  EXPECT_EQ(runCommand(exporting({"--ply", "--replace"})).exit_code, 0);
  EXPECT_NE(readFile(out / "x.ply"), "mine");
}

TEST_F(MapTools, RefusesWhatItCannotDo) {
  for (const std::string command : {"info", "check", "export"}) {
    expectRefused({app("raceloc-map"), command}, {"no map given", "--help"});
    expectRefused({app("raceloc-map"), command, "--wrong"}, {"--wrong"});
  }
  expectRefused({app("raceloc-map"), "info", in / "nowhere.rlmap"}, {in / "nowhere.rlmap", "No such file"});
  expectRefused(exporting({}), {"no format given", "--geojson"});
  expectRefused({app("raceloc-map"), "export", map_, "--ply"}, {"no output given", "-o PREFIX"});
  content_.info.origin.reset();
  save();
  expectRefused(exporting({"--geojson"}), {out / "x.geojson", "no origin"});
}

TEST_F(MapTools, EveryHelpHasExamples) {
  for (const std::string command : {"info", "check", "export"}) {
    const auto help = runCommand({app("raceloc-map"), command, "--help"});
    EXPECT_EQ(help.exit_code, 0);
    EXPECT_THAT(help.out, AllOf(HasSubstr("EXAMPLES\n  raceloc-map " + command), HasSubstr("EXIT STATUS")));
  }
}

TEST(MapToolsOnADrive, TheBuiltMapIsGoodAndExports) {
  const DriveFiles drive("synthetic");
  const TemporaryFolder out;
  EXPECT_EQ(runCommand({app("raceloc-map"), "check", drive.map()}).exit_code, 0);
  EXPECT_EQ(runCommand({app("raceloc-map"), "info", drive.map()}).exit_code, 0);
  const auto result =
      runCommand({app("raceloc-map"), "export", drive.map(), "-o", out / "x", "--geojson", "--ply"});
  EXPECT_EQ(result.exit_code, 0) << result.err;
  const auto json = nlohmann::json::parse(readFile(out / "x.geojson"));
  EXPECT_EQ(json.at("features").at(0).at("properties").at("name"), "survey.rawlog");
}

}  // namespace
