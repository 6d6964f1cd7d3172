#include "odometry/odometry_stream.h"

#include <utility>

namespace raceloc {

void OdometryStream::hear(Sample sample) {
  x_now_s = stampOf(sample);
  if (auto* scan = std::get_if<Scan>(&sample)) x_queue.push(std::move(*scan));
  if (const auto* imu = std::get_if<ImuSample>(&sample)) x_history.add(*imu);
  if (const auto* motion = std::get_if<MotionSample>(&sample)) x_history.add(*motion);
}

OdometryStep& OdometryStream::step(const Sweep& sweep) {
  OdometryStep& step = x_odometry.add(sweep, x_history);
  ++x_tally.scans;
  x_tally.trusted += step.trusted ? 1 : 0;
  x_tally.by_wheels += step.by_wheels ? 1 : 0;
  x_tally.restarts += step.restarted ? 1 : 0;
  x_tally.length_m += step.since_last.T_start_end.translation().norm();
  for (const std::string& fault : x_history.faults()) ++x_tally.faults[fault];
  tellFaults(sweep.end_s);
  return step;
}

void OdometryStream::tellFaults(double now_s) {
  for (const auto& [fault, times] : x_queue.takeFaults(now_s)) x_tally.faults[fault] += times;
}

}  // namespace raceloc
