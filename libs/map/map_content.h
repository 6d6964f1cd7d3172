/** \file
 * What a map holds besides its points: plain values in the map frame. Stations are metres of the racing line from its
 * way-point 0, in the direction of driving. */
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "core/types.h"

namespace raceloc {

struct MapInfo {
  std::optional<GeodeticPoint> origin;  ///< of the map frame (ENU); none: the survey had no GPS
  double tile_size_m;                   ///< edge of a tile
  double point_spacing_m;               ///< edge of the voxels the points were averaged over
  std::string tool_version;             ///< the program that made the map; not part of the content hash
  std::string config;                   ///< ini text it was made with
  std::vector<std::string> sessions;    ///< the recordings, in order
  double waypoint_spacing_m = 0;        ///< along the racing line; 0: the map has no racing line
};

/** Where the survey car was when it took a scan that went into the map. Both pose graphs have the same key poses under
 * the same numbers, so the paper's racetrack_dict[(k, k)] is the racetrack_id of key pose k. */
struct KeyPose {
  double stamp_s;       ///< [s since the epoch, UTC]
  Pose T_map_body;      ///< of both graphs together
  std::string session;  ///< one of MapInfo::sessions
  std::optional<std::int32_t> racetrack_id =
      std::nullopt;                                     ///< number of a way-point; none: off the racing line
  std::optional<Pose> T_map_body_gps = std::nullopt;    ///< of the GPS/INS graph alone
  std::optional<Pose> T_map_body_lidar = std::nullopt;  ///< of the LiDAR graph alone, aligned with the other
};

/** One of the way-points 0..N-1 round the racing line; the last is followed by the first. */
struct MapWaypoint {
  Eigen::Vector3d p_map_m;
  double heading_rad;  ///< of the line, 0 = east, counter-clockwise
};

enum class EdgeKind { odometry, loop };

/** Two key poses tied to each other. */
struct MapEdge {
  std::int32_t i, j;     ///< numbers of key poses
  Pose T_i_j;            ///< as measured
  Matrix6d information;  ///< of its right increment: rotation [1/rad^2], then translation [1/m^2]
  EdgeKind kind;
};

/** A receiver's position of its antenna at a key pose. */
struct MapFix {
  std::int32_t key;                  ///< number of a key pose
  std::string receiver;              ///< its label
  Eigen::Vector3d p_map_antenna_m;   ///< as measured
  Eigen::Matrix3d cov_map_m2;        ///< as the graph took it
  Eigen::Vector3d p_body_antenna_m;  ///< lever arm
  double weight;                     ///< 0 (refused) .. 1 (believed) by the robust loss
};

/** The road across the racing line. */
struct RoadStation {
  double station_m;
  double height_m;   ///< of the ground under the line
  double grade_rad;  ///< positive: the road climbs
  double bank_rad;   ///< positive: the right edge is the higher one, as in a left turn of an oval
};

enum class WallSide { left, right };

/** The wall beside the racing line. */
struct WallPoint {
  double station_m;
  WallSide side;
  Eigen::Vector3d p_map_foot_m;  ///< where the wall's face stands on the ground
  double height_m;               ///< of the wall above its foot
};

/** Stations without ground or wall are left out of `road` and `walls`. */
struct MapContent {
  MapInfo info;
  std::vector<KeyPose> key_poses;
  std::vector<MapWaypoint> waypoints = {};
  std::vector<MapEdge> edges = {};
  std::vector<MapFix> fixes = {};
  std::vector<RoadStation> road = {};  ///< ascending stations
  std::vector<WallPoint> walls = {};   ///< all of the left, then all of the right; ascending stations
};

}  // namespace raceloc
