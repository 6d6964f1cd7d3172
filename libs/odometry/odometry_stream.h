/** \file
 * Samples in, odometry out: what mapping and localization without a map have in common. */
#pragma once

#include <utility>

#include "core/samples.h"
#include "odometry/liv_odometry.h"
#include "odometry/scan_queue.h"

namespace raceloc {

/** What the scans of a run came to, those of several LiDARs counted as one where they are matched as one. */
struct OdometryTally {
  std::size_t scans = 0, trusted = 0, restarts = 0;
  std::size_t by_wheels = 0;  ///< guess and de-skew by the wheels
  double length_m = 0;
  FaultCounts
      faults;  ///< sources that were dropped and the scans that did without them; scans that were passed over
};

/** One sample at a time to odometry steps, each when the motion of its sweep is known. */
class OdometryStream {
 public:
  OdometryStream(MotionHistory history, LivOdometry odometry, ScanQueue queue = ScanQueue())
      : x_history(std::move(history)), x_odometry(std::move(odometry)), x_queue(std::move(queue)) {}

  /** Calls `take(OdometryStep&)` for each step whose motion is known with this sample. Samples come in order of time;
   * fixes and INS poses are not for this. A step is as LivOdometry::add() gives it, until `take` returns. */
  template <class Take>
  void add(Sample sample, const Take& take) {
    hear(std::move(sample));
    while (const Sweep* sweep = x_queue.pop(x_history, x_now_s)) take(step(*sweep));
  }
  /** The same for what still waits, at the end of the stream. */
  template <class Take>
  void finish(const Take& take) {
    while (const Sweep* sweep = x_queue.popAny()) take(step(*sweep));
    constexpr double kTail_s = 1;  // logs go on a little after their last scan
    tellFaults(x_now_s - kTail_s);
  }

  [[nodiscard]] const MotionHistory& history() const { return x_history; }
  [[nodiscard]] const OdometryTally& tally() const { return x_tally; }

 private:
  void hear(Sample sample);
  OdometryStep& step(const Sweep& sweep);
  void tellFaults(double now_s);

  MotionHistory x_history;
  LivOdometry x_odometry;
  ScanQueue x_queue;
  double x_now_s = 0;
  OdometryTally x_tally;
};

}  // namespace raceloc
