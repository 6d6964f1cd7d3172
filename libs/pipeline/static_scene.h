/** \file
 * From scans and their poses to the map's points: without what moved, averaged, in tiles. */
#pragma once

#include <raceloc/gpu/context.h>

#include <vector>

#include "map/tiled_map.h"
#include "pipeline/map_quality.h"
#include "pipeline/survey_stages.h"

namespace raceloc {

/** All that stays of the scans, in the map frame. */
struct StaticScene {
  Cloud points;
  WallThickness walls;
  double moving_share;  ///< of the scans' points: left out, because other scans see through them
};

/** What stands still of all scans, averaged. Scans are read three times rather than kept: which voxels hold points, which of
 * those others see through, the rest.
 * \param T_map_body  of each key pose */
[[nodiscard]] StaticScene staticScene(const SurveyedDrives& drives, const ScanStore& scans,
                                      const std::vector<Pose>& T_map_body, const MapperOptions& options,
                                      const StageProgress& progress);

/** Points with their covariances, tile by tile: a tile needs what is within the covariances' radius around it.
 * \param points  map frame \return tiles whose points are relative to the tile's corner in x and y, z as in the map */
[[nodiscard]] TiledMap tilesOf(gpu::Context& context, const Cloud& points,
                               const CovarianceOptions& covariance, double tile_size_m);

}  // namespace raceloc
