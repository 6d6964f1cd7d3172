#include <gmock/gmock.h>
#include <sys/resource.h>
#include <unistd.h>

#include <csignal>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <limits>
#include <string>
#include <vector>

#include "core/errors.h"
#include "map/map_file.h"
#include "map/tile_query.h"
#include "map/tiled_map.h"
#include "support/forall.h"

namespace raceloc {
namespace {

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

/** Ground over a square of `size_m` about the origin, one point every `spacing_m`. */
TiledMap groundMap(double tile_size_m, int size_m, int spacing_m) {
  Sample ground;
  for (int x = -size_m; x < size_m; x += spacing_m)
    for (int y = -size_m; y < size_m; y += spacing_m)
      push(ground, Eigen::Vector3f(static_cast<float>(x) + 0.5F, static_cast<float>(y) + 0.5F, 0.1F));
  TiledMap map(tile_size_m);
  map.insert(ground.cloud, ground.covariances.view());
  return map;
}

MapInfo someInfo(const TiledMap& map) {
  return {GeodeticPoint{48.982, 8.3904, 116.4}, map.tileSize(),     0.25, "0.1.0",
          "[map]\ntile_size_m = 32\n",          {"morning", "noon"}};
}

std::vector<KeyPose> someKeyPoses() {
  test::Random rnd(7);
  std::vector<KeyPose> poses;
  poses.reserve(20);
  for (int i = 0; i < 20; ++i) poses.push_back({1.3e9 + i, rnd.pose(3, 50), i < 12 ? "morning" : "noon"});
  return poses;
}

std::string bytesOf(const std::string& path) {
  std::ifstream in(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(in), {}};
}

void write(const std::string& path, const std::string& bytes) {
  std::ofstream out(path, std::ios::binary);
  out << bytes;
}

template <class Call>
std::string errorOf(Call call) {
  try {
    call();
  } catch (const InputError& e) {
    return e.what();
  }
  return "no InputError";
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

  void save() { saveMap(path_, map_, someInfo(map_), someKeyPoses()); }
  [[nodiscard]] std::string openingError() const {
    return errorOf([&] { MapFile file(path_); });
  }
  [[nodiscard]] std::size_t filesInFolder() const {
    const std::filesystem::directory_iterator entries(folder_);
    return static_cast<std::size_t>(std::distance(begin(entries), end(entries)));
  }

  std::filesystem::path folder_;
  std::string path_;
  TiledMap map_ = groundMap(32, 64, 2);
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
  EXPECT_EQ(openingError(), "no InputError");
  fs::permissions(folder_, fs::perms::owner_all);
}

TEST_F(MapFileTest, HashSeesEveryPartOfTheContentButNotTheProgram) {
  save();
  const std::string hash = MapFile(path_).contentHash();
  EXPECT_EQ(hash.substr(0, 4), "md5:");
  EXPECT_EQ(hash.size(), 36U);
  const auto hashWith = [&](const TiledMap& map, const MapInfo& info, const std::vector<KeyPose>& poses) {
    saveMap(path_, map, info, poses);
    return MapFile(path_).contentHash();
  };
  const MapInfo info = someInfo(map_);
  MapInfo changed = info;
  changed.tool_version = "0.2.0";
  EXPECT_EQ(hashWith(map_, changed, someKeyPoses()), hash);
  changed = info;
  changed.config += "\n";
  EXPECT_NE(hashWith(map_, changed, someKeyPoses()), hash);
  changed = info;
  changed.origin->height_m += 1e-6;
  EXPECT_NE(hashWith(map_, changed, someKeyPoses()), hash);
  changed.origin.reset();
  EXPECT_NE(hashWith(map_, changed, someKeyPoses()), hash);
  changed = info;
  changed.sessions.emplace_back("evening");
  EXPECT_NE(hashWith(map_, changed, someKeyPoses()), hash);
  auto poses = someKeyPoses();
  poses[3].T_map_body.translation().x() += 1e-9;
  EXPECT_NE(hashWith(map_, info, poses), hash);
  Sample one;
  push(one, {0, 0, 0});
  TiledMap larger = map_;
  larger.insert(one.cloud, one.covariances.view());
  EXPECT_NE(hashWith(larger, info, someKeyPoses()), hash);
  EXPECT_EQ(hashWith(map_, info, someKeyPoses()), hash);
}

TEST_F(MapFileTest, AMapWithoutAnythingIsAMap) {
  const TiledMap nothing(32);
  MapInfo info = someInfo(nothing);
  info.sessions.clear();
  info.config = "";
  info.origin->latitude_deg = -0.0;
  saveMap(path_, nothing, info, {});
  const MapFile file(path_);
  file.verify();
  EXPECT_TRUE(file.tileIndices().empty());
  EXPECT_TRUE(file.keyPoses().empty());
  EXPECT_EQ(file.info().config, "");
  EXPECT_FALSE(file.tile(0, 0).has_value());
}

TEST_F(MapFileTest, RefusesAMapThatContradictsItself) {
  MapInfo info = someInfo(map_);
  info.tile_size_m = 16;
  EXPECT_THROW(saveMap(path_, map_, info, {}), std::invalid_argument);
  info = someInfo(map_);
  info.origin->latitude_deg = std::numeric_limits<double>::quiet_NaN();
  EXPECT_THROW(saveMap(path_, map_, info, {}), std::invalid_argument);
  auto poses = someKeyPoses();
  poses.back().session = "midnight";
  EXPECT_THROW(saveMap(path_, map_, someInfo(map_), poses), std::invalid_argument);
  EXPECT_EQ(filesInFolder(), 0U);
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

TEST_F(MapFileTest, SaysThatTheFormatIsNewer) {
  save();
  std::string bytes = bytesOf(path_);
  bytes[63] = 2;  // sqlite.org/fileformat.html: the user version
  write(path_, bytes);
  EXPECT_THAT(openingError(), HasSubstr("is of map format 2, but this program reads format 1"));
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
  Sample marked;  // four heights in a row that the file holds nowhere else
  for (int i = 0; i < 4; ++i) push(marked, {-1, 33, 77 + 0.125F * static_cast<float>(i)});
  TiledMap map = map_;
  map.insert(marked.cloud, marked.covariances.view());
  saveMap(path_, map, someInfo(map), {});
  std::string heights(4 * sizeof(float), '\0');
  std::memcpy(heights.data(), marked.cloud.z.data(), heights.size());
  std::string bytes = bytesOf(path_);
  const std::size_t at = bytes.find(heights);
  ASSERT_NE(at, std::string::npos);
  bytes[at] ^= 1;
  write(path_, bytes);

  const MapFile file(path_);
  const std::string expected = path_ + ": damaged: tile (-1, 1) does not fit its checksum";
  EXPECT_THAT(errorOf([&] { static_cast<void>(file.tile(-1, 1)); }), HasSubstr(expected));
  EXPECT_THAT(errorOf([&] { file.verify(); }), HasSubstr(expected));
  EXPECT_EQ(file.tile(0, 0)->cloud.x, map_.tiles().at({0, 0}).cloud.x);
}

TEST_F(MapFileTest, DamageToTheRestIsFoundOnOpening) {
  save();
  for (const std::string needle : {"tile_size_m = 32", "morning"}) {
    std::string bytes = bytesOf(path_);
    const std::size_t at = bytes.find(needle);
    ASSERT_NE(at, std::string::npos);
    bytes[at] ^= 1;
    write(path_, bytes);
    EXPECT_THAT(openingError(), HasSubstr("its content hash is md5:"));
    save();
  }
}

TEST_F(MapFileTest, AnUnwritableOutputLeavesNothing) {
  path_ = (folder_ / "missing" / "x.rlmap").string();
  EXPECT_THAT(errorOf([&] { save(); }), HasSubstr("output " + path_ + ": cannot be written"));
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
  const std::string error = errorOf([&] { save(); });
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
  TileWindow window(context_, file, 1, 20);
  EXPECT_EQ(window.target().size(), 0U);
  EXPECT_TRUE(
      window.moveTo({-48, -48}));  // the middle of tile (-2, -2): 16 m to its neighbours, all within reach
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

}  // namespace
}  // namespace raceloc
