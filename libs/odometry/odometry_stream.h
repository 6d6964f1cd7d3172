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

/** One sample at a time to odometry steps, each when the motion of its sweep is known. */
class OdometryStream {
 public:
  OdometryStream(MotionHistory history, LivOdometry odometry)
      : x_history(std::move(history)), x_odometry(std::move(odometry)) {}

  /** In order of time; fixes and INS poses are not for this. \throws InputError as ScanQueue::push() does. */
  [[nodiscard]] std::vector<OdometryStep> add(Sample sample);
  [[nodiscard]] std::vector<OdometryStep> finish();  ///< what still waits, at the end of the stream

  [[nodiscard]] const MotionHistory& history() const { return x_history; }
  [[nodiscard]] std::size_t passedOver() const {
    return x_passed_over;
  }  ///< scans not later than the one before
  /** Sources that were dropped, by name and why, with the number of scans that did without them. */
  [[nodiscard]] const std::map<std::string, std::size_t>& faults() const { return x_faults; }

 private:
  void process(const Scan& scan, std::vector<OdometryStep>& steps);

  MotionHistory x_history;
  LivOdometry x_odometry;
  ScanQueue x_queue;
  std::optional<double> x_last_s;
  std::size_t x_passed_over = 0;
  std::map<std::string, std::size_t> x_faults;
};

}  // namespace raceloc
