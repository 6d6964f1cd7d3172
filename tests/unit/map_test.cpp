#include <gmock/gmock.h>
#include <sys/resource.h>
#include <unistd.h>

#include <csignal>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <limits>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "core/errors.h"
#include "map/bytes.h"
#include "map/map_file.h"
#include "map/tile_query.h"
#include "map/tiled_map.h"
#include "support/complaint.h"
#include "support/killed.h"
#include "support/some_map.h"

namespace raceloc {
namespace {

using test::groundMap;
using ::testing::HasSubstr;

/** Points with a covariance each, and views on them. */
struct Sample {
  Cloud cloud;
  gpu::Covariances covariances;
};

void push(Sample& sample, const Eigen::Vector3f& p_map_m, float scale = 1) {
  sample.cloud.push(p_map_m);
  gpu::Covariances& c = sample.covariances;
  float value = scale;
  for (std::vector<float>* array : {&c.xx, &c.xy, &c.xz, &c.yy, &c.yz, &c.zz})
    array->push_back(value += 0.25F);
}

std::string bytesOf(const std::string& path) {
  std::ifstream in(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(in), {}};
}

void write(const std::string& path, const std::string& bytes) {
  std::ofstream out(path, std::ios::binary);
  out << bytes;
}

class MapFileTest : public ::testing::Test {
 protected:
  void SetUp() override {
    const auto* info = ::testing::UnitTest::GetInstance()->current_test_info();
    folder_ = std::filesystem::temp_directory_path() /
              ("raceloc_map_" + std::to_string(getpid()) + "_" + info->name());
    std::filesystem::create_directories(folder_);
    path_ = (folder_ / "a map, 100% #1?.rlmap").string();  // what a URI would take for its own
  }
  void TearDown() override { std::filesystem::remove_all(folder_); }

  void save() { saveMap(path_, map_, content_); }
  [[nodiscard]] std::string openingError() const {
    return test::complaint([&] { MapFile file(path_); });
  }
  [[nodiscard]] std::size_t filesInFolder() const {
    const std::filesystem::directory_iterator entries(folder_);
    return static_cast<std::size_t>(std::distance(begin(entries), end(entries)));
  }

  /** Saves the map with tile (-1, 1) damaged. */
  void saveDamaged() {
    Sample marked;  // four heights in a row that the file holds nowhere else
    for (int i = 0; i < 4; ++i) push(marked, {-1, 33, 77 + 0.125F * static_cast<float>(i)});
    TiledMap map = map_;
    map.insert(marked.cloud, marked.covariances.view());
    saveMap(path_, map, {content_.info, {}});
    std::string heights(4 * sizeof(float), '\0');
    std::memcpy(heights.data(), marked.cloud.z.data(), heights.size());
    std::string bytes = bytesOf(path_);
    const std::size_t at = bytes.find(heights);
    ASSERT_NE(at, std::string::npos);
    bytes[at] ^= 1;
    write(path_, bytes);
  }

  std::filesystem::path folder_;
  std::string path_;
  TiledMap map_ = groundMap(32, 64, 2);
  test::Random rnd_{7};
  MapContent content_ = test::someContent(rnd_, 32);
};

TEST(TiledMap, BordersBelongToTheTileEastAndNorthOfThem) {
  Sample sample;
  const float below = std::nextafter(32.0F, 0.0F);
  for (const Eigen::Vector3f& p :
       {Eigen::Vector3f(0, 0, 1), {32, 0, 1}, {below, 0, 1}, {-32, -32, 1}, {-33, 64, 1}})
    push(sample, p);
  TiledMap map(32);
  map.insert(sample.cloud, sample.covariances.view());
  ASSERT_EQ(map.tiles().size(), 4U);
  EXPECT_EQ(map.pointCount(), 5U);
  const Tile& origin = map.tiles().at({0, 0});
  ASSERT_EQ(origin.cloud.size(), 2U);
  EXPECT_EQ(origin.cloud.point(1), Eigen::Vector3f(below, 0, 1));
  EXPECT_EQ(map.tiles().at({1, 0}).cloud.point(0), Eigen::Vector3f(0, 0, 1));
  EXPECT_EQ(map.tiles().at({-1, -1}).cloud.point(0), Eigen::Vector3f(0, 0, 1));
  EXPECT_EQ(map.tiles().at({-2, 2}).cloud.point(0), Eigen::Vector3f(31, 0, 1));
}

TEST(TiledMap, RefusesWhatItCannotHoldAndStaysAsItWas) {
  EXPECT_THROW(TiledMap{0}, std::invalid_argument);
  EXPECT_THROW(TiledMap{std::numeric_limits<double>::quiet_NaN()}, std::invalid_argument);
  TiledMap map(32);
  Sample sample;
  push(sample, {1, 2, 3});
  map.insert(sample.cloud, sample.covariances.view());

  Sample with_nan = sample;
  push(with_nan, {std::numeric_limits<float>::quiet_NaN(), 0, 0});
  Sample far = sample;
  push(far, {1e9F, 0, 0});
  Sample short_of_one = sample;
  short_of_one.cloud.push({4, 5, 6});
  Sample with_intensity = sample;
  with_intensity.cloud.intensity = {0.5F};
  for (const Sample& bad : {with_nan, far, short_of_one, with_intensity})
    EXPECT_THROW(map.insert(bad.cloud, bad.covariances.view()), std::invalid_argument);
  EXPECT_EQ(map.pointCount(), 1U);
  EXPECT_EQ(map.tiles().at({0, 0}).cloud.size(), 1U);
}

TEST_F(MapFileTest, LeavesOneFileAndNothingBesideIt) {
  save();
  EXPECT_EQ(filesInFolder(), 1U);
  const std::string before = bytesOf(path_);
  MapFile file(path_);
  file.verify();
  EXPECT_EQ(filesInFolder(), 1U);
  EXPECT_EQ(bytesOf(path_), before);
}

TEST_F(MapFileTest, OpensFromAFolderThatNobodyMayWrite) {
  save();
  namespace fs = std::filesystem;
  fs::permissions(path_, fs::perms::owner_read);
  fs::permissions(folder_, fs::perms::owner_read | fs::perms::owner_exec);
  EXPECT_NO_THROW(const MapFile opened(path_));
  fs::permissions(folder_, fs::perms::owner_all);
}

TEST_F(MapFileTest, HashSeesEveryPartOfTheContentButNotTheProgram) {
  save();
  const std::string hash = MapFile(path_).contentHash();
  EXPECT_EQ(hash.substr(0, 4), "md5:");
  EXPECT_EQ(hash.size(), 36U);
  const auto hashAfter = [&](const auto& change) {
    MapContent content = content_;
    change(content);
    saveMap(path_, map_, content);
    return MapFile(path_).contentHash();
  };
  EXPECT_EQ(hashAfter([](MapContent& c) { c.info.tool_version = "0.2.0"; }), hash);
  std::set<std::string> others;
  const auto expectAnother = [&](const auto& change) {
    EXPECT_TRUE(others.insert(hashAfter(change)).second) << others.size();
  };
  others.insert(hash);
  expectAnother([](MapContent& c) { c.info.config += "\n"; });
  expectAnother([](MapContent& c) { c.info.origin->height_m += 1e-6; });
  expectAnother([](MapContent& c) { c.info.origin.reset(); });
  expectAnother([](MapContent& c) { c.info.sessions.emplace_back("evening"); });
  expectAnother([](MapContent& c) { c.key_poses[3].T_map_body.translation().x() += 1e-9; });
  expectAnother([](MapContent& c) { c.key_poses[3].racetrack_id.reset(); });
  expectAnother([](MapContent& c) { c.key_poses[3].T_map_body_lidar.reset(); });
  expectAnother([](MapContent& c) { c.waypoints[3].heading_rad += 1e-9; });
  expectAnother([](MapContent& c) { c.edges[3].kind = EdgeKind::loop; });
  expectAnother([](MapContent& c) { c.edges[3].information *= 2; });
  expectAnother([](MapContent& c) { c.fixes[3].weight *= 0.5; });
  expectAnother([](MapContent& c) { c.fixes[3].receiver = "gps_rear"; });
  expectAnother([](MapContent& c) { c.road.pop_back(); });
  expectAnother([](MapContent& c) { c.walls.pop_back(); });
  Sample one;
  push(one, {0, 0, 0});
  map_.insert(one.cloud, one.covariances.view());
  EXPECT_TRUE(others.insert(hashAfter([](MapContent&) {})).second);
}

TEST_F(MapFileTest, ASessionIsAddedToWhatTheFileGivesBack) {
  save();
  const std::string hash = MapFile(path_).contentHash();
  {
    const MapFile file(path_);
    TiledMap tiles = file.tiles();
    EXPECT_EQ(static_cast<std::size_t>(file.pointCount()), tiles.pointCount());
    MapContent content = file.content();
    saveMap(path_, tiles, content);  // an open map may be replaced: readers keep the old one
    EXPECT_EQ(MapFile(path_).contentHash(), hash);
    content.info.sessions.emplace_back("evening");
    content.key_poses.push_back({1.4e9, content.key_poses[0].T_map_body, "evening", 0});
    content.edges.push_back({0, 20, Pose::Identity(), Matrix6d::Identity(), EdgeKind::loop});
    Sample further;
    push(further, {500, 0, 0});
    tiles.insert(further.cloud, further.covariances.view());
    saveMap(path_, tiles, content);
    EXPECT_EQ(file.tile(0, 0)->cloud.size(), tiles.tiles().at({0, 0}).cloud.size());
  }
  const MapFile grown(path_);
  grown.verify();
  EXPECT_EQ(grown.content().key_poses.size(), 21U);
  EXPECT_EQ(grown.content().edges.back().j, 20);
  EXPECT_EQ(static_cast<std::size_t>(grown.pointCount()), map_.pointCount() + 1);
}

TEST_F(MapFileTest, AMapWithoutAnythingIsAMap) {
  const TiledMap nothing(32);
  MapInfo info = content_.info;
  info.sessions.clear();
  info.config = "";
  info.origin->latitude_deg = -0.0;
  saveMap(path_, nothing, {info, {}});
  const MapFile file(path_);
  file.verify();
  EXPECT_TRUE(file.tileIndices().empty());
  EXPECT_TRUE(file.content().key_poses.empty());
  EXPECT_EQ(file.info().config, "");
  EXPECT_FALSE(file.tile(0, 0).has_value());
}

TEST_F(MapFileTest, RefusesAMapThatContradictsItself) {
  const auto faultAfter = [&](const auto& change) {
    MapContent content = content_;
    change(content);
    try {
      saveMap(path_, map_, content);
    } catch (const std::invalid_argument& e) {
      return std::string(e.what());
    }
    return std::string("no fault");
  };
  constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
  EXPECT_THAT(faultAfter([](MapContent& c) { c.info.tile_size_m = 16; }), HasSubstr("two tile sizes"));
  EXPECT_THAT(faultAfter([](MapContent& c) { c.info.origin->latitude_deg = kNan; }), HasSubstr("info row 0"));
  EXPECT_THAT(faultAfter([](MapContent& c) { c.edges[2].T_i_j.translation().y() = kNan; }),
              HasSubstr("edges row 2"));
  EXPECT_THAT(faultAfter([](MapContent& c) { c.road[1].bank_rad = kNan; }), HasSubstr("road row 1"));
  EXPECT_THAT(faultAfter([](MapContent& c) { c.key_poses[19].session = "midnight"; }),
              HasSubstr("key pose 19 is of session midnight"));
  EXPECT_THAT(faultAfter([](MapContent& c) { c.key_poses[4].T_map_body.linear() *= 1.1; }),
              HasSubstr("key pose 4 has a pose that is not rigid"));
  EXPECT_THAT(faultAfter([](MapContent& c) { c.key_poses[4].racetrack_id = 40; }),
              HasSubstr("key pose 4 has racetrack ID 40, but there are 40"));
  EXPECT_THAT(faultAfter([](MapContent& c) { c.info.waypoint_spacing_m = 0; }), HasSubstr("no spacing"));
  EXPECT_THAT(faultAfter([](MapContent& c) { c.edges[5].j = 20; }), HasSubstr("edge 5 does not tie"));
  EXPECT_THAT(faultAfter([](MapContent& c) { c.edges[5].information *= -1; }),
              HasSubstr("edge 5 has no positive information"));
  EXPECT_THAT(faultAfter([](MapContent& c) { c.fixes[6].key = -1; }), HasSubstr("fix 6"));
  EXPECT_THAT(faultAfter([](MapContent& c) { c.fixes[6].cov_map_m2(0, 1) += 1; }),
              HasSubstr("fix 6 has no positive covariance"));
  EXPECT_THAT(faultAfter([](MapContent& c) { c.fixes[6].weight = 1.1; }), HasSubstr("fix 6 has a weight"));
  EXPECT_THAT(faultAfter([](MapContent& c) { std::swap(c.road[0], c.road[1]); }), HasSubstr("the road"));
  EXPECT_THAT(faultAfter([](MapContent& c) { std::swap(c.walls.front(), c.walls.back()); }),
              HasSubstr("the walls"));
  EXPECT_EQ(filesInFolder(), 0U);
}

TEST_F(MapFileTest, VerifyHoldsKeyPosesToTheirWayPoints) {
  content_.key_poses[4].racetrack_id = *content_.key_poses[4].racetrack_id + 20;  // across the circle
  save();
  const MapFile file(path_);
  EXPECT_THAT(
      test::complaint([&] { file.verify(); }),
      AllOf(HasSubstr("key pose 4 is 8"), HasSubstr("deg away from the way-point of its racetrack ID 32")));
}

TEST_F(MapFileTest, AKillLeavesOneMapOrTheOther) {
  const int once = test::changesOf([&] { save(); });
  MapContent other = content_;
  other.info.sessions.emplace_back("evening");
  const std::string hash = MapFile(path_).contentHash(), other_path = (folder_ / "other.rlmap").string();
  saveMap(other_path, map_, other);
  const std::set<std::string> either{hash, MapFile(other_path).contentHash()};
  std::size_t changed = 0;
  for (int round = 0; round < 20; ++round) {
    // It saves the other map over this one, and this one again: both are killed into.
    test::killedAtChange(rnd_.integer(1, 2 * once), [&] {
      saveMap(path_, map_, other);
      saveMap(path_, map_, content_);
    });
    const MapFile file(path_);
    file.verify();
    EXPECT_EQ(either.count(file.contentHash()), 1U);
    if (file.contentHash() != hash) ++changed;
  }
  EXPECT_GT(changed, 0U);  // the child did write
}

TEST_F(MapFileTest, SaysThatTheFileIsMissing) {
  EXPECT_THAT(openingError(), HasSubstr("map " + path_ + ": cannot be read (No such file"));
}

TEST_F(MapFileTest, SaysThatTheFileIsNotSqlite) {
  for (const std::string& content : {std::string(), std::string("SQLite"), std::string(4096, 'x')}) {
    write(path_, content);
    EXPECT_THAT(openingError(), HasSubstr(path_ + ": is not an .rlmap (not an SQLite file)"));
  }
  path_ = folder_.string();
  EXPECT_THAT(openingError(), HasSubstr("is not an .rlmap"));
}

TEST_F(MapFileTest, SaysThatTheSqliteFileIsAnothers) {
  save();
  std::string bytes = bytesOf(path_);
  bytes.replace(68, 4, 4, '\0');  // sqlite.org/fileformat.html: the application id
  write(path_, bytes);
  EXPECT_THAT(openingError(), HasSubstr("is an SQLite file, but not an .rlmap"));
}

TEST_F(MapFileTest, SaysThatTheFormatIsAnother) {
  save();
  std::string bytes = bytesOf(path_);
  for (const int version : {1, 3}) {
    bytes[63] = static_cast<char>(version);  // sqlite.org/fileformat.html: the user version
    write(path_, bytes);
    EXPECT_THAT(openingError(),
                HasSubstr("is of map format " + std::to_string(version) +
                          ", but this program reads format 2; use the raceloc that made it or"));
  }
}

TEST_F(MapFileTest, SaysThatTheFileIsCutShort) {
  save();
  const std::string bytes = bytesOf(path_);
  for (const std::size_t kept : {std::size_t{40}, std::size_t{100}, bytes.size() / 2, bytes.size() - 1}) {
    write(path_, bytes.substr(0, kept));
    EXPECT_THAT(openingError(), HasSubstr("cut short")) << kept;
  }
}

TEST_F(MapFileTest, NamesTheDamagedTileAndServesTheOthers) {
  saveDamaged();
  const MapFile file(path_);
  const std::string expected = path_ + ": damaged: tile (-1, 1) does not fit its checksum";
  EXPECT_THAT(test::complaint([&] { static_cast<void>(file.tile(-1, 1)); }), HasSubstr(expected));
  EXPECT_THAT(test::complaint([&] { file.verify(); }), HasSubstr(expected));
  EXPECT_EQ(file.tile(0, 0)->cloud.x, map_.tiles().at({0, 0}).cloud.x);
}

TEST_F(MapFileTest, DamageToTheRestIsFoundOnOpening) {
  save();
  const std::string clean = bytesOf(path_);
  const auto bytesLike = [](double value) {
    Bytes bytes;
    append(bytes, value);
    return std::string(bytes.begin(), bytes.end());
  };
  const auto stationLike = [&](double value) {  // a column of SQLite's own: big-endian
    const std::string bytes = bytesLike(value);
    return std::string(bytes.rbegin(), bytes.rend());
  };
  const std::vector<std::pair<std::string, std::string>> parts{
      {"info", "tile_size_m = 32"},
      {"sessions", "morning"},
      {"key_poses", bytesLike(content_.key_poses[3].T_map_body.translation().x())},
      {"waypoints", bytesLike(content_.waypoints[3].p_map_m.x())},
      {"edges", bytesLike(content_.edges[3].information(0, 0))},
      {"fixes", bytesLike(content_.fixes[3].p_body_antenna_m.z())},
      {"road", stationLike(content_.road[3].height_m)},
      {"walls", bytesLike(content_.walls[3].p_map_foot_m.y())}};
  for (const auto& [part, needle] : parts) {
    std::string bytes = clean;
    const std::size_t at = bytes.find(needle);
    ASSERT_NE(at, std::string::npos) << part;
    bytes[at] ^= 1;
    write(path_, bytes);
    EXPECT_THAT(openingError(), HasSubstr(path_ + ": damaged: " + part + " does not fit its checksum"));
  }
  std::string bytes = clean;
  bytes[bytes.find("md5:") + 4] ^= 1;
  write(path_, bytes);
  EXPECT_THAT(openingError(), HasSubstr("its content hash is md5:"));
}

TEST_F(MapFileTest, DamageAnywhereIsAnInputErrorOrChangesNothing) {
  save();
  const std::string clean = bytesOf(path_);
  std::size_t found = 0;
  for (int i = 0; i < 300; ++i) {
    std::string bytes = clean;
    for (int k = 0; k < 8; ++k)
      bytes[static_cast<std::size_t>(rnd_.integer(100, static_cast<int>(bytes.size()) - 1))] =
          static_cast<char>(rnd_.integer(0, 255));
    write(path_, bytes);
    try {
      MapFile(path_).verify();
    } catch (const InputError&) {
      ++found;
    }
  }
  EXPECT_GT(found, 200U);  // the rest hit bytes that SQLite does not use
}

TEST_F(MapFileTest, AnUnwritableOutputLeavesNothing) {
  path_ = (folder_ / "missing" / "x.rlmap").string();
  EXPECT_THAT(test::complaint([&] { save(); }), HasSubstr("output " + path_ + ": cannot be written"));
  EXPECT_EQ(filesInFolder(), 0U);
}

TEST_F(MapFileTest, AFullDiskLeavesTheOldMap) {
  save();
  const std::string before = bytesOf(path_);
  rlimit limit{};
  getrlimit(RLIMIT_FSIZE, &limit);
  const rlimit small{before.size() / 2, limit.rlim_max};
  const auto handler = std::signal(SIGXFSZ, SIG_IGN);
  setrlimit(RLIMIT_FSIZE, &small);
  const std::string error = test::complaint([&] { save(); });
  setrlimit(RLIMIT_FSIZE, &limit);
  std::signal(SIGXFSZ, handler);
  EXPECT_THAT(error, HasSubstr("map " + path_ + ": cannot be written"));
  EXPECT_EQ(filesInFolder(), 1U);
  EXPECT_EQ(bytesOf(path_), before);
}

class TileWindowTest : public MapFileTest {
 protected:
  void SetUp() override {
    MapFileTest::SetUp();
    save();
  }
  gpu::Context context_{gpu::Backend::cpu};
};

TEST_F(TileWindowTest, HoldsTheTilesAroundTheCarInTheMapFrame) {
  const MapFile file(path_);
  TileWindow window(context_, file, 1, 12);
  EXPECT_EQ(window.target().size(), 0U);
  EXPECT_TRUE(
      window.moveTo({-48, -48}));  // the middle of tile (-2, -2): 16 m to its neighbours, 48 m to the next
  EXPECT_EQ(window.residentTiles(), 4U);
  const gpu::VoxelGaussians held = window.target().contents();
  EXPECT_EQ(held.size(), 4U * 16 * 16);  // a point every 2 m, voxels of 1 m
  for (std::size_t i = 0; i < held.size(); ++i) {
    EXPECT_NEAR(held.mean.x[i], static_cast<float>(held.ix[i]) + 0.5F, 1e-5);
    EXPECT_NEAR(held.mean.y[i], static_cast<float>(held.iy[i]) + 0.5F, 1e-5);
    EXPECT_LT(held.ix[i], 0);
    EXPECT_LT(held.iy[i], 0);
  }
}

TEST_F(TileWindowTest, SaysThatNoTileIsThere) {
  const MapFile file(path_);
  TileWindow window(context_, file, 1, 20);
  EXPECT_FALSE(window.moveTo({500, 0}));
  EXPECT_EQ(window.residentTiles(), 0U);
  EXPECT_TRUE(window.moveTo({0, 0}));
  EXPECT_GT(window.target().size(), 0U);
  EXPECT_FALSE(window.moveTo({1e300, -1e300}));
  EXPECT_EQ(window.residentTiles(), 0U);
  EXPECT_EQ(window.target().size(), 0U);
  EXPECT_THROW(window.moveTo({std::numeric_limits<double>::quiet_NaN(), 0}), std::invalid_argument);
  EXPECT_THROW(TileWindow(context_, file, 0, 20), std::invalid_argument);
  EXPECT_THROW(TileWindow(context_, file, 1, -1), std::invalid_argument);
}

TEST_F(TileWindowTest, DoesNotFlipAtABorder) {
  const MapFile file(path_);
  TileWindow window(context_, file, 1, 20);
  window.moveTo({12, 16});
  const std::size_t before = window.rebuilds();
  for (int i = 0; i < 100; ++i)
    window.moveTo({12 + (i % 2 == 0 ? 7.5 : -7.5), 16});  // tiles end at 32 and at 0
  EXPECT_EQ(window.rebuilds(), before);
}

TEST_F(TileWindowTest, ChangesWhereThePositionsSayAndNowhereElse) {
  const MapFile file(path_);
  TileWindow window(context_, file, 1, 12);
  const auto rebuildsAt = [&](double x_m) {
    window.moveTo({x_m, 0});
    return window.rebuilds();
  };
  // Asked for at half a tile from the centre, in use half a tile later, where its own centre is.
  for (const double x_m : {-48, -44, -40, -36, -32, -28, -24, -20}) EXPECT_EQ(rebuildsAt(x_m), 1U) << x_m;
  for (const double x_m : {-16, -12, -8, -4, 0, 4, 8, 12}) EXPECT_EQ(rebuildsAt(x_m), 2U) << x_m;
  EXPECT_EQ(rebuildsAt(16), 3U);
  for (const double x_m : {20, 24, 28, 32, 36, 40}) EXPECT_EQ(rebuildsAt(x_m), 3U) << x_m;
  const std::size_t waits = window.waits();
  EXPECT_GE(waits, 1U);  // the first; more if this machine is slow
  // A jump: what was asked for at 32 is dropped, and one about the car is built within the call.
  EXPECT_TRUE(window.moveTo({-48, -48}));
  EXPECT_EQ(window.rebuilds(), 5U);
  EXPECT_GE(window.waits(), waits + 1);
  EXPECT_EQ(window.residentTiles(), 4U);
}

TEST_F(TileWindowTest, GoesOnWithoutADamagedTileAndNamesItOnce) {
  saveDamaged();  // tile (-1, 1)
  const MapFile file(path_);
  TileWindow window(context_, file, 1, 12);
  EXPECT_TRUE(window.moveTo({-48, -48}));
  EXPECT_THAT(window.takeFaults(), ::testing::IsEmpty());
  EXPECT_FALSE(window.isDegraded());
  EXPECT_TRUE(window.moveTo({-1, 20}));  // 12 m from it
  EXPECT_THAT(window.takeFaults(),
              ::testing::ElementsAre(HasSubstr("damaged: tile (-1, 1) does not fit its checksum")));
  EXPECT_TRUE(window.isDegraded());
  EXPECT_EQ(window.residentTiles(), 11U);  // of the twelve within 44 m
  EXPECT_TRUE(window.moveTo({-1, 19}));
  EXPECT_FALSE(window.isDegraded());
  EXPECT_FALSE(window.moveTo({500, 0}));
  EXPECT_FALSE(window.moveTo({-16, 48}));  // in its middle: no other is within 12 m
  EXPECT_TRUE(window.isDegraded());
  EXPECT_THAT(window.takeFaults(), ::testing::IsEmpty());
}

}  // namespace
}  // namespace raceloc
