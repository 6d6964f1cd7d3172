#include "odometry/odometry_stream.h"

#include <utility>

namespace raceloc {

std::vector<OdometryStep> OdometryStream::add(Sample sample) {
  const double now_s = stampOf(sample);
  if (auto* scan = std::get_if<Scan>(&sample)) x_queue.push(std::move(*scan));
  if (const auto* imu = std::get_if<ImuSample>(&sample)) x_history.add(*imu);
  if (const auto* motion = std::get_if<MotionSample>(&sample)) x_history.add(*motion);
  std::vector<OdometryStep> steps;
  while (const auto scan = x_queue.pop(x_history, now_s)) process(*scan, steps);
  return steps;
}

std::vector<OdometryStep> OdometryStream::finish() {
  std::vector<OdometryStep> steps;
  while (const auto scan = x_queue.popAny()) process(*scan, steps);
  return steps;
}

void OdometryStream::process(const Scan& scan, std::vector<OdometryStep>& steps) {
  const double end_s = endOfSweep(scan);
  if (x_last_s && end_s <= *x_last_s) {
    ++x_tally.passed_over;
    return;
  }
  x_last_s = end_s;
  const OdometryStep& step = steps.emplace_back(x_odometry.add(scan, x_history));
  ++x_tally.scans;
  x_tally.trusted += step.trusted ? 1 : 0;
  x_tally.by_wheels += step.by_wheels ? 1 : 0;
  x_tally.restarts += step.restarted ? 1 : 0;
  x_tally.length_m += step.since_last.T_start_end.translation().norm();
  for (const std::string& fault : x_history.faults()) ++x_tally.faults[fault];
}

}  // namespace raceloc
