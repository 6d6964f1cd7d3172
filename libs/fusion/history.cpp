#include "fusion/history.h"

#include <algorithm>
#include <cmath>
#include <tuple>

#include "core/types.h"
#include "fusion/measurement.h"

namespace raceloc {

namespace {

bool before(const Control& a, const Control& b) {
  return std::tie(a.stamp_s, a.speed_mps, a.yaw_rate_rps, a.slip_rad, a.speed_sigma_mps) <
         std::tie(b.stamp_s, b.speed_mps, b.yaw_rate_rps, b.slip_rad, b.speed_sigma_mps);
}

}  // namespace

void HistoryOptions::describe(OptionList& keys) {
  keys.add("lag_s", lag_s, between(0.5, kLongestLag_s), "a measurement may come so late and still count [s]");
  keys.add("group_s", group_s, between(0, kLongestGroup_s),
           "fixes within this time are decided on together [s]");
}

FusionHistory::FusionHistory(const EstimatorOptions& options, const HistoryOptions& history,
                             const CarState& start, const Control& rates)
    : x_estimator(options),
      x_options(history),
      x_base(beginAt(rates.stamp_s, start)),
      x_head(x_base),
      x_controls{rates} {}

template <class Use>
void FusionHistory::forControls(double from_s, double to_s, const Use& use) const {
  auto control = std::upper_bound(x_controls.begin(), x_controls.end(), from_s,
                                  [](double t, const Control& c) { return t < c.stamp_s; });
  for (; control != x_controls.end() && from_s < to_s; ++control) {
    const double end_s = std::min(control->stamp_s, to_s);
    if (end_s <= from_s) continue;
    use(*control, end_s);
    from_s = end_s;
  }
  if (from_s < to_s) use(x_controls.back(), to_s);
}

void FusionHistory::advance(EstimatorState& state, double to_s) {
  forControls(state.stamp_s, to_s,
              [&](const Control& rates, double end_s) { x_estimator.advance(state, rates, end_s); });
}

PoseFix FusionHistory::carried(TimedFix fix, const EstimatorState& now) const {
  PoseFix out = std::move(fix.fix);
  if (!(fix.stamp_s < now.stamp_s)) return out;
  const FusionOptions& noise = x_estimator.options().fusion;
  Eigen::Vector2d p_m = Eigen::Vector2d::Zero();  // of the body now, in its axes then
  double turn_rad = 0, length_m = 0, since_s = fix.stamp_s;
  forControls(fix.stamp_s, now.stamp_s, [&](const Control& rates, double end_s) {
    const double step_s = end_s - since_s, step_m = rates.speed_mps * step_s;
    const double course_rad = now.car.mean(3) + rates.slip_rad + turn_rad + 0.5 * step_s * rates.yaw_rate_rps;
    p_m += step_m * Eigen::Vector2d(std::cos(course_rad), std::sin(course_rad));
    turn_rad += step_s * rates.yaw_rate_rps;
    length_m += step_m;
    since_s = end_s;
  });
  out.p_body_m = Eigen::Rotation2Dd(-turn_rad) * (out.p_body_m - p_m);
  out.heading_rad += turn_rad;
  const double duration_s = now.stamp_s - fix.stamp_s;
  out.heading_sigma_rad = std::hypot(out.heading_sigma_rad, noise.yaw_rate_sigma_rps * std::sqrt(duration_s));
  const Eigen::Vector2d variance_m2 =
      duration_s * Eigen::Vector2d(std::pow(noise.speed_sigma_mps, 2),
                                   std::pow(noise.yaw_rate_sigma_rps * length_m, 2) / 3);
  const Eigen::Matrix2d R = Eigen::Rotation2Dd(now.car.mean(2) - turn_rad).toRotationMatrix();
  out.cov_p_m2 += R * variance_m2.asDiagonal() * R.transpose();
  return out;
}

const EstimatorState& FusionHistory::lastBefore(double stamp_s) const {
  for (auto group = x_groups.rbegin(); group != x_groups.rend(); ++group)
    if (group->after.stamp_s <= stamp_s) return group->after;
  return x_base;
}

EstimatorState FusionHistory::at(double stamp_s) {
  EstimatorState state = lastBefore(stamp_s);
  advance(state, stamp_s);
  return state;
}

Acceptance FusionHistory::add(const Control& control) {
  x_made.clear();
  if (!isFinite(control)) return Acceptance::unsound;
  const double newest_s = x_controls.back().stamp_s;
  if (control.stamp_s <= newest_s - x_options.lag_s || control.stamp_s <= x_base.stamp_s)
    return Acceptance::late;

  const auto place = std::upper_bound(x_controls.begin(), x_controls.end(), control, before);
  const double since_s = place == x_controls.begin() ? x_base.stamp_s : std::prev(place)->stamp_s;
  const bool in_order = place == x_controls.end();
  x_controls.insert(place, control);

  const auto changed = std::find_if(x_groups.begin(), x_groups.end(),
                                    [&](const Group& group) { return group.after.stamp_s > since_s; });
  const bool groups_changed = changed != x_groups.end();
  if (groups_changed) redoFrom(static_cast<std::size_t>(changed - x_groups.begin()));
  if (in_order && !groups_changed)
    advance(x_head, control.stamp_s);
  else
    x_head = at(x_controls.back().stamp_s);
  forget();
  return Acceptance::taken;
}

Acceptance FusionHistory::add(const TimedFix& timed) {
  x_made.clear();
  if (!std::isfinite(timed.stamp_s) || defectOf(timed.fix)) return Acceptance::unsound;
  const double newest_s = x_controls.back().stamp_s;
  if (timed.stamp_s <= newest_s - x_options.lag_s || timed.stamp_s < x_base.stamp_s) return Acceptance::late;
  if (timed.stamp_s > newest_s + x_options.lag_s) return Acceptance::ahead;

  const auto key = [](const TimedFix& t) { return std::tie(t.stamp_s, t.fix.source); };
  const auto place = std::lower_bound(x_fixes.begin(), x_fixes.end(), timed,
                                      [&](const TimedFix& a, const TimedFix& b) { return key(a) < key(b); });
  if (place != x_fixes.end() && key(*place) == key(timed)) return Acceptance::repeated;
  x_fixes.insert(place, timed);
  const auto changed = std::find_if(x_groups.begin(), x_groups.end(), [&](const Group& group) {
    return timed.stamp_s < group.begin_s + x_options.group_s || timed.stamp_s <= group.begin_s;
  });
  redoFrom(static_cast<std::size_t>(changed - x_groups.begin()));
  x_head = at(newest_s);
  return Acceptance::taken;
}

void FusionHistory::redoFrom(std::size_t number) {
  const auto endOf = [&](double begin_s) {  // the first fix that is not in the group that begins there
    return std::find_if(x_fixes.begin(), x_fixes.end(), [&](const TimedFix& t) {
      return t.stamp_s > begin_s && t.stamp_s >= begin_s + x_options.group_s;
    });
  };
  auto first = number == 0 ? x_fixes.begin() : endOf(x_groups[number - 1].begin_s);
  x_groups.resize(number);
  while (first != x_fixes.end()) {
    const auto end = endOf(first->stamp_s);
    EstimatorState state = x_groups.empty() ? x_base : x_groups.back().after;
    advance(state, std::prev(end)->stamp_s);
    DatedDecision dated{state.stamp_s, {}, {}, first->stamp_s};
    for (auto fix = first; fix != end; ++fix) {
      const bool newer_comes = std::any_of(
          std::next(fix), end, [&](const TimedFix& later) { return later.fix.source == fix->fix.source; });
      if (!newer_comes) dated.fixes.push_back(carried(*fix, state));
    }
    dated.decision = x_estimator.decide(state, dated.fixes);
    x_groups.push_back({first->stamp_s, std::move(state)});
    x_made.push_back(std::move(dated));
    first = end;
  }
}

void FusionHistory::forget() {
  const double reach_s = x_controls.back().stamp_s - x_options.lag_s;
  // A group's last piece runs at the rates of the control after it; up to here none can come between any more.
  double settled_s = x_base.stamp_s;
  for (auto control = x_controls.begin(); control != x_controls.end() && control->stamp_s <= reach_s;
       ++control)
    settled_s = control->stamp_s;
  while (!x_groups.empty() && x_groups.front().begin_s + x_options.group_s <= reach_s &&
         x_groups.front().after.stamp_s <= settled_s) {
    x_base = x_groups.front().after;
    const double begin_s = x_groups.front().begin_s;
    x_groups.erase(x_groups.begin());
    while (!x_fixes.empty() &&
           (x_fixes.front().stamp_s <= begin_s || x_fixes.front().stamp_s < begin_s + x_options.group_s))
      x_fixes.pop_front();
  }
  const double to_s = x_groups.empty() ? reach_s : std::min(reach_s, x_groups.front().begin_s);
  // Only whole pieces: a later piece then ends where it would have ended without this.
  while (x_controls.size() > 1 && x_controls.front().stamp_s <= to_s) {
    if (x_controls.front().stamp_s > x_base.stamp_s)
      x_estimator.advance(x_base, x_controls.front(), x_controls.front().stamp_s);
    x_controls.pop_front();
  }
}

}  // namespace raceloc
