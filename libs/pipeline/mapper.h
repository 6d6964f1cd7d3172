/** \file
 * A survey log in, a georeferenced map out. */
#pragma once

#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "core/trajectory.h"
#include "graph/lidar_graph.h"
#include "map/map_file.h"
#include "pipeline/map_exports.h"
#include "pipeline/map_quality.h"
#include "pipeline/matching_options.h"

namespace raceloc {

/** Section [map]. */
struct MapOptions {
  double point_spacing_m = 0.2;
  double covariance_radius_m = 0.6;
  double tile_size_m = 32;
  double keyframe_distance_m = 1.0;
  double keyframe_angle_deg = 5.0;
  double gps_max_gap_s = 0.5;
  bool write_simplemap = true;
  bool write_scene = true;
  void describe(OptionList& keys);
};

struct MapperOptions {
  MatchingOptions matching;
  GraphOptions graph;
  MapOptions map;
  /** \throws InputError as IniFile does. */
  static MapperOptions fromIni(const std::string& path);
  [[nodiscard]] std::string iniText() const;  ///< every section with its values: what the map file keeps
};

/** What went in and how well it fits. */
struct MapReport {
  std::string device_reason;
  OdometryTally odometry;
  std::size_t key_poses, gps_factors, attitude_factors;
  double recorded_s;
  double match_residual_m;    ///< median over the trusted scans, distance of pairs across their surface
  double match_inlier_share;  ///< median
  double gps_rmse_m, graph_initial_cost, graph_final_cost;
  bool graph_converged;
  WallThickness walls;
  std::size_t points, tiles, dropped_late;
};

struct BuiltMap {
  TiledMap tiles;
  MapInfo info;
  std::vector<KeyPose> key_poses;
  std::vector<ExportScan> scans;
  Trajectory odometry;  ///< LiDAR odometry before the graph, first pose at the origin of its own frame
  MapReport report;
};

/** Runs the whole chain on one log: read, de-skew, odometry, pose graph with GPS, tiles. Key scans are kept
 * in memory, thinned to the map's spacing. A log without GPS gives a map without georeference, in the frame
 * of its first pose. \param progress  called with 0..1 \throws InputError for a log that cannot be read, has
 * no LiDAR of the configured labels, fewer than two scans, or a pattern that matches no device. */
[[nodiscard]] BuiltMap buildMap(const std::string& log_path, const MapperOptions& options,
                                const std::string& tool_version, const std::function<void(double)>& progress);

}  // namespace raceloc
