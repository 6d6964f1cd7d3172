#include "graph/graph_alignment.h"

#include <Eigen/SVD>
#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "core/statistics.h"

namespace raceloc {

namespace {

Pose weightedAlignment(const std::vector<Eigen::Vector3d>& from, const std::vector<Eigen::Vector3d>& to,
                       const std::vector<double>& weights, const Eigen::Vector3d& up_from,
                       const Eigen::Vector3d& up_to, double width_m) {
  double sum = 0;
  Eigen::Vector3d from_mean = Eigen::Vector3d::Zero(), to_mean = Eigen::Vector3d::Zero();
  for (std::size_t i = 0; i < from.size(); ++i) {
    sum += weights[i];
    from_mean += weights[i] * from[i];
    to_mean += weights[i] * to[i];
  }
  from_mean /= sum;
  to_mean /= sum;
  constexpr double kUpSigma_rad = kDegree;
  Eigen::Matrix3d H = std::pow(width_m / kUpSigma_rad, 2) * up_from * up_to.transpose();
  for (std::size_t i = 0; i < from.size(); ++i)
    H += weights[i] * (from[i] - from_mean) * (to[i] - to_mean).transpose();
  const Eigen::JacobiSVD<Eigen::Matrix3d> svd(H, Eigen::ComputeFullU | Eigen::ComputeFullV);
  Eigen::Matrix3d mirror = Eigen::Matrix3d::Identity();
  mirror(2, 2) = (svd.matrixV() * svd.matrixU().transpose()).determinant() < 0 ? -1 : 1;
  Pose T = Pose::Identity();
  T.linear() = svd.matrixV() * mirror * svd.matrixU().transpose();
  T.translation() = to_mean - T.linear() * from_mean;
  return T;
}

}  // namespace

GraphAlignment alignGraphs(const std::vector<Eigen::Vector3d>& from, const std::vector<Eigen::Vector3d>& to,
                           const Eigen::Vector3d& up_from, const Eigen::Vector3d& up_to, double width_m) {
  if (from.size() != to.size() || from.size() < 2)
    throw std::invalid_argument("alignGraphs: needs 2 or more pairs");
  std::vector<double> weights(from.size(), 1), distances_m(from.size());
  GraphAlignment result{Pose::Identity(), 0, 0};
  constexpr int kMaxRounds = 100;
  for (int round = 0; round < kMaxRounds; ++round) {
    const Pose before = result.T_to_from;
    result.T_to_from = weightedAlignment(from, to, weights, up_from, up_to, width_m);
    for (std::size_t i = 0; i < from.size(); ++i)
      distances_m[i] = (result.T_to_from * from[i] - to[i]).norm();
    const double width = std::max(width_m, 2 * quantile(distances_m, 0.5));
    for (std::size_t i = 0; i < from.size(); ++i)
      weights[i] = std::pow(1 / (1 + std::pow(distances_m[i] / width, 2)), 2);
    if (round > 0 && (before.inverse() * result.T_to_from).isApprox(Pose::Identity(), 1e-9)) break;
  }
  double squared_m2 = 0;
  std::size_t inliers = 0;
  for (std::size_t i = 0; i < from.size(); ++i) {
    if (weights[i] < 0.5) continue;
    ++inliers;
    squared_m2 += distances_m[i] * distances_m[i];
  }
  if (inliers > 0) result.rmse_m = std::sqrt(squared_m2 / static_cast<double>(inliers));
  result.inlier_share = static_cast<double>(inliers) / static_cast<double>(from.size());
  return result;
}

}  // namespace raceloc
