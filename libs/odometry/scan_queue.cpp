#include "odometry/scan_queue.h"

#include <algorithm>
#include <utility>

#include "cloud/deskew.h"

namespace raceloc {

void ScanQueue::push(Scan scan) {
  const double end_s = endOfSweep(scan);
  const auto place = std::upper_bound(x_scans.begin(), x_scans.end(), end_s,
                                      [](double t, const Waiting& w) { return t < w.end_s; });
  x_scans.insert(place, {end_s, std::move(scan)});
}

std::optional<Scan> ScanQueue::pop(const MotionHistory& history, double now_s) {
  if (x_scans.empty()) return std::nullopt;
  constexpr double kPatience_s = 0.3;
  const double end_s = x_scans.front().end_s;
  const auto known_s = history.knownUntil_s();
  if ((known_s && *known_s >= end_s) || now_s > end_s + kPatience_s) return popAny();
  return std::nullopt;
}

std::optional<Scan> ScanQueue::popAny() {
  if (x_scans.empty()) return std::nullopt;
  Scan scan = std::move(x_scans.front().scan);
  x_scans.pop_front();
  return scan;
}

}  // namespace raceloc
