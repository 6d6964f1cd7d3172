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

std::vector<double> distancesOf(const Pose& T_to_from, const std::vector<Eigen::Vector3d>& from,
                                const std::vector<Eigen::Vector3d>& to) {
  std::vector<double> distances_m(from.size());
  for (std::size_t i = 0; i < from.size(); ++i) distances_m[i] = (T_to_from * from[i] - to[i]).norm();
  return distances_m;
}

/** The alignment of all pairs or of a stretch of them, whichever leaves the least median distance: where a stretch of
 * partners is wrong all the same way, least squares over all pairs turn towards it, and weights do not turn back. */
Pose leastMedianStart(const std::vector<Eigen::Vector3d>& from, const std::vector<Eigen::Vector3d>& to,
                      const Eigen::Vector3d& up_from, const Eigen::Vector3d& up_to, double width_m) {
  const std::size_t n = from.size();
  std::vector<double> weights(n, 1);
  Pose best = weightedAlignment(from, to, weights, up_from, up_to, width_m);
  double least_m = quantile(distancesOf(best, from, to), 0.5);
  constexpr std::size_t kStretches = 10, kPairs = 3;
  for (std::size_t k = 0; k < kStretches && n >= kStretches * kPairs; ++k) {
    for (std::size_t i = 0; i < n; ++i) weights[i] = i * kStretches / n == k ? 1 : 0;
    const Pose T = weightedAlignment(from, to, weights, up_from, up_to, width_m);
    const double median_m = quantile(distancesOf(T, from, to), 0.5);
    if (median_m >= least_m) continue;
    least_m = median_m;
    best = T;
  }
  return best;
}

}  // namespace

std::vector<Eigen::Vector3d> positionsOf(const std::vector<Pose>& poses) {
  std::vector<Eigen::Vector3d> positions;
  positions.reserve(poses.size());
  for (const Pose& T : poses) positions.emplace_back(T.translation());
  return positions;
}

GraphAlignment alignGraphs(const std::vector<Eigen::Vector3d>& from, const std::vector<Eigen::Vector3d>& to,
                           const Eigen::Vector3d& up_from, const Eigen::Vector3d& up_to, double width_m) {
  if (from.size() != to.size() || from.size() < 2)
    throw std::invalid_argument("alignGraphs: needs 2 or more pairs");
  GraphAlignment result{leastMedianStart(from, to, up_from, up_to, width_m), 0, 0};
  std::vector<double> weights(from.size()), distances_m = distancesOf(result.T_to_from, from, to);
  constexpr int kMaxRounds = 100;
  for (int round = 0; round < kMaxRounds; ++round) {
    const double width = std::max(width_m, 2 * quantile(distances_m, 0.5));
    for (std::size_t i = 0; i < from.size(); ++i)
      weights[i] = std::pow(1 / (1 + std::pow(distances_m[i] / width, 2)), 2);
    const Pose before = result.T_to_from;
    result.T_to_from = weightedAlignment(from, to, weights, up_from, up_to, width_m);
    distances_m = distancesOf(result.T_to_from, from, to);
    if ((before.inverse() * result.T_to_from).isApprox(Pose::Identity(), 1e-9)) break;
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
