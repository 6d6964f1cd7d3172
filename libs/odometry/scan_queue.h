/** \file
 * A scan is stamped at the start of its sweep; the motion that de-skews it is known only when the sweep is
 * over. */
#pragma once

#include <deque>
#include <optional>

#include "core/samples.h"
#include "odometry/motion_history.h"

namespace raceloc {

/** Holds scans until the motion of their sweep is known, or until it is late. Bounded: it never holds more
 * than a few sweeps, because a scan leaves at the latest 0.3 s after its end. */
class ScanQueue {
 public:
  /** \throws InputError as endOfSweep() does. */
  void push(Scan scan);

  /** The next scan whose motion is known, or whose sweep ended more than 0.3 s before `now_s` (the newest
   * stamp of the stream); none if the front has to wait. Call until it gives none. */
  std::optional<Scan> pop(const MotionHistory& history, double now_s);

  /** At the end of the stream: the next scan, whatever is known. */
  std::optional<Scan> popAny();

  [[nodiscard]] bool empty() const { return x_scans.empty(); }

 private:
  struct Waiting {
    double end_s;
    Scan scan;
  };
  std::deque<Waiting> x_scans;  ///< by end of sweep
};

}  // namespace raceloc
