#include "odometry/scan_queue.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <utility>

#include "cloud/scan_check.h"
#include "core/statistics.h"

namespace raceloc {

namespace {

constexpr double kPatience_s = 0.3;     // for the motion of a sweep
constexpr double kUsualPeriod_s = 0.1;  // of a LiDAR that has delivered once
constexpr std::size_t kGaps = 5;        // that its period is the median of
constexpr double kAwaitedPeriods = 0.25;
constexpr double kSilentPeriods = 1.5;
constexpr double kNeverHeard_s = 1;  // or once
constexpr double kOldest_s = 0.3;    // a late scan that ended so long ago goes with no sweep

}  // namespace

double ScanQueue::Lidar::period_s() const {
  if (gaps_s.empty()) return kUsualPeriod_s;
  std::array<double, kGaps> sorted_s;
  double* const last = std::copy(gaps_s.begin(), gaps_s.end(), sorted_s.data());
  return quantile(sorted_s.data(), last, 0.5);
}

double ScanQueue::Lidar::silentAfter_s() const {
  return gaps_s.empty() ? kNeverHeard_s : kSilentPeriods * period_s();
}

void ScanQueue::push(Scan scan) {
  const double stamp_s = scan.stamp_s;
  if (!std::isfinite(stamp_s)) return note(scan.label, "stamp is no number, scan passed over");
  if (!x_first_s) x_first_s = stamp_s;
  const auto [found, is_new] = x_lidars.try_emplace(scan.label);
  Lidar& lidar = found->second;
  if (!is_new && stamp_s == lidar.stamp_s) return note(scan.label, "stamp repeated, scan passed over");
  checkContent(scan, lidar);
  checkTimes(scan, lidar);
  const double end_s = endOfSweep(scan);
  if (lidar.used_s && end_s <= *lidar.used_s) return note(scan.label, "stamp went back, scan passed over");
  const bool in_time = !x_last_end_s || end_s > *x_last_end_s;
  if (is_new || stamp_s > lidar.stamp_s) {
    if (!is_new) {
      const double gap_s = stamp_s - lidar.stamp_s;
      if (!lidar.silence_told && gap_s > lidar.silentAfter_s()) note(scan.label, "silent");
      if (lidar.gaps_s.size() == kGaps) lidar.gaps_s.erase(lidar.gaps_s.begin());
      lidar.gaps_s.push_back(gap_s);
    }
    lidar.stamp_s = stamp_s;
    lidar.end_s = end_s;
    lidar.silence_told = false;
    lidar.in_time = in_time;
  }
  if (!in_time) {
    note(scan.label, "late");
    x_late.insert_or_assign(scan.label, std::move(scan));
    return;
  }
  const auto place = std::upper_bound(x_waiting.begin(), x_waiting.end(), end_s,
                                      [](double t, const Waiting& w) { return t < w.end_s; });
  x_waiting.insert(place, {end_s, std::move(scan)});
}

void ScanQueue::checkContent(const Scan& scan, Lidar& lidar) {
  if (scan.cloud.empty()) return note(scan.label, "empty scan");
  if (isOneRing(scan)) return note(scan.label, "all points in one ring, height, roll and pitch are not seen");
  constexpr int kForLong = 5;  // scans; a lorry beside the car hides the ground for one or two
  if (const auto ground = showsGround(scan)) lidar.groundless = *ground ? 0 : lidar.groundless + 1;
  if (lidar.groundless >= kForLong) note(scan.label, "no ground below the car, check its extrinsics");
}

void ScanQueue::checkTimes(Scan& scan, Lidar& lidar) {
  constexpr std::size_t kPeriodKnown = 3;  // gaps
  constexpr int kOrderKnown = 10;          // scans
  std::optional<double> period_s;
  if (lidar.gaps_s.size() >= kPeriodKnown) period_s = lidar.period_s();
  std::optional<bool> ascending;
  if (lidar.same_order >= kOrderKnown) ascending = lidar.ascending;
  if (scan.cloud.empty()) scan.time_s.clear();
  const PointTimesVerdict times = checkPointTimes(scan, period_s, ascending);
  if (times.kind == PointTimes::good) {
    lidar.sweep_s = endOfSweep(scan) - scan.stamp_s;
    if (!times.ascending) return;
    lidar.same_order = *times.ascending == lidar.ascending ? lidar.same_order + 1 : 1;
    lidar.ascending = *times.ascending;
    return;
  }
  scan.time_s.clear();
  scan.stamp_s += 0.5 * lidar.sweep_s;  // what is bent both ways is best in its middle
  if (scan.cloud.empty()) return;
  const char* const unused = times.kind == PointTimes::absent ? "" : ": not used";
  const auto told = lidar.told.try_emplace(times.kind, times.text + unused + ", " + kTakenAsItIs);
  note(scan.label, told.first->second);
}

void ScanQueue::listMembers(double now_s) {
  auto& members = x_members;
  members.clear();
  double cycle_s = std::numeric_limits<double>::infinity();
  for (const auto& [label, lidar] : x_lidars) {
    const auto first = std::find_if(x_waiting.begin(), x_waiting.end(),
                                    [&, &name = label](const Waiting& w) { return w.scan.label == name; });
    const double period_s = lidar.period_s(), due_s = lidar.end_s + period_s;
    if (first != x_waiting.end())
      members.push_back({first->end_s, true});
    else if (lidar.in_time && now_s <= due_s + std::min(kAwaitedPeriods * period_s, kPatience_s))
      members.push_back({due_s, false});
    else
      continue;
    cycle_s = std::min(cycle_s, period_s);
  }
  std::sort(members.begin(), members.end(),
            [](const Member& a, const Member& b) { return a.end_s < b.end_s; });

  // What ends a period after the first belongs to the next turn.
  const auto next_turn = std::find_if(members.begin() + 1, members.end(), [&](const Member& m) {
    return m.end_s >= members.front().end_s + cycle_s;
  });
  members.erase(next_turn, members.end());
  // The longest pause is after the last one, or else the sweep ends before it; what is about equal stays as it is.
  constexpr double kAboutEqual = 0.1;
  double longest_s = members.front().end_s + cycle_s - members.back().end_s + kAboutEqual * cycle_s;
  std::size_t count = members.size();
  for (std::size_t i = 1; i < members.size(); ++i) {
    const double pause_s = members[i].end_s - members[i - 1].end_s;
    if (pause_s <= longest_s) continue;
    longest_s = pause_s;
    count = i;
  }
  members.erase(members.begin() + static_cast<std::ptrdiff_t>(count), members.end());
}

const Sweep* ScanQueue::pop(const MotionHistory& history, double now_s) {
  if (x_waiting.empty()) return nullptr;
  listMembers(now_s);
  if (!std::all_of(x_members.begin(), x_members.end(), [](const Member& m) { return m.here; }))
    return nullptr;
  const double end_s = x_members.back().end_s;
  const auto known_s = history.knownUntil_s();
  if ((known_s && *known_s >= end_s) || now_s > end_s + kPatience_s) return leave();
  return nullptr;
}

const Sweep* ScanQueue::popAny() {
  if (x_waiting.empty()) return nullptr;
  listMembers(std::numeric_limits<double>::infinity());
  return leave();
}

const Sweep* ScanQueue::leave() {
  const double end_s = x_members.back().end_s;
  std::vector<Scan> scans = std::move(x_sweep.scans);  // for its memory
  scans.clear();
  for (auto it = x_waiting.begin(); it != x_waiting.end() && it->end_s <= end_s;) {
    const std::string label = it->scan.label;
    const bool taken =
        std::any_of(scans.begin(), scans.end(), [&](const Scan& s) { return s.label == label; });
    x_lidars.at(label).used_s = it->end_s;
    if (taken)
      note(label, "second scan in one sweep, passed over");
    else
      scans.push_back(std::move(it->scan));
    it = x_waiting.erase(it);
  }
  for (auto& [label, scan] : x_late) {
    const double late_end_s = endOfSweep(scan);
    Lidar& lidar = x_lidars.at(label);
    if (end_s - late_end_s > kOldest_s || (lidar.used_s && late_end_s <= *lidar.used_s)) {
      note(label, "too late, scan passed over");
      continue;
    }
    lidar.used_s = late_end_s;
    scans.push_back(std::move(scan));
  }
  x_late.clear();
  x_last_end_s = end_s;
  x_sweep = sweepOf(std::move(scans));
  return &x_sweep;
}

void ScanQueue::note(const std::string& label, const std::string& what) {
  ++x_noted["LiDAR " + label + ": " + what];
}

FaultCounts ScanQueue::takeFaults(double now_s) {
  for (auto& [label, lidar] : x_lidars)
    if (now_s - lidar.end_s > lidar.silentAfter_s()) {
      note(label, "silent");
      lidar.silence_told = true;
    }
  for (const std::string& label : x_expected)
    if (x_first_s && now_s - *x_first_s > kNeverHeard_s && x_lidars.count(label) == 0) note(label, "silent");
  return std::exchange(x_noted, {});
}

}  // namespace raceloc
