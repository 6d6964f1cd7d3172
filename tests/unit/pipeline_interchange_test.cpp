#include <gmock/gmock.h>
#include <mrpt/maps/CColouredPointsMap.h>
#include <mrpt/maps/CSimplePointsMap.h>

#include <fstream>
#include <iterator>
#include <map>
#include <nlohmann/json.hpp>
#include <sstream>
#include <string>
#include <vector>

#include "core/errors.h"
#include "pipeline/map_interchange.h"
#include "sensors/gps_conversion.h"
#include "sensors/pcd_folder.h"
#include "support/run_command.h"
#include "support/some_map.h"

namespace raceloc {
namespace {

using ::testing::HasSubstr;
using ::testing::IsEmpty;

std::string textOf(const std::string& path) {
  std::ifstream in(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(in), {}};
}

/** How often `part` is in `text`. */
std::size_t countOf(const std::string& text, const std::string& part) {
  std::size_t count = 0;
  for (std::size_t at = text.find(part); at != std::string::npos; at = text.find(part, at + 1)) ++count;
  return count;
}

class MapInterchangeTest : public ::testing::Test {
 protected:
  /** Its points in the map frame, in the order of the files. */
  [[nodiscard]] std::vector<Eigen::Vector3d> points() const {
    std::vector<Eigen::Vector3d> all;
    for (const auto& [index, tile] : map_.tiles())
      for (std::size_t i = 0; i < tile.cloud.size(); ++i)
        all.emplace_back(tileCorner(tile, 32) + tile.cloud.point(i).cast<double>());
    return all;
  }
  test::TemporaryFolder folder_;
  test::Random rnd_{11};
  TiledMap map_ = test::groundMap(32, 64, 2);
  MapContent content_ = test::someContent(rnd_, 32);
};

TEST_F(MapInterchangeTest, MrptReadsThePly) {
  writePly(folder_ / "x.ply", map_);
  mrpt::maps::CSimplePointsMap read;
  ASSERT_TRUE(read.loadFromPlyFile(folder_ / "x.ply"));
  const auto expected = points();
  ASSERT_EQ(read.size(), expected.size());
  for (std::size_t i = 0; i < expected.size(); ++i) {
    mrpt::math::TPoint3D p;
    read.getPoint(i, p);
    ASSERT_LT((Eigen::Vector3d(p.x, p.y, p.z) - expected[i]).norm(), 1e-5);  // float at 64 m
  }
}

TEST_F(MapInterchangeTest, PcdGivesThePointsAndTheIntensities) {
  writePcd(folder_ / "x.pcd", map_);
  const Cloud plain = readPcd(folder_ / "x.pcd", 1).cloud;
  const auto expected = points();
  ASSERT_EQ(plain.size(), expected.size());
  EXPECT_TRUE(plain.intensity.empty());
  for (std::size_t i = 0; i < expected.size(); ++i)
    ASSERT_LT((plain.point(i).cast<double>() - expected[i]).norm(), 1e-5);

  TiledMap bright(32);
  Cloud cloud;
  for (int i = 0; i < 50; ++i)
    cloud.push(rnd_.vectorWithin(15).cast<float>().cwiseAbs(), static_cast<float>(i) / 50);
  const std::vector<float> zeros(cloud.size());
  const float* zero = zeros.data();
  bright.insert(cloud, {zero, zero, zero, zero, zero, zero, zeros.size()});
  writePcd(folder_ / "bright.pcd", bright);
  EXPECT_EQ(readPcd(folder_ / "bright.pcd", 1).cloud.intensity, cloud.intensity);
}

TEST_F(MapInterchangeTest, OriginSaysWhereTheFrameLies) {
  writeOrigin(folder_ / "x.json", content_.info);
  const auto json = nlohmann::json::parse(textOf(folder_ / "x.json"));
  EXPECT_EQ(json.at("frame"), "ENU");
  EXPECT_EQ(json.at("latitude_deg"), content_.info.origin->latitude_deg);
  EXPECT_EQ(json.at("longitude_deg"), content_.info.origin->longitude_deg);
  EXPECT_EQ(json.at("height_m"), content_.info.origin->height_m);
  content_.info.origin.reset();
  writeOrigin(folder_ / "x.json", content_.info);
  EXPECT_EQ(nlohmann::json::parse(textOf(folder_ / "x.json")).at("frame"), "local");
}

TEST_F(MapInterchangeTest, GeoJsonLaysTheLinesOnTheGlobe) {
  writeGeoJson(folder_ / "x.geojson", content_);
  const auto json = nlohmann::json::parse(textOf(folder_ / "x.geojson"));
  EXPECT_EQ(json.at("type"), "FeatureCollection");
  std::map<std::string, nlohmann::json> lines;  // by name
  for (const auto& feature : json.at("features")) {
    EXPECT_EQ(feature.at("geometry").at("type"), "MultiLineString");
    lines[feature.at("properties").at("name")] = feature.at("geometry").at("coordinates");
  }
  const auto expectPoint = [&](const nlohmann::json& point, const Eigen::Vector3d& p_map_m) {
    const GeodeticPoint g{point.at(1), point.at(0), point.at(2)};
    EXPECT_LT((toMap(g, *content_.info.origin) - p_map_m).norm(), 3e-4);  // rounded to 0.1 mm on each axis
  };
  ASSERT_EQ(lines.size(), 5U);
  ASSERT_EQ(lines.at("noon").at(0).size(), 8U);
  for (std::size_t i = 0; i < 8; ++i)
    expectPoint(lines.at("noon")[0][i], content_.key_poses[12 + i].T_map_body.translation());
  const auto& racing = lines.at("racing line").at(0);
  ASSERT_EQ(racing.size(), 41U);  // closed
  EXPECT_EQ(racing.front(), racing.back());
  expectPoint(racing[7], content_.waypoints[7].p_map_m);
  const auto& wall = lines.at("left wall");
  ASSERT_EQ(wall.size(), 1U);  // one gap, at stations 10 to 12, and joined over the start line
  ASSERT_EQ(wall[0].size(), 37U);
  expectPoint(wall[0].front(), content_.walls[10].p_map_foot_m);
  expectPoint(wall[0].back(), content_.walls[9].p_map_foot_m);
}

TEST_F(MapInterchangeTest, KmlHasAPlacemarkALineAndEscapesNames) {
  const std::string name = "<\"morning\" & 'noon'>";
  for (std::string& session : content_.info.sessions)
    if (session == "morning") session = name;
  for (KeyPose& k : content_.key_poses)
    if (k.session == "morning") k.session = name;
  writeKml(folder_ / "x.kml", content_);
  const std::string kml = textOf(folder_ / "x.kml");
  EXPECT_EQ(countOf(kml, "<Placemark>"), 5U);
  EXPECT_THAT(kml, HasSubstr("<name>&lt;&quot;morning&quot; &amp; &apos;noon&apos;&gt;</name>"));
  const auto parsed =
      test::runCommand({"python3", "-c", "import sys, xml.dom.minidom; xml.dom.minidom.parse(sys.argv[1])",
                        folder_ / "x.kml"});
  EXPECT_EQ(parsed.exit_code, 0) << parsed.err;
}

TEST_F(MapInterchangeTest, WithoutAnOriginLinesHaveNoPlaceOnTheGlobe) {
  content_.info.origin.reset();
  EXPECT_THROW(writeGeoJson(folder_ / "x.geojson", content_), InputError);
  EXPECT_THROW(writeKml(folder_ / "x.kml", content_), InputError);
  EXPECT_THAT(folder_.names(), IsEmpty());
}

TEST_F(MapInterchangeTest, G2oHasEveryKeyPoseAndEdgeWithItsInformation) {
  writeG2o(folder_ / "x.g2o", content_);
  std::ifstream in(folder_ / "x.g2o");
  std::size_t vertices = 0, edges = 0;
  for (std::string line; std::getline(in, line);) {
    std::istringstream fields(line);
    std::string tag;
    fields >> tag;
    const auto number = [&] {
      double value = 0;
      fields >> value;
      return value;
    };
    const auto pose = [&] {
      const double x = number(), y = number(), z = number(), qx = number(), qy = number(), qz = number();
      Pose T(Eigen::Quaterniond(number(), qx, qy, qz));
      T.translation() = Eigen::Vector3d(x, y, z);
      return T;
    };
    const auto same = [](const Pose& a, const Pose& b) {
      return (a.matrix() - b.matrix()).cwiseAbs().maxCoeff() < 1e-12;
    };
    if (tag == "VERTEX_SE3:QUAT") {
      EXPECT_EQ(number(), static_cast<double>(vertices));
      EXPECT_TRUE(same(pose(), content_.key_poses[vertices++].T_map_body));
    } else if (tag == "EDGE_SE3:QUAT") {
      const MapEdge& edge = content_.edges[edges++];
      EXPECT_EQ(number(), edge.i);
      EXPECT_EQ(number(), edge.j);
      EXPECT_TRUE(same(pose(), edge.T_i_j));
      for (int row = 0; row < 6; ++row)
        for (int column = row; column < 6; ++column)  // translation first
          EXPECT_EQ(number(), edge.information((row + 3) % 6, (column + 3) % 6));
    } else {
      EXPECT_EQ(line, "FIX 0");
    }
    EXPECT_TRUE(fields) << line;
  }
  EXPECT_EQ(vertices, content_.key_poses.size());
  EXPECT_EQ(edges, content_.edges.size());
}

TEST_F(MapInterchangeTest, WithoutAnyContentTheFilesAreValid) {
  const MapContent nothing{content_.info, {}};
  writePly(folder_ / "x.ply", TiledMap(32));
  writePcd(folder_ / "x.pcd", TiledMap(32));
  writeGeoJson(folder_ / "x.geojson", nothing);
  writeKml(folder_ / "x.kml", nothing);
  writeG2o(folder_ / "x.g2o", nothing);
  EXPECT_TRUE(nlohmann::json::parse(textOf(folder_ / "x.geojson")).at("features").empty());
  EXPECT_TRUE(readPcd(folder_ / "x.pcd", 1).cloud.empty());
  EXPECT_EQ(textOf(folder_ / "x.g2o"), "");
  EXPECT_THROW(writePly(folder_ / "missing/x.ply", map_), InputError);
}

}  // namespace
}  // namespace raceloc
