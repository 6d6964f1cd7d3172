/** \file
 * A finished map: what is in it, other formats of it, and whether it is whole. */
#pragma once

#include <functional>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "map/map_content.h"

namespace raceloc {

struct MapInfoArgs {
  std::string map_path;
};
struct MapExportArgs {
  std::string map_path, prefix;
  std::set<std::string> formats;  ///< names of the options: "ply", "geojson", ...
  bool replace;
};
struct MapCheckArgs {
  std::string map_path;
};

/** \name The words of a sub-command: the program's name, then its arguments. None after `--help` or `--version`.
 * \throws InputError for arguments that do not fit. @{ */
[[nodiscard]] std::optional<MapInfoArgs> parseMapInfo(std::vector<std::string> words);
[[nodiscard]] std::optional<MapExportArgs> parseMapExport(std::vector<std::string> words);
[[nodiscard]] std::optional<MapCheckArgs> parseMapCheck(std::vector<std::string> words);
/** @} */

/** \name What they do. \throws InputError for a map that is missing or damaged, and outputs that cannot be written.
 * @{ */
void mapInfo(const MapInfoArgs& args);
void mapExport(const MapExportArgs& args);
void mapCheck(const MapCheckArgs& args);
/** @} */

/** Writes the key poses of which `poseOf` has a pose, in order of time (TUM), and prints the file's name.
 * \throws InputError if it cannot be written */
void writePoses(const std::string& path, const MapContent& content,
                const std::function<std::optional<Pose>(const KeyPose&)>& poseOf);

}  // namespace raceloc
