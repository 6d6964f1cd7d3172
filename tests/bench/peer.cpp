#include "bench/peer.h"

#include <small_gicp/ann/gaussian_voxelmap.hpp>
#include <small_gicp/ann/kdtree.hpp>
#include <small_gicp/factors/gicp_factor.hpp>
#include <small_gicp/points/point_cloud.hpp>
#include <small_gicp/registration/reduction.hpp>
#include <small_gicp/registration/registration.hpp>
#include <small_gicp/util/downsampling.hpp>
#include <small_gicp/util/normal_estimation.hpp>

namespace raceloc::bench {

namespace {

constexpr int kNeighbours = 10;

using SerialGicp = small_gicp::Registration<small_gicp::GICPFactor, small_gicp::SerialReduction>;

PeerMatch toMatch(const small_gicp::RegistrationResult& result) {
  return {result.T_target_source, result.converged, static_cast<int>(result.iterations) + 1};
}

}  // namespace

struct PeerPoints {
  std::shared_ptr<small_gicp::PointCloud> cloud;
};
struct PeerTree {
  small_gicp::KdTree<small_gicp::PointCloud> tree;
};
struct PeerMap {
  small_gicp::GaussianVoxelMap map;
};

std::shared_ptr<PeerPoints> peerPoints(const Cloud& cloud) {
  auto points = std::make_shared<small_gicp::PointCloud>();
  points->resize(cloud.size());
  for (std::size_t i = 0; i < cloud.size(); ++i)
    points->point(i) = cloud.point(i).cast<double>().homogeneous();
  return std::make_shared<PeerPoints>(PeerPoints{std::move(points)});
}

Cloud cloudOf(const PeerPoints& points) {
  Cloud cloud;
  for (const auto& p : points.cloud->points) cloud.push(p.head<3>().cast<float>());
  return cloud;
}

gpu::Covariances covariancesOf(const PeerPoints& points) {
  gpu::Covariances out;
  for (const auto& double_C : points.cloud->covs) {
    const Eigen::Matrix3f C = double_C.topLeftCorner<3, 3>().cast<float>();
    out.xx.push_back(C(0, 0)), out.xy.push_back(C(0, 1)), out.xz.push_back(C(0, 2));
    out.yy.push_back(C(1, 1)), out.yz.push_back(C(1, 2)), out.zz.push_back(C(2, 2));
    out.neighbours.push_back(kNeighbours);
  }
  return out;
}

std::shared_ptr<PeerPoints> peerVoxelGrid(const PeerPoints& points, double voxel_m) {
  return std::make_shared<PeerPoints>(PeerPoints{small_gicp::voxelgrid_sampling(*points.cloud, voxel_m)});
}

std::shared_ptr<PeerTree> peerCovariances(const std::shared_ptr<PeerPoints>& points) {
  auto tree = std::make_shared<PeerTree>(PeerTree{small_gicp::KdTree<small_gicp::PointCloud>(points->cloud)});
  small_gicp::estimate_covariances(*points->cloud, tree->tree, kNeighbours);
  return tree;
}

std::shared_ptr<PeerMap> peerVoxelMap(const PeerPoints& points, double voxel_m) {
  auto map = std::make_shared<PeerMap>(PeerMap{small_gicp::GaussianVoxelMap(voxel_m)});
  map->map.insert(*points.cloud);
  return map;
}

PeerMatch peerVgicp(const PeerMap& target, const PeerPoints& source, const Pose& guess) {
  return toMatch(SerialGicp().align(target.map, *source.cloud, target.map, guess));
}

PeerMatch peerGicp(const PeerPoints& target, const PeerTree& tree, const PeerPoints& source,
                   const Pose& guess) {
  return toMatch(SerialGicp().align(*target.cloud, *source.cloud, tree.tree, guess));
}

PeerOdometry::PeerOdometry(double scan_voxel_m, double map_voxel_m)
    : x_scan_voxel_m(scan_voxel_m),
      x_map(std::make_unique<PeerMap>(PeerMap{small_gicp::GaussianVoxelMap(map_voxel_m)})) {}

PeerOdometry::~PeerOdometry() = default;

Pose PeerOdometry::add(const PeerPoints& scan, const Pose& guess) {
  const auto points = peerVoxelGrid(scan, x_scan_voxel_m);
  (void)peerCovariances(points);
  const Pose T = x_empty ? guess : peerVgicp(*x_map, *points, guess).T_target_source;
  x_map->map.insert(*points->cloud, T);
  x_empty = false;
  return T;
}

}  // namespace raceloc::bench
