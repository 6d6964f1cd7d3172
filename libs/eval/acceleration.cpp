#include "eval/acceleration.h"

#include <Eigen/Cholesky>
#include <cmath>

namespace raceloc {

namespace {

constexpr double kHalfWindow_s = 0.3;
constexpr std::size_t kMinPoses = 5;

}  // namespace

std::vector<Acceleration> accelerations(const std::vector<PoseError>& poses) {
  std::vector<Acceleration> result;
  std::size_t first = 0, end = 0;
  for (const PoseError& pose : poses) {
    while (poses[first].stamp_s < pose.stamp_s - kHalfWindow_s) ++first;
    while (end < poses.size() && poses[end].stamp_s <= pose.stamp_s + kHalfWindow_s) ++end;
    const double before_s = pose.stamp_s - poses[first].stamp_s,
                 after_s = poses[end - 1].stamp_s - pose.stamp_s;
    if (end - first < kMinPoses || std::min(before_s, after_s) < kHalfWindow_s / 2) continue;

    Eigen::Matrix3d A = Eigen::Matrix3d::Zero();
    Eigen::Matrix<double, 3, 2> b = Eigen::Matrix<double, 3, 2>::Zero();
    for (std::size_t i = first; i < end; ++i) {
      const double t_s = poses[i].stamp_s - pose.stamp_s;
      const Eigen::Vector3d powers(1, t_s, t_s * t_s);
      const Eigen::Vector2d way_m =
          (poses[i].T_map_truth.translation() - pose.T_map_truth.translation()).head<2>();
      A += powers * powers.transpose();
      b += powers * way_m.transpose();
    }
    const Eigen::Vector2d a_map_mps2 = 2 * A.ldlt().solve(b).row(2).transpose();
    const Eigen::Vector2d a_body_mps2 = Eigen::Rotation2Dd(-yawOf(pose.T_map_truth)) * a_map_mps2;
    result.push_back({a_body_mps2.x(), a_body_mps2.y()});
  }
  return result;
}

}  // namespace raceloc
