#include "sensors/sample_order.h"

#include <algorithm>
#include <cmath>
#include <utility>

namespace raceloc {

namespace {

constexpr double kLeastLeap_s = 0.25;
constexpr std::size_t kMaxHeld = 20'000;

bool areOneKind(const Sample& a, const Sample& b) {
  const auto is_gps = [](const Sample& s) {
    return std::holds_alternative<GpsFix>(s) || std::holds_alternative<InsPose>(s);
  };
  return a.index() == b.index() || (is_gps(a) && is_gps(b));
}

bool isMotion(const Sample& s) {
  return std::holds_alternative<MotionSample>(s) || std::holds_alternative<ImuSample>(s);
}

}  // namespace

SampleOrder::SampleOrder(double window_s, Late late)
    : x_window_s(window_s), x_leap_s(std::max(kLeastLeap_s, 0.5 * window_s)), x_late_policy(late) {
  x_last_s.fill(x_last_out_s);
}

void SampleOrder::add(Sample sample) {
  const double stamp_s = stampOf(sample);
  if (stamp_s < x_last_out_s) {
    if (x_late_policy == Late::passed && (!isMotion(sample) || stamp_s >= x_last_s[sample.index()]))
      x_passed.push_back(std::move(sample));
    else
      ++x_late;
    return;
  }
  const double before_s = x_clock_s;
  if (stamp_s <= x_clock_s + x_leap_s) {
    x_clock_s = std::max(x_clock_s, stamp_s);
    x_waiting.emplace(stamp_s, std::move(sample));
  } else {
    if (isBelieved(sample)) x_clock_s = stamp_s;
    x_ahead.push_back({std::move(sample), before_s});
  }
  if (x_clock_s > before_s) settle(x_leap_s);
}

bool SampleOrder::isBelieved(const Sample& leap) const {
  return x_ahead.size() > kMaxHeld || std::any_of(x_ahead.begin(), x_ahead.end(), [&](const Ahead& before) {
           const double since_s = stampOf(leap) - stampOf(before.sample);
           return areOneKind(before.sample, leap) ? before.clock_s == x_clock_s && since_s > x_leap_s
                                                  : std::abs(since_s) <= x_leap_s;
         });
}

void SampleOrder::settle(double slack_s) {
  const auto decided = [&](Ahead& ahead) {
    const double stamp_s = stampOf(ahead.sample);
    if (stamp_s <= x_clock_s + x_leap_s) {
      x_waiting.emplace(stamp_s, std::move(ahead.sample));
      return true;
    }
    if (x_clock_s <= ahead.clock_s + slack_s || stamp_s <= x_clock_s + x_window_s) return false;
    ++x_left_out[labelOf(ahead.sample)];
    return true;
  };
  std::vector<Ahead> open;
  for (Ahead& ahead : x_ahead)
    if (!decided(ahead)) open.push_back(std::move(ahead));
  x_ahead = std::move(open);
}

void SampleOrder::end() {
  x_at_end = true;
  settle(0);
  for (Ahead& ahead : x_ahead) x_waiting.emplace(stampOf(ahead.sample), std::move(ahead.sample));
  x_ahead.clear();
}

std::optional<Sample> SampleOrder::next() {
  if (!x_passed.empty()) {
    Sample first = std::move(x_passed.front());
    x_passed.pop_front();
    x_last_s[first.index()] = std::max(x_last_s[first.index()], stampOf(first));
    return first;
  }
  if (x_waiting.empty()) return std::nullopt;
  const auto first = x_waiting.begin();
  if (!x_at_end && x_clock_s - first->first <= x_window_s && x_waiting.size() <= kMaxHeld)
    return std::nullopt;
  x_last_out_s = first->first;
  x_last_s[first->second.index()] = x_last_out_s;
  return std::move(x_waiting.extract(first).mapped());
}

void SampleOrder::forEachAt(double stamp_s, const std::function<void(Sample&)>& change) {
  const auto [begin, end] = x_waiting.equal_range(stamp_s);
  for (auto waiting = begin; waiting != end; ++waiting) change(waiting->second);
  for (Ahead& ahead : x_ahead)
    if (stampOf(ahead.sample) == stamp_s) change(ahead.sample);
}

}  // namespace raceloc
