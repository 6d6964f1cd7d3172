/** \file
 * The newest samples of one source, and its value at any instant between them. */
#pragma once

#include <algorithm>
#include <cstddef>
#include <optional>
#include <vector>

namespace raceloc {

/** Bounded by its memory, and allocates nothing once that has been full twice. `Value` has +, - and a product with a
 * double from the left. */
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
    if (!samples().empty() && stamp_s <= x_samples.back().stamp_s) return false;
    x_samples.push_back({stamp_s, value});
    while (stamp_s - x_samples[x_forgotten].stamp_s > x_memory_s) ++x_forgotten;
    if (2 * x_forgotten > x_samples.size()) {
      x_samples.erase(x_samples.begin(), x_samples.begin() + static_cast<std::ptrdiff_t>(x_forgotten));
      x_forgotten = 0;
    }
    return true;
  }

  void dropSince(double stamp_s) {
    while (!samples().empty() && x_samples.back().stamp_s >= stamp_s) x_samples.pop_back();
  }

  /** What is remembered, in order of time; good until the next change. */
  class Samples {
   public:
    Samples(const Sample* first, const Sample* last) : x_first(first), x_last(last) {}
    [[nodiscard]] const Sample* begin() const { return x_first; }
    [[nodiscard]] const Sample* end() const { return x_last; }
    [[nodiscard]] bool empty() const { return x_first == x_last; }
    [[nodiscard]] std::size_t size() const { return static_cast<std::size_t>(x_last - x_first); }
    [[nodiscard]] const Sample& front() const { return *x_first; }
    [[nodiscard]] const Sample& back() const { return *(x_last - 1); }

   private:
    const Sample *x_first, *x_last;
  };
  [[nodiscard]] Samples samples() const {
    return {x_samples.data() + x_forgotten, x_samples.data() + x_samples.size()};
  }

  /** Linear between samples, held outside of them; none farther than max_gap_s from all. */
  [[nodiscard]] std::optional<Value> at(double stamp_s) const {
    const Samples all = samples();
    const Sample* next = std::lower_bound(all.begin(), all.end(), stamp_s,
                                          [](const Sample& s, double t) { return s.stamp_s < t; });
    const bool after = next != all.end(), before = next != all.begin();
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
    const Samples all = samples();
    if (all.size() < 2) return 0;
    const Sample* next = std::lower_bound(all.begin() + 1, all.end() - 1, stamp_s,
                                          [](const Sample& s, double t) { return s.stamp_s < t; });
    return next->stamp_s - std::prev(next)->stamp_s;
  }

  /** How long the value at a stamp after the last sample has been held; 0 before. */
  [[nodiscard]] double held_s(double stamp_s) const {
    return samples().empty() ? 0 : std::max(0.0, stamp_s - x_samples.back().stamp_s);
  }

 private:
  double x_memory_s, x_max_gap_s;
  std::vector<Sample> x_samples;
  std::size_t x_forgotten = 0;  ///< of the front; they are removed many at a time
};

}  // namespace raceloc
