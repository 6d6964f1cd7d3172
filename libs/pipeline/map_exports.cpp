#include "pipeline/map_exports.h"

#include <mrpt/img/color_maps.h>
#include <mrpt/io/CFileGZOutputStream.h>
#include <mrpt/maps/CSimpleMap.h>
#include <mrpt/obs/CObservationVelodyneScan.h>
#include <mrpt/obs/CSensoryFrame.h>
#include <mrpt/opengl/CGridPlaneXY.h>
#include <mrpt/opengl/COpenGLScene.h>
#include <mrpt/opengl/CPointCloudColoured.h>
#include <mrpt/opengl/CSetOfLines.h>
#include <mrpt/opengl/stock_objects.h>
#include <mrpt/poses/CPose3DPDFGaussian.h>
#include <mrpt/serialization/CArchive.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <map>
#include <utility>

#include "core/errors.h"
#include "core/output_file.h"
#include "sensors/gzip_length.h"
#include "sensors/mrpt_stamp.h"
#include "sensors/pose_conversion.h"

namespace raceloc {

namespace {

constexpr std::size_t kMostPoints = 3'000'000;
constexpr std::size_t kMostFrames = 200;
constexpr double kMostGridLines = 200;

/** The least n so that every n-th of `count` things are at most `most`. */
std::size_t strideFor(std::size_t count, std::size_t most) {
  return std::max<std::size_t>(1, (count + most - 1) / most);
}

/** Writes what MRPT's loadFromFile() of the object's class reads. */
void writeCompressed(const std::string& path, const mrpt::serialization::CSerializable& object) {
  OutputFile output(path);
  const auto failed = [&] { return cannotWrite(path); };
  std::uint64_t size = 0;
  try {
    constexpr int kFastest = 1;
    mrpt::io::CFileGZOutputStream file(output.temporaryPath(), mrpt::io::OpenMode::TRUNCATE, kFastest);
    mrpt::serialization::archiveFrom(file).WriteObject(object);
    size = file.getPosition();
  } catch (const std::exception&) {  // MRPT's stream says no more than that a write failed
    throw failed();
  }
  // Closing the stream hides a failure; the trailer is there only if all before it is.
  if (statedGzipLength(output.temporaryPath()) != static_cast<std::uint32_t>(size)) throw failed();
  output.commit();
}

struct ScenePoints {
  std::vector<Eigen::Vector3f> p_map_m;
  float low_m = 0, high_m = 1;  ///< heights between which all but 2 % at either end lie
};

ScenePoints scenePoints(const TiledMap& map) {
  ScenePoints points;
  const std::size_t stride = strideFor(map.pointCount(), kMostPoints);
  std::size_t number = 0;
  for (const auto& [index, tile] : map.tiles()) {
    const Eigen::Vector3f corner_m = tileCorner(tile, map.tileSize()).cast<float>();
    for (std::size_t i = 0; i < tile.cloud.size(); ++i)
      if (number++ % stride == 0) points.p_map_m.emplace_back(tile.cloud.point(i) + corner_m);
  }
  if (points.p_map_m.empty()) return points;
  std::vector<float> heights_m;
  heights_m.reserve(points.p_map_m.size());
  for (const Eigen::Vector3f& p : points.p_map_m) heights_m.push_back(p.z());
  const auto quantile = [&](std::size_t percent) {
    const auto at = heights_m.begin() + static_cast<std::ptrdiff_t>((heights_m.size() - 1) * percent / 100);
    std::nth_element(heights_m.begin(), at, heights_m.end());
    return *at;
  };
  points.low_m = quantile(2);
  points.high_m = std::max(quantile(98), points.low_m + 1e-3F);
  return points;
}

mrpt::opengl::CPointCloudColoured::Ptr colouredCloud(const ScenePoints& points) {
  auto cloud = mrpt::opengl::CPointCloudColoured::Create();
  cloud->setName("map points");
  cloud->setPointSize(2);
  cloud->reserve(points.p_map_m.size());
  for (const Eigen::Vector3f& p : points.p_map_m) {
    float red = 0, green = 0, blue = 0;
    const float share = (p.z() - points.low_m) / (points.high_m - points.low_m);
    mrpt::img::jet2rgb(0.15F + 0.75F * std::clamp(share, 0.0F, 1.0F), red, green, blue);  // no dark ends
    cloud->push_back(p.x(), p.y(), p.z(), red, green, blue);
  }
  return cloud;
}

mrpt::opengl::CSetOfLines::Ptr sessionLines(const std::vector<KeyPose>& key_poses) {
  auto lines = mrpt::opengl::CSetOfLines::Create();
  lines->setName("key poses");
  lines->setLineWidth(3);
  lines->setColor_u8(255, 0, 255);
  for (std::size_t i = 1; i < key_poses.size(); ++i) {
    if (key_poses[i].session != key_poses[i - 1].session) continue;
    const Eigen::Vector3d a = key_poses[i - 1].T_map_body.translation(),
                          b = key_poses[i].T_map_body.translation();
    lines->appendLine(a.x(), a.y(), a.z(), b.x(), b.y(), b.z());
  }
  return lines;
}

mrpt::opengl::CGridPlaneXY::Ptr groundGrid(const TiledMap& map, float height_m) {
  double low_x_m = 0, high_x_m = 0, low_y_m = 0, high_y_m = 0;  // with the origin, where the viewer starts
  for (const auto& [index, tile] : map.tiles()) {
    const Eigen::Vector3d corner_m = tileCorner(tile, map.tileSize());
    low_x_m = std::min(low_x_m, corner_m.x());
    low_y_m = std::min(low_y_m, corner_m.y());
    high_x_m = std::max(high_x_m, corner_m.x() + map.tileSize());
    high_y_m = std::max(high_y_m, corner_m.y() + map.tileSize());
  }
  double spacing_m = 10;
  while (std::max(high_x_m - low_x_m, high_y_m - low_y_m) / spacing_m > kMostGridLines) spacing_m *= 10;
  const auto down = [&](double v_m) { return static_cast<float>(std::floor(v_m / spacing_m) * spacing_m); };
  const auto up = [&](double v_m) { return static_cast<float>(std::ceil(v_m / spacing_m) * spacing_m); };
  auto grid = mrpt::opengl::CGridPlaneXY::Create(down(low_x_m), up(high_x_m), down(low_y_m), up(high_y_m),
                                                 height_m, static_cast<float>(spacing_m));
  grid->setName("grid of " + std::to_string(std::lround(spacing_m)) + " m");
  grid->setColor_u8(160, 160, 160);
  return grid;
}

/** Of MRPT 2.5.8's classes with points and intensities the one that its maps place at the robot's pose: they
 * place a CObservationPointCloud as if the robot never moved. */
mrpt::obs::CObservationVelodyneScan::Ptr toVelodyneScan(const ExportScan& scan) {
  auto out = mrpt::obs::CObservationVelodyneScan::Create();
  out->timestamp = toMrptStamp(scan.stamp_s);
  out->sensorLabel = "map";
  const Cloud& cloud = scan.cloud_body;
  auto& points = out->point_cloud;
  points.reserve(cloud.size());
  const auto rounded = [](float v_m) { return std::round(v_m * 512) / 512; };  // gzip bites on these
  for (std::size_t i = 0; i < cloud.size(); ++i) {
    points.x.push_back(rounded(cloud.x[i]));
    points.y.push_back(rounded(cloud.y[i]));
    points.z.push_back(rounded(cloud.z[i]));
    const float intensity = cloud.intensity.empty() ? 1 : std::clamp(cloud.intensity[i], 0.0F, 1.0F);
    points.intensity.push_back(static_cast<std::uint8_t>(std::lround(255 * intensity)));
  }
  return out;
}

/** Numbers of the key poses that are at least `spacing_m` from each other, horizontally, first come first served. */
std::vector<std::size_t> apart(const std::vector<KeyPose>& key_poses, double spacing_m) {
  std::map<std::pair<int, int>, std::vector<Eigen::Vector2d>>
      cells;  // of that size: neighbours are one cell away
  std::vector<std::size_t> kept;
  for (std::size_t i = 0; i < key_poses.size(); ++i) {
    const Eigen::Vector2d p_m = key_poses[i].T_map_body.translation().head<2>();
    const Eigen::Vector2i cell = (p_m / spacing_m).array().floor().cast<int>();
    bool is_free = true;
    for (int x = cell.x() - 1; is_free && x <= cell.x() + 1; ++x)
      for (int y = cell.y() - 1; is_free && y <= cell.y() + 1; ++y)
        if (const auto found = cells.find({x, y}); found != cells.end())
          for (const Eigen::Vector2d& other_m : found->second)
            is_free = is_free && (other_m - p_m).norm() >= spacing_m;
    if (!is_free) continue;
    cells[{cell.x(), cell.y()}].push_back(p_m);
    kept.push_back(i);
  }
  return kept;
}

}  // namespace

std::vector<ExportScan> scansOf(const TiledMap& map, const std::vector<KeyPose>& key_poses) {
  constexpr double kSpacing_m = 10;
  std::vector<ExportScan> scans;
  for (const std::size_t i : apart(key_poses, kSpacing_m))
    scans.push_back({key_poses[i].stamp_s, key_poses[i].T_map_body, {}});
  if (scans.empty()) return scans;
  const auto distance_m = [&](const ExportScan& scan, const Eigen::Vector2d& p_m) {
    return (scan.T_map_body.translation().head<2>() - p_m).norm();
  };
  const double diagonal_m = std::sqrt(2) * map.tileSize();
  for (const auto& [index, tile] : map.tiles()) {
    const Eigen::Vector3d corner_m = tileCorner(tile, map.tileSize());
    const Eigen::Vector2d centre_m = corner_m.head<2>().array() + map.tileSize() / 2;
    double nearest_m = std::numeric_limits<double>::infinity();
    for (const ExportScan& scan : scans) nearest_m = std::min(nearest_m, distance_m(scan, centre_m));
    std::vector<ExportScan*> near;  // no other can be nearest to a point of this tile
    for (ExportScan& scan : scans)
      if (distance_m(scan, centre_m) <= nearest_m + diagonal_m) near.push_back(&scan);
    for (std::size_t i = 0; i < tile.cloud.size(); ++i) {
      const Eigen::Vector3d p_map_m = corner_m + tile.cloud.point(i).cast<double>();
      ExportScan& scan = **std::min_element(near.begin(), near.end(), [&](const auto* a, const auto* b) {
        return distance_m(*a, p_map_m.head<2>()) < distance_m(*b, p_map_m.head<2>());
      });
      scan.cloud_body.push((scan.T_map_body.inverse() * p_map_m).cast<float>());
      if (!tile.cloud.intensity.empty()) scan.cloud_body.intensity.push_back(tile.cloud.intensity[i]);
    }
  }
  return scans;
}

void writeSimplemap(const std::string& path, const std::vector<ExportScan>& scans) {
  mrpt::maps::CSimpleMap map;
  for (const ExportScan& scan : scans) {
    if (scan.cloud_body.empty()) continue;  // MRPT's viewers stop at a scan without points
    auto frame = mrpt::obs::CSensoryFrame::Create();
    frame->insert(toVelodyneScan(scan));
    map.insert(mrpt::poses::CPose3DPDFGaussian::Create(toMrpt(scan.T_map_body)), frame);
  }
  writeCompressed(path, map);
}

void writeScene(const std::string& path, const TiledMap& map, const std::vector<KeyPose>& key_poses) {
  const ScenePoints points = scenePoints(map);
  mrpt::opengl::COpenGLScene scene;
  scene.getViewport()->setViewportClipDistances(0.5F, 20'000);
  scene.insert(groundGrid(map, points.low_m));
  scene.insert(colouredCloud(points));
  scene.insert(sessionLines(key_poses));
  for (std::size_t i = 0; i < key_poses.size(); i += strideFor(key_poses.size(), kMostFrames)) {
    const auto frame = mrpt::opengl::stock_objects::CornerXYZSimple(1, 2);
    frame->setPose(toMrpt(key_poses[i].T_map_body));
    scene.insert(frame);
  }
  writeCompressed(path, scene);
}

}  // namespace raceloc
