#include <unistd.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <filesystem>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <tuple>
#include <utility>
#include <vector>

#include "map/map_file.h"
#include "map/tile_query.h"
#include "map/tiled_map.h"
#include "support/some_map.h"

namespace raceloc {
namespace {

using test::forAll;
using test::Random;

struct Sample {
  Cloud cloud;
  gpu::Covariances covariances;
};

Sample randomSample(Random& rnd, int points, double size_m, bool with_intensity) {
  Sample sample;
  for (int i = 0; i < points; ++i) {
    sample.cloud.push(rnd.vectorWithin(size_m).cast<float>());
    if (with_intensity) sample.cloud.intensity.push_back(static_cast<float>(rnd.uniform(0, 1)));
    gpu::Covariances& c = sample.covariances;
    for (std::vector<float>* array : {&c.xx, &c.xy, &c.xz, &c.yy, &c.yz, &c.zz})
      array->push_back(static_cast<float>(rnd.normal()));
  }
  return sample;
}

MapInfo infoOf(const TiledMap& map, Random& rnd) {
  std::optional<GeodeticPoint> origin;
  if (rnd.oneOf({true, false}))
    origin = GeodeticPoint{rnd.uniform(-90, 90), rnd.uniform(-180, 180), rnd.uniform(-400, 9000)};
  return {origin,
          map.tileSize(),
          rnd.uniform(0, 1),
          "0.1.0",
          std::string("[map]\n\0\xC3\xA4", 9),  // a zero byte and UTF-8 come back too
          {"a", "b"}};
}

std::vector<KeyPose> keyPoses(Random& rnd, int count) {
  std::vector<KeyPose> poses;
  poses.reserve(static_cast<std::size_t>(count));
  for (int i = 0; i < count; ++i)
    poses.push_back({rnd.uniform(0, 2e9), rnd.pose(3, 5000), rnd.oneOf({"a", "b"})});
  return poses;
}

/** A file of this process that is removed with it. */
class ScratchFile {
 public:
  ScratchFile()
      : x_path((std::filesystem::temp_directory_path() /
                ("raceloc_map_law_" + std::to_string(getpid()) + ".rlmap"))
                   .string()) {}
  ~ScratchFile() { std::filesystem::remove(x_path); }
  ScratchFile(const ScratchFile&) = delete;
  ScratchFile& operator=(const ScratchFile&) = delete;
  [[nodiscard]] const std::string& path() const { return x_path; }

 private:
  std::string x_path;
};

TEST(TiledMapProperty, EveryPointComesBackFromTheTileItIsOn) {
  forAll(100, [](Random& rnd) {
    const double tile_size_m = rnd.oneOf({32.0, 1.0, 7.3});
    Sample sample = randomSample(rnd, 200, 3000, rnd.oneOf({true, false}));
    for (int i = 0; i < 50; ++i)  // corners of tiles belong to the law
      sample.cloud.x[static_cast<std::size_t>(i)] = static_cast<float>(rnd.integer(-9, 9) * tile_size_m);
    TiledMap map(tile_size_m);
    map.insert(sample.cloud, sample.covariances.view());
    EXPECT_EQ(map.pointCount(), sample.cloud.size());

    std::map<std::pair<int, int>, std::size_t> next;  // within a tile the order is kept
    for (std::size_t i = 0; i < sample.cloud.size(); ++i) {
      const Eigen::Vector3d p_map_m = sample.cloud.point(i).cast<double>();
      const std::pair index{static_cast<int>(std::floor(p_map_m.x() / tile_size_m)),
                            static_cast<int>(std::floor(p_map_m.y() / tile_size_m))};
      ASSERT_EQ(map.tiles().count(index), 1U);
      const Tile& tile = map.tiles().at(index);
      const std::size_t at = next[index]++;
      ASSERT_LT(at, tile.cloud.size());
      const Eigen::Vector3d back_m = tile.cloud.point(at).cast<double>() +
                                     Eigen::Vector3d(tile.ix * tile_size_m, tile.iy * tile_size_m, 0);
      EXPECT_LE((back_m - p_map_m).cwiseAbs().maxCoeff(), 2e-6);  // float at one tile: 32 m * 2^-24
      EXPECT_GE(tile.cloud.point(at).head<2>().minCoeff(), 0);
      EXPECT_LE(tile.cloud.point(at).head<2>().maxCoeff(), static_cast<float>(tile_size_m));
      EXPECT_EQ(tile.covariances.yz[at], sample.covariances.yz[i]);
      if (!sample.cloud.intensity.empty()) {
        EXPECT_EQ(tile.cloud.intensity[at], sample.cloud.intensity[i]);
      }
    }
  });
}

TEST(MapFileProperty, GivesBackEveryBit) {
  forAll(20, [](Random& rnd) {
    const ScratchFile scratch;
    TiledMap map(rnd.oneOf({32.0, 7.3}));
    const Sample sample = randomSample(rnd, rnd.integer(0, 2000), 100, rnd.oneOf({true, false}));
    map.insert(sample.cloud, sample.covariances.view());
    MapContent content = test::someContent(rnd, map.tileSize());
    if (rnd.oneOf({true, false})) content.info.origin.reset();
    content.info.config = std::string("[map]\n\0\xC3\xA4", 9);  // a zero byte and UTF-8 come back too
    saveMap(scratch.path(), map, content);

    const MapFile file(scratch.path());
    file.verify();
    const MapContent& read = file.content();
    ASSERT_EQ(read.info.origin.has_value(), content.info.origin.has_value());
    if (content.info.origin) {
      EXPECT_EQ(read.info.origin->latitude_deg, content.info.origin->latitude_deg);
      EXPECT_EQ(read.info.origin->longitude_deg, content.info.origin->longitude_deg);
      EXPECT_EQ(read.info.origin->height_m, content.info.origin->height_m);
    }
    EXPECT_EQ(read.info.tile_size_m, content.info.tile_size_m);
    EXPECT_EQ(read.info.point_spacing_m, content.info.point_spacing_m);
    EXPECT_EQ(read.info.waypoint_spacing_m, content.info.waypoint_spacing_m);
    EXPECT_EQ(read.info.tool_version, content.info.tool_version);
    EXPECT_EQ(read.info.config, content.info.config);
    EXPECT_EQ(read.info.sessions, content.info.sessions);
    const auto expectSamePose = [](const std::optional<Pose>& a, const std::optional<Pose>& b) {
      ASSERT_EQ(a.has_value(), b.has_value());
      if (a) {
        EXPECT_EQ(a->matrix(), b->matrix());
      }
    };
    const auto expectSame = [](const auto& a, const auto& b, const auto& compare) {
      ASSERT_EQ(a.size(), b.size());
      for (std::size_t i = 0; i < a.size(); ++i) compare(a[i], b[i]);
    };
    expectSame(read.key_poses, content.key_poses, [&](const KeyPose& a, const KeyPose& b) {
      EXPECT_EQ(a.stamp_s, b.stamp_s);
      EXPECT_EQ(a.session, b.session);
      EXPECT_EQ(a.racetrack_id, b.racetrack_id);
      expectSamePose(a.T_map_body, b.T_map_body);
      expectSamePose(a.T_map_body_gps, b.T_map_body_gps);
      expectSamePose(a.T_map_body_lidar, b.T_map_body_lidar);
    });
    expectSame(read.waypoints, content.waypoints, [](const MapWaypoint& a, const MapWaypoint& b) {
      EXPECT_EQ(a.p_map_m, b.p_map_m);
      EXPECT_EQ(a.heading_rad, b.heading_rad);
    });
    expectSame(read.edges, content.edges, [&](const MapEdge& a, const MapEdge& b) {
      EXPECT_EQ(std::tuple(a.i, a.j, a.kind), std::tuple(b.i, b.j, b.kind));
      expectSamePose(a.T_i_j, b.T_i_j);
      EXPECT_EQ(a.information, b.information);
    });
    expectSame(read.fixes, content.fixes, [](const MapFix& a, const MapFix& b) {
      EXPECT_EQ(std::tuple(a.key, a.receiver, a.weight), std::tuple(b.key, b.receiver, b.weight));
      EXPECT_EQ(a.p_map_antenna_m, b.p_map_antenna_m);
      EXPECT_EQ(a.cov_map_m2, b.cov_map_m2);
      EXPECT_EQ(a.p_body_antenna_m, b.p_body_antenna_m);
    });
    expectSame(read.road, content.road, [](const RoadStation& a, const RoadStation& b) {
      EXPECT_EQ(std::tuple(a.station_m, a.height_m, a.grade_rad, a.bank_rad),
                std::tuple(b.station_m, b.height_m, b.grade_rad, b.bank_rad));
    });
    expectSame(read.walls, content.walls, [](const WallPoint& a, const WallPoint& b) {
      EXPECT_EQ(std::tuple(a.station_m, a.side, a.height_m), std::tuple(b.station_m, b.side, b.height_m));
      EXPECT_EQ(a.p_map_foot_m, b.p_map_foot_m);
    });
    ASSERT_EQ(file.tileIndices().size(), map.tiles().size());
    for (const auto& [index, tile] : map.tiles()) {
      const auto kept = file.tile(index.first, index.second);
      ASSERT_TRUE(kept.has_value());
      EXPECT_EQ(std::pair(kept->ix, kept->iy), index);
      EXPECT_EQ(kept->cloud.x, tile.cloud.x);
      EXPECT_EQ(kept->cloud.y, tile.cloud.y);
      EXPECT_EQ(kept->cloud.z, tile.cloud.z);
      EXPECT_EQ(kept->cloud.intensity, tile.cloud.intensity);
      EXPECT_EQ(kept->covariances.xx, tile.covariances.xx);
      EXPECT_EQ(kept->covariances.xy, tile.covariances.xy);
      EXPECT_EQ(kept->covariances.xz, tile.covariances.xz);
      EXPECT_EQ(kept->covariances.yy, tile.covariances.yy);
      EXPECT_EQ(kept->covariances.yz, tile.covariances.yz);
      EXPECT_EQ(kept->covariances.zz, tile.covariances.zz);
    }
    EXPECT_FALSE(file.tile(1 << 19, 0).has_value());
  });
}

TEST(MapFileProperty, HashDoesNotDependOnTheOrderOfSeparateTiles) {
  forAll(10, [](Random& rnd) {
    std::vector<Sample> squares;  // each on a tile of its own
    for (int i = 0; i < 8; ++i) {
      Sample square = randomSample(rnd, 50, 15, true);
      for (float& x : square.cloud.x) x += 16 + 32 * static_cast<float>(i);
      squares.push_back(square);
    }
    Random content(1);
    const MapInfo info = infoOf(TiledMap(32), content);
    const auto poses = keyPoses(content, 5);
    std::set<std::string> hashes;
    for (int round = 0; round < 3; ++round) {
      TiledMap map(32);
      for (const Sample& square : squares) map.insert(square.cloud, square.covariances.view());
      const ScratchFile scratch;
      saveMap(scratch.path(), map, {info, poses});
      hashes.insert(MapFile(scratch.path()).contentHash());
      std::rotate(squares.begin(), squares.begin() + rnd.integer(1, 7), squares.end());
    }
    EXPECT_EQ(hashes.size(), 1U);
  });
}

TEST(TileWindowProperty, HasTheSameBitsHoweverLongTheOtherThreadTakes) {
  forAll(5, [&](Random& rnd) {
    const Sample sample = randomSample(rnd, 4000, 150, false);
    TiledMap map(16);
    map.insert(sample.cloud, sample.covariances.view());
    const ScratchFile scratch;
    saveMap(scratch.path(), map, {infoOf(map, rnd), {}});
    std::vector<Eigen::Vector2d> positions{rnd.vectorWithin(100).head<2>()};
    double heading_rad = rnd.uniform(-3, 3);
    for (int i = 0; i < 150; ++i) {
      heading_rad += rnd.normal(0.2);
      const double step_m = rnd.uniform(0, 1) < 0.02 ? 60 : rnd.uniform(0, 9);  // jumps belong to the law
      positions.emplace_back(positions.back() +
                             step_m * Eigen::Vector2d(std::cos(heading_rad), std::sin(heading_rad)));
    }
    /** The targets that came into use, by the number of the call. */
    using Targets =
        std::map<std::size_t, std::tuple<std::vector<float>, std::vector<float>, std::vector<int>>>;
    const auto targets = [&](int idle_rounds) {
      const MapFile file(scratch.path());
      gpu::Context context(gpu::Backend::cpu);
      TileWindow window(context, file, 1, 25);
      Targets found;
      for (std::size_t i = 0; i < positions.size(); ++i) {
        const std::size_t before = window.rebuilds();
        window.moveTo(positions[i]);
        for (int k = 0; k < idle_rounds; ++k) static_cast<void>(window.target().contents());
        if (window.rebuilds() == before) continue;
        gpu::VoxelGaussians held = window.target().contents();
        found[i] = {held.mean.x, held.covariance.yz, held.covariance.neighbours};
      }
      return found;
    };
    const Targets in_a_hurry = targets(0);
    EXPECT_GT(in_a_hurry.size(), 5U);
    EXPECT_EQ(targets(20), in_a_hurry);
  });
}

TEST(TileWindowProperty, CoversTheRadiusAndRebuildsAtMostOnceInHalfATile) {
  const double tile_size_m = 16, radius_m = 25, step_m = 1.7;
  forAll(10, [&](Random& rnd) {
    const Sample sample = randomSample(rnd, 4000, 150, false);
    TiledMap map(tile_size_m);
    map.insert(sample.cloud, sample.covariances.view());
    const ScratchFile scratch;
    saveMap(scratch.path(), map, {infoOf(map, rnd), {}});
    const MapFile file(scratch.path());
    gpu::Context context(gpu::Backend::cpu);
    TileWindow window(context, file, 1, radius_m);

    Eigen::Vector2d p_map_m = rnd.vectorWithin(100).head<2>();
    double heading_rad = rnd.uniform(-3, 3), driven_m = 0;
    for (int i = 0; i < 150; ++i) {
      const bool there = window.moveTo(p_map_m);
      if (i % 10 == 0) {
        const gpu::VoxelGaussians held = window.target().contents();
        std::set<std::array<int, 3>> voxels;
        for (std::size_t v = 0; v < held.size(); ++v) voxels.insert({held.ix[v], held.iy[v], held.iz[v]});
        std::size_t near = 0, missing = 0;
        for (std::size_t k = 0; k < sample.cloud.size(); ++k) {
          const Eigen::Vector3d q_map_m = sample.cloud.point(k).cast<double>();
          if ((q_map_m.head<2>() - p_map_m).norm() > radius_m) continue;
          ++near;
          const Eigen::Vector3i voxel = q_map_m.array().floor().matrix().cast<int>();
          missing += voxels.count({voxel.x(), voxel.y(), voxel.z()}) == 0 ? 1 : 0;
        }
        EXPECT_LE(missing, 1U);  // a point within 2 um of a voxel's face may change sides by rounding
        EXPECT_TRUE(there || near == 0);
      }
      const double across = 2 * (radius_m + tile_size_m) / tile_size_m + 2;
      EXPECT_LE(static_cast<double>(window.residentTiles()), across * across);
      heading_rad += rnd.normal(0.3);
      p_map_m += step_m * Eigen::Vector2d(std::cos(heading_rad), std::sin(heading_rad));
      driven_m += step_m;
    }
    EXPECT_LE(static_cast<double>(window.rebuilds()), 1 + driven_m / (0.5 * tile_size_m));
  });
}

}  // namespace
}  // namespace raceloc
