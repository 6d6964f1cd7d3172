/** \file
 * Samples in, odometry out: what mapping and localization without a map have in common. */
#pragma once

#include <map>
#include <string>
#include <vector>

#include "core/samples.h"
#include "odometry/liv_odometry.h"
#include "odometry/scan_queue.h"

namespace raceloc {

/** What the scans of a run came to. */
struct OdometryTally {
  std::size_t scans = 0, trusted = 0, restarts = 0;
  std::size_t by_wheels = 0;    ///< guess and de-skew by the wheels
  std::size_t passed_over = 0;  ///< scans not later than the one before
  double length_m = 0;
  std::map<std::string, std::size_t> faults;  ///< sources that were dropped, and scans that did without them
};

/** One sample at a time to odometry steps, each when the motion of its sweep is known. */
class OdometryStream {
 public:
  OdometryStream(MotionHistory history, LivOdometry odometry)
      : x_history(std::move(history)), x_odometry(std::move(odometry)) {}

  /** In order of time; fixes and INS poses are not for this. \throws InputError as ScanQueue::push() does. */
  [[nodiscard]] std::vector<OdometryStep> add(Sample sample);
  [[nodiscard]] std::vector<OdometryStep> finish();  ///< what still waits, at the end of the stream

  [[nodiscard]] const MotionHistory& history() const { return x_history; }
  [[nodiscard]] const OdometryTally& tally() const { return x_tally; }

 private:
  void process(const Scan& scan, std::vector<OdometryStep>& steps);

  MotionHistory x_history;
  LivOdometry x_odometry;
  ScanQueue x_queue;
  std::optional<double> x_last_s;
  OdometryTally x_tally;
};

}  // namespace raceloc
