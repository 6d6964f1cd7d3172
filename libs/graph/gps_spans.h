/** \file
 * Stretches of a drive on which a receiver is not to be believed. */
#pragma once

#include <string>
#include <vector>

#include "graph/keyframe.h"
#include "graph/map_graphs.h"

namespace raceloc {

/** Key poses first .. last, in a row, on which one receiver's fixes are off or said to be poor. */
struct GpsSpan {
  std::string receiver;
  std::size_t first, last;
  double begin_s, end_s;  ///< their stamps
  std::size_t fixes;      ///< of the receiver in it
  double off_m;           ///< rmse against the graph
  double claimed_m;       ///< median of the claimed sigma, the worst axis
  bool refused;           ///< false: poor, as it says itself; it counts for what it claims
};
/** "gps_left, 12.3 .. 32.1 s: off by 20.0 m (198 fixes), claims 0.02 m": a line for people. */
[[nodiscard]] std::string text(const GpsSpan& span, double zero_s);

/** Judges each fix by a solution that its lies have not bent: graphs take fixes with a robust loss, and there are
 * other receivers, wheels, gyro and scans. A fix is off if its distance to the antenna there is beyond
 * gps_refuse_sigma of its floored covariance (of the worst axis); it is poor if it claims more than
 * gps_poor_sigma_m. Spans end where a receiver was good for gps_span_gap_s,
 * and with the drive; single bad fixes are spans too.
 * \param T_map_body  one a key pose \return by receiver, then by time */
[[nodiscard]] std::vector<GpsSpan> gpsSpans(const std::vector<Keyframe>& keyframes,
                                            const std::vector<Pose>& T_map_body, const GraphOptions& options);

/** Refuses, receiver by receiver, the fixes that are not in the longest chain which odometry joins: two fixes of a
 * chain are as far apart, and in such a direction, as the odometry between them says, within 4 of their sigmas,
 * gps_chain_share of the way and 0.05 m. So a receiver that jumps aside and back is refused for as long as it was away,
 * also where it outnumbers everything else there; and one that strews its fixes is refused altogether. A chain may
 * leave out what was driven in gps_chain_reach_s. Fixes that were refused before have a new chance. A receiver that
 * creeps away, below these limits from one fix to the next, takes its chain along: that is not found here.
 * \param T_map_body  for its attitudes only: those of a solution that is right about them */
void refuseUnchained(std::vector<Keyframe>& keyframes, const std::vector<Pose>& T_map_body,
                     const GraphOptions& options);

/** Marks the fixes in the refused spans, and no others, as refused. */
void refuse(std::vector<Keyframe>& keyframes, const std::vector<GpsSpan>& spans);

}  // namespace raceloc
