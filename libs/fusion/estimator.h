/** \file
 * One step of the estimate: motion, then a decision between sources. Everything that later steps depend on is in one
 * value, so that a history may go back to any of them. */
#pragma once

#include <optional>
#include <vector>

#include "fusion/fusion_filter.h"
#include "fusion/recovery.h"
#include "fusion/reliability.h"

namespace raceloc {

struct EstimatorOptions {
  FusionOptions fusion;
  GateOptions gate;
  ReliabilityOptions reliability;
  RecoveryOptions recovery;
};

/** The estimate at an instant, and what is remembered of the sources. */
struct EstimatorState {
  double stamp_s;
  CarState car;
  MotionWitness motion;
  std::vector<SourceRecord> records;  ///< by name
  double confirmed_s;                 ///< when a source last confirmed the estimate, or when it began
  double alone_m = 0;                 ///< way since then
  int resets = 0;                     ///< by two keys, so far
  /** Since when two sources have agreed with each other against the estimate, and when they last did. */
  std::optional<double> keys_since_s, keys_seen_s;
};

/** A first state. */
[[nodiscard]] EstimatorState beginAt(double stamp_s, const CarState& car);

/** Steps of EstimatorState. Holds the filter's work space and no state of its own. */
class Estimator {
 public:
  /** \throws InputError if options contradict each other. */
  explicit Estimator(const EstimatorOptions& options);

  /** Dead reckoning to `to_s`, at the rates of a control. Nothing if `to_s` is not later than the state. */
  void advance(EstimatorState& state, const Control& rates, double to_s);

  /** Decides between fixes of the state's time, one of each source.
   *
   * 1. What each source's fixes told of it is brought up to date, and sources are held against each other
   *    (reliability.h): those that left are out.
   *    Where those that are in contradict the estimate alike, it is the estimate that is off: its covariance grows as
   *    many times (fading memory), and their claims stay as they are.
   * 2. A fix confirms the estimate if its own claim explains its innovation, its source scatters as it claims, and
   *    another source or the car's motion agrees with it, unless it is the only one. While
   *    the newest fix of some source does, fixes that contradict the estimate have no say.
   *    When nobody has for alone_s, fixes have no say that are farther off than dead reckoning may be by drift_share of the
   *    way.
   * 3. Claims that innovations contradict are inflated, by half their normalised square; gate() decides between what is
   *    left, and the filter is corrected with the result. An alarm is a decision while nobody confirms the estimate.
   * 4. When nobody has confirmed it for RecoveryOptions::alone_s, and two sources have agreed with each other for
   *    agree_s, the estimate is set to them (reading.md section 2, lock-out); for leap_s if both leapt away from it.
   * A heading that is as unlikely is left out, while the estimate is confirmed, and the position is heard alone.
   * \throws std::invalid_argument as gate() does. */
  GateDecision decide(EstimatorState& state, std::vector<PoseFix> fixes);

  [[nodiscard]] const EstimatorOptions& options() const { return x_options; }

 private:
  /** What the gate is given. */
  struct Hearing {
    std::vector<PoseFix> fixes;
    std::vector<std::size_t> numbers;  ///< of each of them, among all fixes
  };

  [[nodiscard]] bool isConfirmed(const EstimatorState& state) const;
  void widen(EstimatorState& state, const std::vector<PoseFix>& fixes) const;
  /** What each source's own fix says of it; whether it confirms the estimate is noted in its record. */
  [[nodiscard]] std::vector<SourceVerdict> holdAgainst(EstimatorState& state,
                                                       const std::vector<PoseFix>& fixes) const;
  /** The fixes that have a say, with the claims that are believed; why others have none goes into their verdicts (delta, limit). */
  [[nodiscard]] Hearing hear(const EstimatorState& state, std::vector<PoseFix> fixes,
                             std::vector<SourceVerdict>& verdicts) const;
  void corrected(EstimatorState& state, const CarState& to) const;
  [[nodiscard]] bool contradictsHeading(const CarState& predicted, const SourceRecord& record) const;
  void tryTwoKeys(EstimatorState& state, GateDecision& decision) const;

  EstimatorOptions x_options;
  double x_confirm_limit;  ///< of the normalised innovation squared of a position
  FusionFilter x_filter;
};

}  // namespace raceloc
