/** \file
 * Pictures of a map and its quality as SVG, drawn by gnuplot as those of libs/eval. All throw InputError if gnuplot is
 * not installed. */
#pragma once

#include <string>

#include "pipeline/map_qa.h"

namespace raceloc {

/** Seen from above: the points, the drives, the racing line, the walls, and where fixes were refused. */
[[nodiscard]] std::string mapPicture(const BuiltMap& built);

/** \name Over the station: distance of the fixes of each receiver from the map; distance of the loops from it, those
 * refused and why; sigma of matches; passes, road and walls. @{ */
[[nodiscard]] std::string fixPicture(const QaResult& qa);
[[nodiscard]] std::string loopPicture(const QaResult& qa, const MapReport& report,
                                      double degenerate_loop_sigma_m);
[[nodiscard]] std::string sigmaPicture(const QaResult& qa, double degenerate_sigma_m);
[[nodiscard]] std::string coveragePicture(const QaResult& qa);
/** @} */

}  // namespace raceloc
