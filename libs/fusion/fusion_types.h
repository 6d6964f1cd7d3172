/** \file
 * What goes into the fusion filter, what comes out, and what the gate said of it. */
#pragma once

#include <Eigen/Core>
#include <cmath>
#include <string>
#include <vector>

namespace raceloc {

/** What a source's heading measures. */
enum class HeadingKind {
  none,    ///< position only: no heading, or a GPS below walking speed
  body,    ///< theta: dual antenna, INS, scan match
  course,  ///< theta + b, the direction of motion: single antenna
};

/** One pose source's measurement, map frame. */
struct PoseFix {
  std::string source;        ///< label; a decision sees each label once
  Eigen::Vector2d p_map_m;   ///< where the point p_body_m of the car is
  Eigen::Matrix2d cov_p_m2;  ///< symmetric positive definite
  HeadingKind heading = HeadingKind::none;
  double heading_rad = 0;        ///< 0 = east, counter-clockwise; read unless heading is `none`
  double heading_sigma_rad = 0;  ///< > 0 unless heading is `none`
  Eigen::Vector2d p_body_m = Eigen::Vector2d::Zero();  ///< lever arm of an antenna; the rear axle has none
};

/** A fix and the time it is of. */
struct TimedFix {
  double stamp_s;
  PoseFix fix;
};

/** How the car moved in the plane of the map until `stamp_s`, since the control before. */
struct Control {
  double stamp_s;
  double speed_mps;     ///< forward, of the rear axle
  double yaw_rate_rps;  ///< about the vertical, counter-clockwise
  double slip_rad = 0;  ///< known part of the angle from heading to course; b is the rest
  /** Error of the speed, averaged over one second, where it is larger than FusionOptions says. */
  double speed_sigma_mps = 0;
};

[[nodiscard]] inline bool isFinite(const Control& c) {
  return std::isfinite(c.stamp_s) && std::isfinite(c.speed_mps) && std::isfinite(c.yaw_rate_rps) &&
         std::isfinite(c.slip_rad) && std::isfinite(c.speed_sigma_mps);
}

/** State of the filter: x, y [m] in the map, theta [rad] heading of the body in [-pi, pi), b [rad] the angle
 * from heading to course (side-slip and mounting error) less what the control knows of it, so that motion goes along
 * theta + b + slip. */
struct CarState {
  Eigen::Vector4d mean;        ///< x y theta b
  Eigen::Matrix4d covariance;  ///< of it, symmetric
};

/** The four cases of eq_conditional_measure. */
enum class GateRule {
  primary = 1,        ///< all within epsilon: the first in the configured order
  weighted = 2,       ///< all within delta: weighted sum
  rejected_some = 3,  ///< some beyond delta: rule 1 or 2 among the others
  rejected_all = 4,   ///< all beyond delta: no correction, alarm
};

/** What the gate held against one source. */
struct SourceVerdict {
  std::string source;
  /** Delta_k: [m] for GateMetric::metric, normalised innovation squared for chi2. Of a source that left the others, how
   * far [m]; of one that contradicts an estimate which others confirm, its normalised innovation squared; of one that is
   * farther off than dead reckoning may be, while nobody confirms, the same with what that may be off. */
  double delta;
  double limit;    ///< accepted up to here, in the unit of delta
  double p_theta;  ///< p(Theta_k | x), eq_sigmoid_mahala: 0.5 for delta = 0, falling to 0
  double weight;  ///< its share in the correction; those of all sources add up to 1, or to 0 for rejected_all
  bool accepted;
  double nis = 0;        ///< normalised innovation squared of its position, as it claims to be: 2 in the mean
  double inflation = 1;  ///< by what its covariance was multiplied, because of that
  bool left = false;     ///< it left the other sources: delta is how far [m], limit what they allow
  /** Accepted, its innovation is what its claim lets expect, and another source or the car's motion agrees with it,
   * unless it is the only source. */
  bool confirms = false;
  /** Fix less estimate, along and across the estimate's heading. */
  Eigen::Vector2d innovation_body_m = Eigen::Vector2d::Zero();
};

struct GateDecision {
  GateRule rule;
  std::vector<SourceVerdict> sources;  ///< in the order of the fixes
  bool alarm;                          ///< no source confirms the estimate: the car dead-reckons
  bool reset = false;                  ///< two keys turned: the estimate was set to two sources that agree
};

}  // namespace raceloc
