#include "cli/loop_localizer.h"

#include <algorithm>
#include <cmath>

#include "pipeline/planar_control.h"

namespace raceloc {

LoopLocalizer::LoopLocalizer(const Pose& T_map_body, double stamp_s, double speed_mps,
                             const EstimatorOptions& options)
    : x_T_map_body(T_map_body),
      x_fusion(options, {}, startState(T_map_body.translation().head<2>(), yawOf(T_map_body), options.fusion),
               Control{stamp_s, speed_mps, 0}),
      x_motion(MotionOptions()),
      x_stamp_s(stamp_s),
      x_rates{speed_mps, 0} {}

void LoopLocalizer::add(const Sample& sample) {
  if (const auto* imu = std::get_if<ImuSample>(&sample)) x_motion.add(*imu);
  if (const auto* pose = std::get_if<InsPose>(&sample)) enter(*pose);
  if (const auto* wheels = std::get_if<MotionSample>(&sample)) {
    x_motion.add(*wheels);
    moveTo(wheels->stamp_s);
  }
}

Pose LoopLocalizer::between(double from_s, double to_s) const {
  const auto motion = x_motion.between(from_s, to_s);
  return motion ? motion->T_start_end : Pose::Identity();
}

double LoopLocalizer::course_rad() const {
  const auto rates = x_motion.ratesAt(x_stamp_s);
  return rates ? std::atan2(rates->twist(4), rates->twist(3)) : 0;
}

void LoopLocalizer::moveTo(double stamp_s) {
  const auto motion = x_motion.between(x_stamp_s, stamp_s);
  if (!motion || !(stamp_s > x_stamp_s)) return;
  const Pose T_map_next = x_T_map_body * motion->T_start_end;
  (void)x_fusion.add(planarControl(stamp_s, stamp_s - x_stamp_s, x_T_map_body, T_map_next));
  if (const auto rates = x_motion.ratesBetween(x_stamp_s, stamp_s)) x_rates = *rates;
  x_T_map_body = T_map_next;
  x_stamp_s = stamp_s;
}

void LoopLocalizer::enter(const InsPose& pose) {
  constexpr double kLeastSigma_m = 0.1;  // as LocalizerPolicy::gps_min_sigma_m
  const bool is_match = pose.label == kMatchLabel;
  const Eigen::Matrix3d& R = pose.T_map_body.linear();
  Eigen::Matrix2d cov_m2 =
      (R * pose.covariance.bottomRightCorner<3, 3>() * R.transpose()).topLeftCorner<2, 2>();
  if (!is_match) cov_m2 += kLeastSigma_m * kLeastSigma_m * Eigen::Matrix2d::Identity();
  const auto taken = x_fusion.add(TimedFix{
      pose.stamp_s, PoseFix{pose.label, pose.T_map_body.translation().head<2>(), cov_m2, HeadingKind::body,
                            yawOf(pose.T_map_body), std::sqrt(pose.covariance(2, 2))}});
  if (taken != Acceptance::taken || x_fusion.made().empty()) return;
  const GateDecision& decision = x_fusion.made().back().decision;
  x_alarm = decision.alarm;
  const bool is_believed =
      is_match && std::any_of(decision.sources.begin(), decision.sources.end(),
                              [](const SourceVerdict& v) { return v.source == kMatchLabel && v.accepted; });
  if (!is_believed) return;
  constexpr double kLongest_s = 1;  // as the localizer teaches
  if (x_last_match && pose.stamp_s - x_last_match->stamp_s < kLongest_s)
    x_motion.observe(x_last_match->stamp_s, pose.stamp_s,
                     x_last_match->T_map_body.inverse() * pose.T_map_body,
                     x_last_match->covariance + pose.covariance);
  x_last_match = pose;
  x_T_map_body = pose.T_map_body * between(pose.stamp_s, x_stamp_s);
}

}  // namespace raceloc
