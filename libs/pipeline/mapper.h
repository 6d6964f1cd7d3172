/** \file
 * Survey logs in, one georeferenced map out. */
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "core/trajectory.h"
#include "graph/gps_spans.h"
#include "map/map_content.h"
#include "map/tiled_map.h"
#include "pipeline/map_quality.h"
#include "pipeline/survey_stages.h"

namespace raceloc {

/** One log of the survey, in words and figures. */
struct SessionReport {
  std::string session, device_reason;
  double recorded_s;
  OdometryTally odometry;
  std::size_t dropped_late, key_poses;
  double match_residual_m;    ///< median over the trusted scans, distance of pairs across their surface
  double match_inlier_share;  ///< median
  bool kept;                  ///< its odometry was made by a run before
};

/** What went in and how well it fits. */
struct MapReport {
  std::vector<SessionReport> sessions;
  std::size_t key_poses, gps_fixes, attitudes;
  std::vector<GpsSpan> gps_spans;
  double first_s;         ///< stamp of the first key pose: spans are told from there
  double aligned_rmse_m;  ///< of L's key poses against G's after the rigid alignment alone; 0 without GPS
  double aligned_share;   ///< of the key poses that it is of
  double refined_rmse_m;  ///< the same of the joint graph's key poses
  double gps_rmse_m;      ///< of the fixes that were not refused, against the map
  double cost;            ///< of the joint graph, see GraphSolution
  bool converged;
  double lap_m;  ///< length of the racing line; 0: none
  int laps;      ///< that have been begun, of all sessions
  std::vector<LoopEdge> loops;
  std::vector<RefusedLoop> refused_loops;
  double loop_residual_m;  ///< median distance of a kept loop from where the map has it
  WallThickness walls;
  double moving_share;  ///< of the scans' points: left out, because other scans see through them
  std::size_t points, tiles;
};

struct BuiltMap {
  TiledMap tiles;
  MapContent content;
  std::vector<Trajectory>
      odometry;  ///< a session each: before the graphs, first pose at the origin of its own frame
  MapReport report;
};

/** What a map is made of. */
struct MapInput {
  std::vector<SurveyLog> logs;
  std::optional<std::vector<Eigen::Vector3d>> race_line_m;  ///< none: the first full lap, if there is one
};
/** Before any work, reads the logs whole: what is wrong with the files.
 * \param race_line_path  CSV, see readDrivenLine(); may be empty
 * \throws InputError as usableLog() and readDrivenLine() do, for two logs of one name, and for logs whose fixes are
 * too far apart to be of one place. */
[[nodiscard]] MapInput mapInput(const std::vector<std::string>& log_paths, const std::string& race_line_path,
                                const MapperOptions& options, const StageProgress& progress);

/** The whole chain: odometry of each log, GPS/INS graph and LiDAR graph, their alignment, racetrack IDs, loops, joint
 * refinement, refused GPS spans, tiles, road and walls. Logs without any GPS give a map without georeference, in the
 * frame of the first pose; that works for one log only. Memory grows with the map and the key poses, not with the
 * scans: those are kept in the store, as are the finished stages, so that a build with the same inputs goes on where
 * it was killed. The same input gives the same map.
 * \param store  of this build
 * \param tool_version  kept in the map; what another version left in the store is not used
 * \throws InputError as surveyOf() does, for a log without GPS among several, one of another place, a race line of
 * another place, or a store with a log that is not among these.
 * Source: reading.md section 3. */
[[nodiscard]] BuiltMap buildMap(const MapInput& input, StageStore& store, const MapperOptions& options,
                                const std::string& tool_version, const StageProgress& progress);

}  // namespace raceloc
