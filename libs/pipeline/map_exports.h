/** \file
 * The map for MRPT's own viewers. */
#pragma once

#include <string>
#include <vector>

#include "core/types.h"
#include "map/map_file.h"
#include "map/tiled_map.h"

namespace raceloc {

/** A key scan, ready to be shown. */
struct ExportScan {
  double stamp_s;  ///< [s since the epoch, UTC]
  Pose T_map_body;
  Cloud cloud_body;  ///< de-skewed, thinned
};

/** A CSimpleMap: for each scan that has points its pose as a CPose3DPDFGaussian and a CSensoryFrame with one
 * CObservationVelodyneScan labelled `map`, which holds the points (rounded to 1/512 m) and no packets, and
 * whose sensor pose is the body's origin. The covariances are zero: the map does not keep them. robot-map-gui
 * opens it and draws it with a configuration that asks for a CSimplePointsMap; no scans give an empty map.
 * \throws InputError if the file cannot be written whole; what was there stays. */
void writeSimplemap(const std::string& path, const std::vector<ExportScan>& scans);

/** A map's points as scans, for a map whose own scans are gone: every point with the nearest of the key poses that
 * are 10 m or more from each other (in the order of `key_poses`, horizontally). No key poses give no scans. */
[[nodiscard]] std::vector<ExportScan> scansOf(const TiledMap& map, const std::vector<KeyPose>& key_poses);

/** A scene in the map frame for SceneViewer3D: the map's points (every n-th, at most 3 million) coloured by
 * height, a line along the key poses of each session, a small frame at up to 200 of them, and a grid at the
 * ground. SceneViewer3D looks at the map's origin from 20 m when it starts; zoom out from there.
 * \throws InputError if the file cannot be written whole; what was there stays. */
void writeScene(const std::string& path, const TiledMap& map, const std::vector<KeyPose>& key_poses);

}  // namespace raceloc
