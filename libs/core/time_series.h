/** \file
 * The newest samples of one source, and its value at any instant between them. */
#pragma once

#include <algorithm>
#include <deque>
#include <optional>

namespace raceloc {

/** Bounded by its memory. `Value` has +, - and a product with a double from the left. */
template <class Value>
class TimeSeries {
 public:
  struct Sample {
    double stamp_s;
    Value value;
  };

  /** \param memory_s how far back samples are kept
   * \param max_gap_s how far from the nearest sample a value is still believed */
  TimeSeries(double memory_s, double max_gap_s) : x_memory_s(memory_s), x_max_gap_s(max_gap_s) {}

  /** \return false, and nothing changes, for a sample that is not newer than the last. */
  bool add(double stamp_s, const Value& value) {
    if (!x_samples.empty() && stamp_s <= x_samples.back().stamp_s) return false;
    x_samples.push_back({stamp_s, value});
    while (x_samples.back().stamp_s - x_samples.front().stamp_s > x_memory_s) x_samples.pop_front();
    return true;
  }

  void dropSince(double stamp_s) {
    while (!x_samples.empty() && x_samples.back().stamp_s >= stamp_s) x_samples.pop_back();
  }

  [[nodiscard]] const std::deque<Sample>& samples() const { return x_samples; }

  /** Linear between samples, held outside of them; none farther than max_gap_s from all. */
  [[nodiscard]] std::optional<Value> at(double stamp_s) const {
    const auto next = std::lower_bound(x_samples.begin(), x_samples.end(), stamp_s,
                                       [](const Sample& s, double t) { return s.stamp_s < t; });
    const bool after = next != x_samples.end(), before = next != x_samples.begin();
    const double after_s = after ? next->stamp_s - stamp_s : x_max_gap_s + 1;
    const double before_s = before ? stamp_s - std::prev(next)->stamp_s : x_max_gap_s + 1;
    if (std::min(after_s, before_s) > x_max_gap_s) return std::nullopt;
    if (!after) return std::prev(next)->value;
    if (!before) return next->value;
    const Sample& last = *std::prev(next);
    return Value(last.value + before_s / (before_s + after_s) * (next->value - last.value));
  }

  /** Time between the samples around a stamp, or between the last two; 0 with less than two. */
  [[nodiscard]] double spacing_s(double stamp_s) const {
    if (x_samples.size() < 2) return 0;
    auto next = std::lower_bound(x_samples.begin() + 1, x_samples.end() - 1, stamp_s,
                                 [](const Sample& s, double t) { return s.stamp_s < t; });
    return next->stamp_s - std::prev(next)->stamp_s;
  }

  /** How long the value at a stamp after the last sample has been held; 0 before. */
  [[nodiscard]] double held_s(double stamp_s) const {
    return x_samples.empty() ? 0 : std::max(0.0, stamp_s - x_samples.back().stamp_s);
  }

 private:
  double x_memory_s, x_max_gap_s;
  std::deque<Sample> x_samples;
};

}  // namespace raceloc
