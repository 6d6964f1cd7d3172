/** \file
 * What raceloc-map and raceloc-live say of their odometry. */
#pragma once

#include "odometry/odometry_stream.h"

namespace raceloc {

/** One line for each thing that was wrong with a source or its scans, and how often; the run went on without it. */
void printFaults(const FaultCounts& faults);

/** What odometry came to, with or without a map around it. */
void printOdometry(const OdometryTally& tally, double recorded_s, std::size_t dropped_late);

}  // namespace raceloc
