/** \file
 * The estimate over the last moments, in which measurements may still arrive. */
#pragma once

#include <deque>
#include <string>
#include <vector>

#include "fusion/estimator.h"

namespace raceloc {

/** Section [history]. */
struct HistoryOptions {
  static constexpr double kLongestLag_s = 10, kLongestGroup_s = 0.5;
  double lag_s = 1;
  double group_s = 0.04;
  void describe(OptionList& keys);
};

/** What became of a measurement. */
enum class Acceptance {
  taken,
  late,      ///< older than the lag
  ahead,     ///< of the car's own clock, by more than the lag
  repeated,  ///< of a source and a time that are there already
  unsound    ///< a field that is not finite, or a covariance that is none
};

/** A decision that the history holds. */
struct DatedDecision {
  double stamp_s;
  std::vector<PoseFix> fixes;  ///< carried to stamp_s: of each source that spoke
  GateDecision decision;
  double begin_s = 0;  ///< of the earliest of its fixes, before it was carried
};

/** Fixed-lag history: controls and fixes may come in any order, up to lag_s late; estimate and decisions are those of
 * the right order, to the bit, because what comes late goes to its place and all after it is done again.
 *
 * Fixes are decided on in groups: the earliest that is in none, and all within group_s after it; of one source the
 * newest. The decision is of the time of the group's newest fix; earlier ones are carried to it by the controls, as a
 * lever arm: an antenna that was at p when the car was elsewhere is a point of the car now. Source: reading.md sections
 * 1 and 2. */
class FusionHistory {
 public:
  /** \param rates  of the motion at the start, whose time is its stamp \throws InputError as Estimator does. */
  FusionHistory(const EstimatorOptions& options, const HistoryOptions& history, const CarState& start,
                const Control& rates);

  Acceptance add(const Control& control);
  Acceptance add(const TimedFix& fix);

  /** The estimate at an instant, ahead of the newest control at its rates; for one before the lag, the oldest there is. */
  [[nodiscard]] EstimatorState at(double stamp_s);
  /** At the newest control. */
  [[nodiscard]] const EstimatorState& newest() const { return x_head; }
  [[nodiscard]] const Control& newestControl() const { return x_controls.back(); }

  /** Decisions that the last add() made, or made anew; the newest last. They replace those that began when the first of
   * them did, or later. */
  [[nodiscard]] const std::vector<DatedDecision>& made() const { return x_made; }

 private:
  struct Group {
    double begin_s;  ///< of its first fix
    EstimatorState after;
  };
  /** Calls `use(rates, to_s)` for the pieces of constant rates. */
  template <class Use>
  void forControls(double from_s, double to_s, const Use& use) const;
  void advance(EstimatorState& state, double to_s);
  /** As a fix of the time of `now`, which is not before it. */
  [[nodiscard]] PoseFix carried(TimedFix fix, const EstimatorState& now) const;
  /** Makes the groups anew, from a number on. */
  void redoFrom(std::size_t group);
  [[nodiscard]] const EstimatorState& lastBefore(double stamp_s) const;
  /** What no measurement can reach any more goes into x_base. */
  void forget();

  Estimator x_estimator;
  HistoryOptions x_options;
  EstimatorState x_base, x_head;
  std::deque<Control> x_controls;  ///< by stamp, at least one; all but perhaps that one end after x_base
  std::deque<TimedFix> x_fixes;    ///< by stamp, then source: of the groups
  std::vector<Group> x_groups;
  std::vector<DatedDecision> x_made;
};

}  // namespace raceloc
