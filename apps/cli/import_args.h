/** \file
 * The command line of raceloc-import. */
#pragma once

#include <optional>
#include <string>
#include <variant>

#include "sensors/csv_log.h"
#include "sensors/kitti.h"
#include "sensors/pcd_folder.h"
#include "sensors/velodyne_pcap.h"

namespace raceloc {

struct ImportArgs {
  std::variant<KittiRawDrive, KittiOdometrySequence, PcdFolder, CsvLog, VelodynePcap> source;
  std::string log_path;
  std::string truth_path;  ///< empty: not wanted
};

/** Empty after `--help` or `--version`. \throws InputError for arguments that do not fit. */
[[nodiscard]] std::optional<ImportArgs> parseImportArgs(int argc, char** argv);

/** Imports whatever the source is; the rawlog and the truth appear whole or not at all.
 * \throws InputError as importLog() does, and for a truth that is wanted of a source without one. */
[[nodiscard]] ImportSummary runImport(const ImportArgs& args);

}  // namespace raceloc
