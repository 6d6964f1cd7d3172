#include "eval/frame_checks.h"

#include <cmath>

#include "eval/format.h"

namespace raceloc {

namespace {

/** Mean of angles, if they agree to about 15 deg. */
std::optional<double> commonAngle_deg(const std::vector<double>& angles_deg) {
  if (angles_deg.empty()) return std::nullopt;
  Eigen::Vector2d sum(0, 0);
  for (const double a : angles_deg) sum += Eigen::Vector2d(std::cos(a * kDegree), std::sin(a * kDegree));
  if (sum.norm() < 0.97 * static_cast<double>(angles_deg.size())) return std::nullopt;
  return std::atan2(sum.y(), sum.x()) / kDegree;
}

bool isQuarterTurn(double angle_deg) {
  return std::abs(angle_deg) > 45 && std::abs(std::remainder(angle_deg, 90)) < 10;
}

}  // namespace

std::vector<std::string> frameMismatches(const std::vector<PoseError>& poses) {
  std::vector<std::string> mismatches;
  const auto n = static_cast<double>(poses.size());
  Eigen::Vector3d offset_m = Eigen::Vector3d::Zero();
  for (const auto& p : poses) offset_m += (p.T_map_estimate.translation() - p.T_map_truth.translation()) / n;
  double scatter_m2 = 0;
  for (const auto& p : poses)
    scatter_m2 += (p.T_map_estimate.translation() - p.T_map_truth.translation() - offset_m).squaredNorm() / n;
  if (offset_m.norm() >= 1000 && std::sqrt(scatter_m2) < 0.1 * offset_m.norm())
    mismatches.push_back(
        format("a constant offset of %.3f km (x %.0f m, y %.0f m): ", offset_m.norm() / 1000, offset_m.x(),
               offset_m.y()) +
        "the two files are hardly in one map frame (other origin, or UTM against local metres?)");

  std::vector<double> headings_deg;
  headings_deg.reserve(poses.size());
  for (const auto& p : poses) headings_deg.push_back(p.heading_deg);
  if (const auto turn_deg = commonAngle_deg(headings_deg); turn_deg && isQuarterTurn(*turn_deg))
    mismatches.push_back(
        format("the headings differ by a constant %.0f deg: ", *turn_deg) +
        "the axes of the two files are hardly the same (map: x east, y north; body: x forward, y left)");
  return mismatches;
}

std::optional<std::string> sidewaysTruth(const std::vector<PoseError>& poses) {
  std::vector<double> drifts_deg;
  bool moved = false;
  for (std::size_t i = 1; i < poses.size(); ++i) {
    const Eigen::Vector3d step_m =
        poses[i].T_map_truth.translation() - poses[i - 1].T_map_truth.translation();
    if (poses[i].speed_mps < 2 || step_m.head<2>().norm() < 0.1) continue;
    moved = true;
    drifts_deg.push_back(wrapAngle(std::atan2(step_m.y(), step_m.x()) - yawOf(poses[i - 1].T_map_truth)) /
                         kDegree);
  }
  const auto drift_deg = commonAngle_deg(drifts_deg);
  if (moved && (!drift_deg || std::abs(*drift_deg) > 30))
    return "the truth's heading is " +
           (drift_deg ? format("%.0f deg off its path", *drift_deg) : "not along its path") +
           ": lateral, longitudinal and heading errors mean little (attitude missing, or a camera's axes?)";
  return std::nullopt;
}

}  // namespace raceloc
