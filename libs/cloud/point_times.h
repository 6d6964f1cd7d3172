/** \file
 * Whether the times of a scan's points can be believed: by wrong ones a scan would be bent instead of straightened. */
#pragma once

#include <optional>
#include <string>

#include "core/samples.h"

namespace raceloc {

enum class PointTimes {
  good,
  absent,
  not_seconds,  ///< not finite, not one for each point, or not within 1 s after the scan's stamp
  too_long,     ///< longer than a sweep can be
  all_equal,
  unordered,
  backwards  ///< against the order in which this LiDAR's points have always come
};

struct PointTimesVerdict {
  PointTimes kind;
  std::string text;                    ///< what was seen, for people; empty if good
  std::optional<bool> ascending = {};  ///< of good ones: whether they grow along the cloud, ring by ring
};

/** Checks the times of a scan that has points.
 *
 * Order: a LiDAR sees neighbouring points one soon after the other. So times are in order if they do not jump back by
 * more than a twentieth of the sweep between points that follow each other in the cloud, ring by ring where rings are
 * known (clouds stored by column, by ring or as a solid-state pattern was drawn, whose times restart now and then),
 * or else if points of about the same azimuth have about the same time (clouds that were shuffled or thinned). Times
 * that are wrong by a factor, but within the sweep, or backwards from the first scan on, cannot be told from good ones.
 * \param period_s between this LiDAR's scans; none: not known
 * \param ascending as the times of this LiDAR have always been; none: not known */
[[nodiscard]] PointTimesVerdict checkPointTimes(const Scan& scan, std::optional<double> period_s = {},
                                                std::optional<bool> ascending = {});

}  // namespace raceloc
