/** \file
 * What is wrong with a log itself. */
#pragma once

#include "odometry/scan_queue.h"
#include "sensors/rawlog.h"

namespace raceloc {

/** Stamps ahead of all others'. \param reader at the end of the log */
[[nodiscard]] inline FaultCounts stampFaults(const LogReader& reader) {
  FaultCounts faults;
  for (const auto& [label, times] : reader.leftOut())
    faults[label + ": stamp far ahead of all others', sample left out"] += times;
  return faults;
}

/** Labels that are counted on and not in the log, and stamps ahead of all others'. \param reader at the end of the log
 */
[[nodiscard]] inline FaultCounts logFaults(const LogSummary& summary, const LogOptions& options,
                                           const LogReader& reader) {
  FaultCounts faults = stampFaults(reader);
  for (const auto& missing : missingDevices(summary, options)) ++faults[missing];
  return faults;
}

}  // namespace raceloc
