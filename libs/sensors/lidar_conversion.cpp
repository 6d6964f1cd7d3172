#include "sensors/lidar_conversion.h"

#include <mrpt/maps/CColouredPointsMap.h>
#include <mrpt/maps/CPointsMapXYZI.h>
#include <mrpt/obs/CObservationPointCloud.h>
#include <mrpt/obs/CObservationVelodyneScan.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include "core/errors.h"
#include "sensors/mrpt_stamp.h"
#include "sensors/pose_conversion.h"

namespace raceloc {

namespace {

constexpr float kCoordinateSteps = 512;  // per metre
constexpr float kTimeSteps = 131072;     // per second
constexpr float kAbsent = -1;

float roundedTo(float steps, float value) { return std::round(value * steps) / steps; }

bool isFinite(float x, float y, float z) { return std::isfinite(x) && std::isfinite(y) && std::isfinite(z); }

bool allAbsent(const std::vector<float>& channel) {
  return std::all_of(channel.begin(), channel.end(), [](float v) { return v < 0; });
}

void readCloud(const mrpt::maps::CPointsMap& map, Scan& scan) {
  const auto* coloured = dynamic_cast<const mrpt::maps::CColouredPointsMap*>(&map);
  const auto* with_intensity = dynamic_cast<const mrpt::maps::CPointsMapXYZI*>(&map);
  const auto& x = map.getPointsBufferRef_x();
  const auto& y = map.getPointsBufferRef_y();
  const auto& z = map.getPointsBufferRef_z();
  scan.cloud.reserve(x.size());
  if (coloured != nullptr) {
    scan.cloud.intensity.reserve(x.size());
    scan.ring.reserve(x.size());
    scan.time_s.reserve(x.size());
  }
  for (std::size_t i = 0; i < x.size(); ++i) {
    if (!isFinite(x[i], y[i], z[i])) continue;
    scan.cloud.push({x[i], y[i], z[i]});
    if (coloured != nullptr) {
      float r = 0;
      float g = 0;
      float b = 0;
      coloured->getPointColor_fast(i, r, g, b);
      scan.cloud.intensity.push_back(r);
      scan.ring.push_back(g < 0 ? g : std::round(g * 255));
      scan.time_s.push_back(b);
    } else if (with_intensity != nullptr) {
      scan.cloud.intensity.push_back(with_intensity->getPointIntensity_fast(i));
    }
  }
  for (auto* channel : {&scan.cloud.intensity, &scan.ring, &scan.time_s})
    if (allAbsent(*channel)) channel->clear();
}

/** Takes the points of a Velodyne scan one by one, as MRPT decodes its packets. */
class VelodynePoints : public mrpt::obs::CObservationVelodyneScan::PointCloudStorageWrapper {
 public:
  explicit VelodynePoints(Scan& scan) : x_scan(scan) {}
  virtual ~VelodynePoints() = default;  // MRPT forgot its own
  void add_point(float x, float y, float z, std::uint8_t intensity, const mrpt::system::TTimeStamp& stamp,
                 float /*azimuth*/, std::uint16_t laser) override {
    if (!isFinite(x, y, z)) return;
    x_scan.cloud.push({x, y, z}, static_cast<float>(intensity) / 255);
    x_scan.ring.push_back(static_cast<float>(laser));
    x_stamps.push_back(stamp);
  }
  /** Stamps relative to the first point's, which becomes the scan's. */
  void finish() {
    if (x_stamps.empty()) return;
    const auto first = *std::min_element(x_stamps.begin(), x_stamps.end());
    x_scan.stamp_s = fromMrptStamp(first);
    for (const auto& stamp : x_stamps)
      x_scan.time_s.push_back(static_cast<float>((stamp - first).count()) * 1e-7F);
  }

 private:
  Scan& x_scan;
  std::vector<mrpt::system::TTimeStamp> x_stamps;
};

}  // namespace

std::shared_ptr<mrpt::obs::CObservationPointCloud> toObservation(const Scan& scan) {
  auto map = mrpt::maps::CColouredPointsMap::Create();
  map->reserve(scan.cloud.size());
  for (std::size_t i = 0; i < scan.cloud.size(); ++i) {
    const Eigen::Vector3f p = scan.cloud.point(i);
    map->insertPointFast(roundedTo(kCoordinateSteps, p.x()), roundedTo(kCoordinateSteps, p.y()),
                         roundedTo(kCoordinateSteps, p.z()));
    map->setPointColor_fast(
        i, scan.cloud.intensity.empty() ? kAbsent : scan.cloud.intensity[i],
        scan.ring.empty() ? kAbsent : scan.ring[i] / 255,
        scan.time_s.empty() ? kAbsent : roundedTo(kTimeSteps, std::max(0.0F, scan.time_s[i])));
  }
  auto observation = mrpt::obs::CObservationPointCloud::Create();
  observation->sensorLabel = scan.label;
  observation->timestamp = toMrptStamp(scan.stamp_s);
  observation->sensorPose = toMrpt(scan.T_body_lidar);
  observation->pointcloud = std::move(map);
  return observation;
}

std::optional<Scan> scanFromObservation(const mrpt::obs::CObservation& observation) {
  Scan scan{fromMrptStamp(observation.timestamp), observation.sensorLabel, Pose::Identity(), {}, {}, {}};
  if (const auto* cloud = dynamic_cast<const mrpt::obs::CObservationPointCloud*>(&observation)) {
    if (cloud->isExternallyStored())
      throw InputError("LiDAR " + scan.label + ": its points are in the file " +
                       cloud->getExternalStorageFile() +
                       " beside the rawlog; put them into it with rawlog-edit --de-externalize");
    scan.T_body_lidar = fromMrpt(cloud->sensorPose);
    if (cloud->pointcloud) readCloud(*cloud->pointcloud, scan);
    return scan;
  }
  if (const auto* velodyne = dynamic_cast<const mrpt::obs::CObservationVelodyneScan*>(&observation)) {
    scan.T_body_lidar = fromMrpt(velodyne->sensorPose);
    mrpt::obs::CObservationVelodyneScan packets = *velodyne;  // decoding is not const
    mrpt::obs::CObservationVelodyneScan::TGeneratePointCloudParameters parameters;
    parameters.generatePerPointTimestamp = true;
    VelodynePoints points(scan);
    packets.generatePointCloud(points, parameters);
    points.finish();
    return scan;
  }
  return std::nullopt;
}

}  // namespace raceloc
