/** \file
 * Where on the track, and how fast, the errors are made. */
#pragma once

#include <string>
#include <vector>

#include "eval/pose_errors.h"

namespace raceloc {

/** The poses of one stretch, speed or lap. rmse without sign; of a bin without poses they are no numbers to believe. */
struct ErrorBin {
  std::string name;  ///< "120 .. 240 m"
  std::size_t poses;
  double plane_rmse_m, lateral_rmse_m, longitudinal_rmse_m, height_rmse_m, heading_rmse_deg, plane_max_m;
};

/** Stations [m] at which the truth passes its first pose again, 0 before them: to within 15 m and 45 deg, after it was
 * 50 m away; there the nearest pose. Just {0} for a drive without a full lap.
 * \param poses  at least one */
[[nodiscard]] std::vector<double> lapStarts(const std::vector<PoseError>& poses);

/** Mean length of the full laps [m]; without any, the length of the path.
 * \param starts_m  of lapStarts() */
[[nodiscard]] double lapLength_m(const std::vector<PoseError>& poses, const std::vector<double>& starts_m);

/** Where in its lap each pose is [m], 0 .. lapLength_m(): the way since the lap began, that of a full lap scaled to the mean
 * length, so that laps driven on different lines fit on each other. */
[[nodiscard]] std::vector<double> lapStations_m(const std::vector<PoseError>& poses,
                                                const std::vector<double>& starts_m);

/** Equal parts of the lap, over all laps. \param count  >= 1 */
[[nodiscard]] std::vector<ErrorBin> errorsBySector(const std::vector<PoseError>& poses,
                                                   const std::vector<double>& starts_m, int count);
/** Laps as they were driven, the unfinished last one too; empty without a full lap. */
[[nodiscard]] std::vector<ErrorBin> errorsByLap(const std::vector<PoseError>& poses,
                                                const std::vector<double>& starts_m);
/** By the truth's speed, from the slowest to the fastest; speeds that were not driven are left out.
 * \param width_mps  of a bin, > 0 */
[[nodiscard]] std::vector<ErrorBin> errorsBySpeed(const std::vector<PoseError>& poses, double width_mps);

}  // namespace raceloc
