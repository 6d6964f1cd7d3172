/** \file
 * Localization for drives with a closed loop. */
#pragma once

#include <optional>

#include "fusion/history.h"
#include "odometry/motion_history.h"

namespace raceloc {

/** As the localizer and the gate's options name it. */
constexpr char kMatchLabel[] = "scan_match";

/** What the localizer (pipeline/localizer.h) makes of a car's sensors, without a map: dead reckoning, calibration,
 * history, filter and gate are the same; what it would match is told instead, as an InsPose labelled `scan_match`. */
class LoopLocalizer {
 public:
  /** \param T_map_body  at the start, known to a metre and a few degrees */
  LoopLocalizer(const Pose& T_map_body, double stamp_s, double speed_mps, const EstimatorOptions& options);

  /** In order of arrival. Scans and fixes without a pose say nothing here. */
  void add(const Sample& sample);

  /** The plane's part of the estimate at an instant. */
  [[nodiscard]] CarState at(double stamp_s) { return x_fusion.at(stamp_s).car; }
  /** Motion of the body between two instants of the last seconds; held for half a second beyond the newest sample.
   * Identity where it is not known. */
  [[nodiscard]] Pose between(double from_s, double to_s) const;
  [[nodiscard]] const MotionHistory& motion() const { return x_motion; }
  [[nodiscard]] MotionHistory::Rates rates() const { return x_rates; }  ///< about the body's axes, newest
  /** From the heading to where the rear axle goes, now: the side-slip. */
  [[nodiscard]] double course_rad() const;
  /** Unit vector against gravity, in the body's axes. */
  [[nodiscard]] Eigen::Vector3d up_body() const { return x_T_map_body.linear().row(2); }
  /** The gate's last word: no source confirms the estimate. */
  [[nodiscard]] bool alarm() const { return x_alarm; }

 private:
  void moveTo(double stamp_s);
  void enter(const InsPose& pose);

  // What is aligned to 16 bytes comes first: less padding.
  Pose x_T_map_body;                    ///< attitude and height as last matched, moved on to x_stamp_s
  std::optional<InsPose> x_last_match;  ///< believed
  FusionHistory x_fusion;
  MotionHistory x_motion;
  double x_stamp_s;
  MotionHistory::Rates x_rates;
  bool x_alarm = false;
};

}  // namespace raceloc
