#include "eval/relative_errors.h"

#include <cmath>
#include <cstdio>
#include <utility>

namespace raceloc {

namespace {

/** The motion from one pose to another, as the estimate has it and seen from the truth. */
Pose motionError(const PoseError& from, const PoseError& to) {
  const Pose T_from_to_truth = from.T_map_truth.inverse() * to.T_map_truth;
  const Pose T_from_to_estimate = from.T_map_estimate.inverse() * to.T_map_estimate;
  return T_from_to_truth.inverse() * T_from_to_estimate;
}

double angle_deg(const Pose& T) { return Eigen::AngleAxisd(T.linear()).angle() / kDegree; }

}  // namespace

RelativeError relativeError(const std::vector<PoseError>& poses, double length_m) {
  RelativeError sum{length_m, 0, 0, 0};
  std::size_t j = 0;
  for (std::size_t i = 0; i < poses.size(); ++i) {
    while (j < poses.size() && poses[j].station_m < poses[i].station_m + length_m) ++j;
    if (j == poses.size()) break;
    const Pose error = motionError(poses[i], poses[j]).inverse();
    const double own_length_m = poses[j].station_m - poses[i].station_m;
    sum.translation_percent += 100 * error.translation().norm() / own_length_m;
    sum.rotation_deg_per_m += angle_deg(error) / own_length_m;
    ++sum.segments;
  }
  if (sum.segments > 0) {
    sum.translation_percent /= static_cast<double>(sum.segments);
    sum.rotation_deg_per_m /= static_cast<double>(sum.segments);
  }
  return sum;
}

std::string text(const RpeStep& step) {
  char words[32];
  std::snprintf(words, sizeof words, "%g %s", step.length, step.unit == RpeStep::Unit::seconds ? "s" : "m");
  return words;
}

RelativePoseError relativePoseError(const std::vector<PoseError>& poses, const RpeStep& step) {
  std::vector<double> translations_m, rotations_deg;
  const auto isOneStep = [&](const PoseError& from, const PoseError& to) {
    return step.unit == RpeStep::Unit::seconds ? to.stamp_s - from.stamp_s >= step.length - kStampResolution_s
                                               : to.station_m - from.station_m >= step.length;
  };
  for (std::size_t i = 0, j = 1; j < poses.size(); ++j) {
    if (!isOneStep(poses[i], poses[j])) continue;
    const Pose error = motionError(poses[i], poses[j]);
    translations_m.push_back(error.translation().norm());
    rotations_deg.push_back(angle_deg(error));
    i = j;
  }
  RelativePoseError rpe{step, translations_m.size(), {}, {}};
  if (rpe.pairs == 0) return rpe;
  rpe.translation_m = statisticsOf(std::move(translations_m));
  rpe.rotation_deg = statisticsOf(std::move(rotations_deg));
  return rpe;
}

}  // namespace raceloc
