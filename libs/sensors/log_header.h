/** \file
 * The header of a rawlog: a CObservationComment with the origin of the map frame as ini text. */
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "core/types.h"

namespace mrpt::obs {
class CObservationComment;
}

namespace raceloc {

struct LogHeader {
  std::optional<GeodeticPoint> origin;  ///< of the map frame; without one, no GPS fix and no INS pose
  std::string text;                     ///< goes after it: ini text or comments
};

/** Every digit of the origin is kept; without one, it is the text alone. */
[[nodiscard]] mrpt::obs::CObservationComment toObservation(const LogHeader& header);

/** Inverse of toObservation(). A comment that is none of ours is all text. */
[[nodiscard]] LogHeader headerIn(const mrpt::obs::CObservationComment& comment);

/** The header, and in it which GPS receivers there are: one of them may never speak. Labels have no blanks. */
[[nodiscard]] LogHeader withGpsLabels(LogHeader header, const std::vector<std::string>& labels);
[[nodiscard]] std::vector<std::string> gpsLabelsIn(const LogHeader& header);  ///< empty: it does not say

}  // namespace raceloc
