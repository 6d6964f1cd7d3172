/** \file
 * Samples in order of time, whichever way they come. */
#pragma once

#include <array>
#include <cstddef>
#include <deque>
#include <functional>
#include <limits>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "core/samples.h"

namespace raceloc {

/** What becomes of a sample that is older than what has gone out already. Motion that is older than motion of its kind is
 * always dropped: who integrates it needs it in order. */
enum class Late {
  dropped,  ///< and counted
  passed,   ///< goes out at once, for a reader that can put it in its place
};

/** Samples wait until the clock is `window_s` past their stamps: then what is late by less is in order. Equal stamps
 * keep the order in which they came.
 *
 * The clock is the newest stamp that can be believed. One that leaps ahead of it, by more than half of the window and
 * 0.25 s, would make all that follow late. So it waits outside and does not move the clock, until
 *  - another kind of device leaps to about the same time: the recording had a gap, or begins;
 *  - its own kind goes on from there while nothing moves the clock: it is the only one left;
 *  - the clock comes near: the others were delayed;
 *  - or the clock has gone on from where it was, and the stamp is still more than the window ahead: it is wrong, and
 *    the sample is left out and counted by its label.
 * GPS receivers and their INS poses are one kind, and so are several LiDARs.
 * Bounded: it holds at most 20 000 samples more than the window asks for, when stamps stand still. */
class SampleOrder {
 public:
  explicit SampleOrder(double window_s, Late late = Late::dropped);

  /** One that is older than what has already gone out is dropped and counted, or passed. */
  void add(Sample sample);
  void end();  ///< no more will come
  /** The next one; none while it has to wait for more, or after the last. */
  [[nodiscard]] std::optional<Sample> next();
  /** For what is still here with this stamp. */
  void forEachAt(double stamp_s, const std::function<void(Sample&)>& change);

  [[nodiscard]] std::size_t droppedLate() const { return x_late; }
  [[nodiscard]] const std::map<std::string, std::size_t>& leftOut() const {
    return x_left_out;
  }  ///< by label

 private:
  struct Ahead {
    Sample sample;
    double clock_s;  ///< when it came
  };
  [[nodiscard]] bool isBelieved(const Sample& leap) const;
  /** Decides on leaps from which the clock has gone on by more than `slack_s`, and on those that it has come near. */
  void settle(double slack_s);

  double x_window_s, x_leap_s;
  Late x_late_policy;
  double x_clock_s = -std::numeric_limits<double>::infinity(), x_last_out_s = x_clock_s;
  bool x_at_end = false;
  std::multimap<double, Sample> x_waiting;  ///< by stamp
  std::deque<Sample> x_passed;              ///< late ones that go out next
  std::vector<Ahead> x_ahead;               ///< leaps, in the order in which they came
  std::size_t x_late = 0;
  std::array<double, std::variant_size_v<Sample>> x_last_s;  ///< that went out, by kind
  std::map<std::string, std::size_t> x_left_out;
};

}  // namespace raceloc
