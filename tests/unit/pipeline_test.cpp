#include <gmock/gmock.h>
#include <mrpt/maps/CSimpleMap.h>
#include <mrpt/maps/CSimplePointsMap.h>
#include <mrpt/maps/registerAllClasses.h>
#include <mrpt/opengl/COpenGLScene.h>
#include <mrpt/opengl/CPointCloudColoured.h>
#include <mrpt/opengl/CSetOfLines.h>
#include <mrpt/poses/CPose3DPDFGaussian.h>
#include <sys/resource.h>
#include <unistd.h>

#include <csignal>
#include <filesystem>
#include <string>
#include <vector>

#include "core/errors.h"
#include "pipeline/map_exports.h"
#include "pipeline/mapper.h"
#include "sensors/mrpt_stamp.h"
#include "sensors/pose_conversion.h"
#include "support/some_map.h"

namespace raceloc {
namespace {

class MapExportsTest : public ::testing::Test {
 protected:
  void SetUp() override {
    mrpt::maps::registerAllClasses_mrpt_maps();
    folder_ = std::filesystem::temp_directory_path() / ("raceloc_exports_" + std::to_string(getpid()));
    std::filesystem::create_directories(folder_);
  }
  void TearDown() override { std::filesystem::remove_all(folder_); }
  [[nodiscard]] std::string path(const std::string& name) const { return (folder_ / name).string(); }

  std::filesystem::path folder_;
  test::Random rnd_{5};
};

std::vector<ExportScan> someScans(test::Random& rnd) {
  std::vector<ExportScan> scans;
  for (int i = 0; i < 5; ++i) {
    ExportScan scan{1.3e9 + 0.1 * i, rnd.pose(1, 2000), {}};
    for (int k = 0; k < 1000; ++k) scan.cloud_body.push(rnd.vectorWithin(60).cast<float>());
    scans.push_back(scan);
  }
  return scans;
}

TEST_F(MapExportsTest, LogsOfPlacesFarApartAreToldBeforeTheWork) {
  const auto log = [&](const std::string& name, const GeodeticPoint& origin) {
    LogWriter writer(path(name), {origin, ""});
    writer.write(Scan{1e9, "lidar", Pose::Identity(), {{1}, {2}, {3}, {0.5F}}, {0.0F}, {}});
    writer.write(GpsFix{1e9, "gps", {0, 0, 0}, Eigen::Matrix3d::Identity(), {0, 0, 0}, 4});
    writer.commit();
    return path(name);
  };
  const std::string lor = log("lor.rawlog", {39.813, -86.341, 250}),
                    again = log("again.rawlog", {39.815, -86.341, 250}),
                    ims = log("ims.rawlog", {39.795, -86.235, 220});
  const auto nobody = [](const std::string&, double) {};
  EXPECT_EQ(mapInput({lor, again}, "", {}, nobody).logs.size(), 2U);
  EXPECT_THAT(
      [&] {
        (void)mapInput({lor, again, ims}, "", {}, nobody);
      },
      ::testing::ThrowsMessage<InputError>(
          ::testing::AllOf(::testing::HasSubstr("rawlog " + ims + ": of another place, 9"),
                           ::testing::HasSubstr("map it alone"))));
}

TEST_F(MapExportsTest, SimplemapGivesMrptThePosesAndTheMap) {
  auto scans = someScans(rnd_);
  writeSimplemap(path("x.simplemap"), scans);
  mrpt::maps::CSimpleMap map;
  ASSERT_TRUE(map.loadFromFile(path("x.simplemap")));
  ASSERT_EQ(map.size(), scans.size());
  for (std::size_t i = 0; i < scans.size(); ++i) {
    const auto [pose, frame] = map.get(i);
    const Pose T_map_body = fromMrpt(pose->getMeanVal());
    EXPECT_LT((T_map_body.matrix() - scans[i].T_map_body.matrix()).cwiseAbs().maxCoeff(), 1e-9);  // by angles
    EXPECT_NEAR(fromMrptStamp(frame->getObservationByIndex(0)->timestamp), scans[i].stamp_s, 1e-6);
  }

  mrpt::maps::CSimplePointsMap points;  // as robot-map-gui builds it
  points.insertionOptions.minDistBetweenLaserPoints = 0;
  points.loadFromSimpleMap(map);
  std::size_t at = 0;
  for (const ExportScan& scan : scans)
    for (std::size_t k = 0; k < scan.cloud_body.size(); ++k, ++at) {
      ASSERT_LT(at, points.size());
      mrpt::math::TPoint3D p;
      points.getPoint(at, p);
      const Eigen::Vector3d p_map_m = scan.T_map_body * scan.cloud_body.point(k).cast<double>();
      EXPECT_LE((Eigen::Vector3d(p.x, p.y, p.z) - p_map_m).norm(), 2.5e-3);  // grid of 1/512 m, float at 2 km
    }
  EXPECT_EQ(at, points.size());
}

TEST_F(MapExportsTest, AScanWithoutPointsIsLeftOut) {
  auto scans = someScans(rnd_);
  scans[1].cloud_body = {};
  writeSimplemap(path("x.simplemap"), scans);
  mrpt::maps::CSimpleMap map;
  ASSERT_TRUE(map.loadFromFile(path("x.simplemap")));
  EXPECT_EQ(map.size(), scans.size() - 1);
}

TEST_F(MapExportsTest, SceneHoldsThePointsWhereTheMapHasThemAndALineForEachSession) {
  Cloud cloud;
  for (int i = 0; i < 2000; ++i) cloud.push(rnd_.vectorWithin(90).cast<float>());
  const std::vector<float> zeros(cloud.size());
  TiledMap map(32);
  const float* zero = zeros.data();
  map.insert(cloud, {zero, zero, zero, zero, zero, zero, zeros.size()});
  std::vector<KeyPose> poses;
  poses.reserve(9);
  for (int i = 0; i < 9; ++i) poses.push_back({i * 1.0, rnd_.pose(1, 90), i < 4 ? "a" : "b"});
  writeScene(path("x.3Dscene"), map, poses);

  mrpt::opengl::COpenGLScene scene;
  ASSERT_TRUE(scene.loadFromFile(path("x.3Dscene")));
  const auto points = scene.getByClass<mrpt::opengl::CPointCloudColoured>();
  ASSERT_TRUE(points);
  ASSERT_EQ(points->size(), cloud.size());
  Eigen::Vector3d mean_map_m = Eigen::Vector3d::Zero(), mean_scene_m = Eigen::Vector3d::Zero();
  for (std::size_t i = 0; i < cloud.size(); ++i) {
    mean_map_m += cloud.point(i).cast<double>() / static_cast<double>(cloud.size());
    const auto p = points->getPoint3Df(i);
    mean_scene_m += Eigen::Vector3d(p.x, p.y, p.z) / static_cast<double>(cloud.size());
  }
  EXPECT_LT((mean_map_m - mean_scene_m).norm(), 1e-4);
  const auto line = scene.getByClass<mrpt::opengl::CSetOfLines>();
  ASSERT_TRUE(line);
  EXPECT_EQ(line->getLineCount(), 7U);  // 3 steps of session a, 4 of session b, none between them
}

TEST_F(MapExportsTest, ScansOfAMapHoldEachPointOnceAndNearby) {
  const TiledMap map = test::groundMap(32, 64, 2);
  const auto poses = test::someContent(rnd_, 32).key_poses;
  const auto scans = scansOf(map, poses);
  ASSERT_GT(scans.size(), 10U);
  std::size_t points = 0;
  for (const ExportScan& scan : scans)
    for (std::size_t i = 0; i < scan.cloud_body.size(); ++i, ++points) {
      const Eigen::Vector3d p_map_m = scan.T_map_body * scan.cloud_body.point(i).cast<double>();
      EXPECT_NEAR(p_map_m.z(), 0.1, 1e-4);
      const auto away_m = [&](const Pose& T) { return (T.translation() - p_map_m).head<2>().norm(); };
      for (const ExportScan& other : scans)
        ASSERT_LE(away_m(scan.T_map_body), away_m(other.T_map_body) + 1e-4);
    }
  EXPECT_EQ(points, map.pointCount());
  EXPECT_TRUE(scansOf(map, {}).empty());
}

TEST_F(MapExportsTest, WithoutAnyContentTheFilesOpenAsWell) {
  writeSimplemap(path("x.simplemap"), {});
  writeScene(path("x.3Dscene"), TiledMap(32), {});
  mrpt::maps::CSimpleMap map;
  EXPECT_TRUE(map.loadFromFile(path("x.simplemap")));
  EXPECT_TRUE(map.empty());
  mrpt::opengl::COpenGLScene scene;
  EXPECT_TRUE(scene.loadFromFile(path("x.3Dscene")));
}

TEST_F(MapExportsTest, AFullDiskLeavesNothing) {
  const auto scans = someScans(rnd_);
  writeSimplemap(path("x.simplemap"), scans);
  const auto size = std::filesystem::file_size(path("x.simplemap"));
  std::filesystem::remove(path("x.simplemap"));
  rlimit limit{};
  getrlimit(RLIMIT_FSIZE, &limit);
  const auto handler = std::signal(SIGXFSZ, SIG_IGN);
  for (const rlim_t kept :
       {rlim_t{0}, rlim_t{size / 2}, rlim_t{size - 1}}) {  // the last: seen only on closing
    const rlimit small{kept, limit.rlim_max};
    setrlimit(RLIMIT_FSIZE, &small);
    EXPECT_THROW(writeSimplemap(path("x.simplemap"), scans), InputError) << kept;
    setrlimit(RLIMIT_FSIZE, &limit);
    EXPECT_TRUE(std::filesystem::is_empty(folder_)) << kept;
  }
  std::signal(SIGXFSZ, handler);
  EXPECT_THROW(writeScene(path("missing/x.3Dscene"), TiledMap(32), {}), InputError);
}

}  // namespace
}  // namespace raceloc
