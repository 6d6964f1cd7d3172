/** \file
 * small_gicp, the peer that the benches compare with, behind a border without its types. It is built only where
 * CMake's RACELOC_SMALL_GICP names an unpacked source package; call it inside `if constexpr (kPeerInstalled)`. */
#pragma once

#include <memory>

#include "cloud/covariances.h"
#include "core/types.h"
#include "registration/gicp_options.h"

namespace raceloc::bench {

#ifdef RACELOC_PEER
constexpr bool kPeerInstalled = true;
#else
constexpr bool kPeerInstalled = false;
#endif

/** Our options, set to what the peer does: its stop rule, its gate, no robust loss. Of its 20 iterations it counts only
 * the accepted ones; we count those too that the damping rejects. */
[[nodiscard]] inline GicpOptions gicpAsPeer() {
  GicpOptions o;
  o.max_iterations = 20;
  o.translation_epsilon_m = 1e-3;
  o.rotation_epsilon_deg = 0.1;
  o.robust_width = 0;
  o.max_distance_m = 1.0;
  return o;
}

/** Equal weights within a radius, for the peer's equal weights of the 10 nearest. */
[[nodiscard]] inline CovarianceOptions covarianceAsPeer(double radius_m) {
  CovarianceOptions o;
  o.kernel = gpu::Weight::gaussian;
  o.gaussian_sigma_m = 1e3;
  o.radius_m = radius_m;
  return o;
}

struct PeerPoints;  ///< with covariances, once they were estimated
struct PeerTree;
struct PeerMap;

/** The stop rule and the gate are the peer's defaults: 1e-3 m and 0.1 deg, 1 m; its loop is
 * Levenberg-Marquardt. */
struct PeerMatch {
  Pose T_target_source;
  bool converged;
  int iterations;  ///< linearisations
};

[[nodiscard]] std::shared_ptr<PeerPoints> peerPoints(const Cloud& cloud);
[[nodiscard]] Cloud cloudOf(const PeerPoints& points);
[[nodiscard]] gpu::Covariances covariancesOf(const PeerPoints& points);

[[nodiscard]] std::shared_ptr<PeerPoints> peerVoxelGrid(const PeerPoints& points, double voxel_m);
/** A KD-tree, and a plane's covariance at every point from its 10 nearest. */
[[nodiscard]] std::shared_ptr<PeerTree> peerCovariances(const std::shared_ptr<PeerPoints>& points);
[[nodiscard]] std::shared_ptr<PeerMap> peerVoxelMap(const PeerPoints& points, double voxel_m);
[[nodiscard]] PeerMatch peerVgicp(const PeerMap& target, const PeerPoints& source, const Pose& guess);
[[nodiscard]] PeerMatch peerGicp(const PeerPoints& target, const PeerTree& tree, const PeerPoints& source,
                                 const Pose& guess);

/** The peer's scan-to-model odometry: thinned, covariances, VGICP against a voxel map that takes every scan where it
 * was matched. The map starts empty and forgets nothing within 100 scans. */
class PeerOdometry {
 public:
  PeerOdometry(double scan_voxel_m, double map_voxel_m);
  ~PeerOdometry();
  /** \return the pose of the scan in the frame of the first, where it is inserted */
  Pose add(const PeerPoints& scan, const Pose& guess);

 private:
  double x_scan_voxel_m;
  std::unique_ptr<PeerMap> x_map;
  bool x_empty = true;
};

}  // namespace raceloc::bench
