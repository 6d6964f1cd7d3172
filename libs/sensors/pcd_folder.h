/** \file
 * Folders of PCD files, one scan a file. */
#pragma once

#include <string>

#include "sensors/foreign_logs.h"

namespace raceloc {

/** Scans in order of their file names. A name that is a time gives the stamp: 19 digits [ns], 16 digits [us],
 * or 10 digits with or without a fraction [s], since the epoch. Otherwise the scans are `rate_hz` apart from
 * 0 s on. */
struct PcdFolder {
  std::string folder;
  std::string poses_path;  ///< TUM file with the truth; may be empty
  Decimation decimation;   ///< by position in the folder
  double rate_hz = 10;
  std::string label = "lidar_top";
  Pose T_body_lidar = Pose::Identity();
  double intensity_max = 255;  ///< the value that becomes 1; larger ones are cut
};

/** \throws InputError naming the file for anything missing, malformed or truncated, for stamps that do not
 * increase, and for a mixture of names that are times and names that are not. */
[[nodiscard]] ImportSummary importLog(const PcdFolder& source, const std::string& log_path,
                                      const ShareDone& done);

/** Reads a PCD file (v0.7; ascii or binary) into a Scan without label, stamp and pose. Fields: x y z;
 * `intensity` or `i`; `ring`; time of the point in `time`, `t` or `timestamp`, seconds when it is a float and
 * nanoseconds when it is an integer, made relative to the earliest. Other fields are skipped, and so are
 * points that are not finite. \throws InputError if it cannot be read, has no x, y, z, is truncated, or is
 * compressed. */
[[nodiscard]] Scan readPcd(const std::string& path, double intensity_max);

}  // namespace raceloc
