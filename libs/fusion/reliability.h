/** \file
 * What the last fixes of each source tell of it: whether its errors are what it claims, and whether it leaves the
 * others. */
#pragma once

#include <Eigen/Core>
#include <optional>
#include <string>
#include <vector>

#include "core/options.h"
#include "fusion/fusion_types.h"

namespace raceloc {

/** Section [reliability]. */
struct ReliabilityOptions {
  double window_s = 0.5;
  double separation_m = 0.5;
  double separation_sigmas = 3;
  double confirm_false_alarm = 1e-5;
  double inflate_from = 3;
  double fresh_s = 0.5;
  double return_s = 1;
  double motion_memory_s = 0.5;
  void describe(OptionList& keys);
};

/** One source, as its fixes of the last moments show it. Means are exponential, over ReliabilityOptions::window_s. */
struct SourceRecord {
  std::string source;
  double stamp_s;              ///< of its newest fix
  double steady_since_s;       ///< when mean_m last began anew, or the source spoke again after a silence
  Eigen::Vector2d residual_m;  ///< newest, fix less estimate, map axes
  /** The same if the car's heading were what the fix says: of an estimate whose heading is far off, a lever arm makes
   * residuals that do not agree. */
  Eigen::Vector2d own_residual_m;
  Eigen::Vector2d mean_m;    ///< of the residuals since it last jumped
  Eigen::Vector2d rate_mps;  ///< mean rate of the residuals: an estimate with a wrong heading runs away
  Eigen::Matrix2d cov_m2;    ///< newest claim
  /** Residual against theta and claim, if the newest fix has a heading. Of a course, with all of b in theta. */
  std::optional<double> heading_rad, heading_sigma_rad;
  double nis = 0;  ///< of the newest fix, see positionNis()
  /** While it has left: how far from the others it was when they last disagreed, and how far would do. Of one that was
   * outvoted the distance to the nearest of them, else to their mean. */
  double left_by_m = 0, left_limit_m = 0;
  /** Mean of half the normalised innovation squared: 1 if estimate and claim are right. */
  double contradiction = 1;
  double noise = 1;       ///< mean square step between residuals over what the claim lets expect
  double scatter = 1;     ///< the same with each step at most kMostStep: forgives soon
  int steps = 0;          ///< of which rate_mps is the mean: the first ones count alike
  bool confirms = false;  ///< its newest fix was accepted, as its claim lets expect, and it is supported
  bool left = false;
  /** Another source or the car's own motion agrees with it, or there is no other source. */
  bool supported = true;
  /** It confirmed the estimate, then was elsewhere from one fix to the next, and has neither leapt back nor confirmed it
   * since: the car does not move so, hence the fault is the source's. Not of one that scatters: that is noise. */
  bool leapt = false;
  std::optional<double> with_others_since_s;  ///< while it has left: since when it is back
};

/** The own residual that a fix would have now: sources that do not speak at the same time can be compared. */
[[nodiscard]] inline Eigen::Vector2d residualAt(const SourceRecord& record, double stamp_s) {
  return record.own_residual_m + (stamp_s - record.stamp_s) * record.rate_mps;
}

constexpr double kMostStep = 8, kMostScatter = 4;
/** Whether the fixes scatter as the source claims, within a factor of two. Others have no vote. */
[[nodiscard]] inline bool scattersAsClaimed(const SourceRecord& record) {
  return record.scatter <= kMostScatter;
}

/** The car's own motion as one more witness: dead reckoning that follows the estimate only slowly. */
struct MotionWitness {
  Eigen::Vector3d offset =
      Eigen::Vector3d::Zero();  ///< dead reckoning less estimate: x, y [m], direction [rad]
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();
};

/** Enters a fix; after a silence of more than fresh_s the record begins anew, but that a source which had left is still
 * to agree for return_s, and one that leapt has still leapt.
 * \param predicted  the estimate at the time of the fix */
void record(SourceRecord& known, double stamp_s, const CarState& predicted, const PoseFix& fix,
            const ReliabilityOptions& options);
/** As if the source had been silent for ever. */
[[nodiscard]] SourceRecord firstRecord(double stamp_s, const CarState& predicted, const PoseFix& fix);

/** Position innovation d' S^-1 d with S = H P H' + R, at most 1e6: beyond, a fix says no more than that it is off. */
[[nodiscard]] double positionNis(const CarState& predicted, const PoseFix& fix);

/** How far two mean residuals are apart, in sigmas of what their claims and separation_m allow: they agree up to
 * separation_sigmas. Anisotropic: a match that knows nothing along a straight is held to what it says across it. */
[[nodiscard]] double separation(const Eigen::Vector2d& apart_m, const Eigen::Matrix2d& cov_m2,
                                const ReliabilityOptions& options);

/** Solution separation: marks the sources that leave the others, and takes back those that returned. The largest set
 * wins that agrees with each other, of the fresh sources that scatter as they claim and the car's own motion; of equally
 * large ones that with the motion, then the first. A source that disagrees with at least two of it has left, and is back
 * once it has agreed with all of it for return_s. Which of two sources is right is hence told by the motion, or not at
 * all. Where there are others, one with which nobody agrees is marked as not supported.
 *
 * Sooner than that, a source has left that two others outvote: their mean residuals are as near to each other as their claims
 * let expect (confirm_false_alarm), and its own is not, to any of the others. Else the estimate would go along with one that
 * creeps away, until it is the others that contradict the estimate. A vote have those that neither left nor leapt, spoke just
 * now, and have done so without a break for two windows.
 * \param records  by name; at most 16 count */
void holdAgainstEachOther(std::vector<SourceRecord>& records, const MotionWitness& motion, double stamp_s,
                          const ReliabilityOptions& options);

/** How many times too small the covariance of the estimate is: the mean of half the normalised innovation squared of
 * the fresh sources, where at least two that scatter as they claim, and neither left nor leapt, are off the estimate and nearer to
 * each other than half as far. 1 where one of them is not. */
[[nodiscard]] double contradictionByAll(const std::vector<SourceRecord>& records, double stamp_s,
                                        const ReliabilityOptions& options);

}  // namespace raceloc
