#include "cli/odometry_text.h"

#include <cstdio>

namespace raceloc {

void printFaults(const FaultCounts& faults) {
  for (const auto& [fault, times] : faults)
    std::printf("DEGRADED         %s (%zu times)\n", fault.c_str(), times);
}

void printOdometry(const OdometryTally& tally, double recorded_s, std::size_t dropped_late) {
  std::printf("recording        %.1f s, %.0f m, %zu scans (%zu trusted, %zu de-skewed by wheel speed)\n",
              recorded_s, tally.length_m, tally.scans, tally.trusted, tally.by_wheels);
  printFaults(tally.faults);
  if (tally.restarts > 0)
    std::printf(
        "LOST             the LiDAR odometry was lost %zu times for good and began anew by dead reckoning\n",
        tally.restarts);
  if (dropped_late > 0)
    std::printf("dropped          %zu samples, late beyond the window or not finite\n", dropped_late);
}

}  // namespace raceloc
