/** \file
 * From key poses to where they are in the map: graphs, racetrack IDs, loops, receivers that lie. */
#pragma once

#include <raceloc/gpu/context.h>

#include <optional>
#include <vector>

#include "graph/gps_spans.h"
#include "graph/graph_alignment.h"
#include "graph/loop_search.h"
#include "pipeline/survey_stages.h"
#include "track/racetrack_dict.h"

namespace raceloc {

/** Racetrack IDs of the key poses, where there is a loop. */
struct TrackLoop {
  TrackIds ids;
  RacetrackDict dict;
  double length_m;
};

/** What the graphs came to. */
struct MapSolution {
  GraphSolution gps, lidar, joint;
  GraphAlignment aligned;  ///< of the LiDAR graph with the GPS graph
  std::optional<TrackLoop> loop;
  LoopClosures loops;
  std::vector<GpsSpan> spans;
};

/** Both graphs, their alignment, loops and the joint refinement. Fixes that are refused are marked in `drives`.
 * \param race_line_m  none: the first full lap, if there is one
 * \throws InputError for logs of several places, and a line that no survey is near. */
[[nodiscard]] MapSolution solveGraphs(gpu::Context& context, SurveyedDrives& drives,
                                      const std::vector<SurveyLog>& logs,
                                      const std::optional<std::vector<Eigen::Vector3d>>& race_line_m,
                                      const ScanStore& scans, const MapperOptions& options,
                                      const StageProgress& progress);

}  // namespace raceloc
