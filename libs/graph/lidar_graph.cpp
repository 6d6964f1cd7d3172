#include "graph/lidar_graph.h"

#include <cmath>
#include <stdexcept>
#include <utility>

#include "graph/optimise.h"

namespace raceloc {

void GraphOptions::describe(OptionList& keys) {
  keys.add("odometry_sigma_m", odometry_sigma_m, above(0),
           "LiDAR odometry is no better than this per key pose [m]");
  keys.add("odometry_sigma_deg", odometry_sigma_deg, above(0), "nor than this [deg]");
  keys.add("gps_min_sigma_m", gps_min_sigma_m, above(0),
           "no fix is believed to be better than this per axis [m]");
  keys.add("gps_robust_width", gps_robust_width, above(0), "width of the Cauchy loss on fixes, in sigmas");
  keys.add("attitude_min_sigma_deg", attitude_min_sigma_deg, above(0),
           "no INS is believed to be better than this [deg]");
  keys.add("level_sigma_deg", level_sigma_deg, above(0),
           "roll and pitch where no INS gives them: zero within this [deg]");
  keys.add("max_iterations", max_iterations, between(1, 10000), "steps of the solver at most");
}

namespace {

Matrix6d flooredOdometry(const Matrix6d& covariance, const GraphOptions& o) {
  Matrix6d floored = covariance;
  floored.diagonal().head<3>().array() += std::pow(o.odometry_sigma_deg * kDegree, 2);
  floored.diagonal().tail<3>().array() += std::pow(o.odometry_sigma_m, 2);
  return floored;
}

Eigen::Matrix3d floored(const Eigen::Matrix3d& covariance, double sigma) {
  return covariance + sigma * sigma * Eigen::Matrix3d::Identity();
}

}  // namespace

Pose alignLevel(const std::vector<Eigen::Vector3d>& from, const std::vector<Eigen::Vector3d>& to) {
  Eigen::Vector3d from_mean = Eigen::Vector3d::Zero(), to_mean = Eigen::Vector3d::Zero();
  const auto n = static_cast<double>(from.size());
  for (std::size_t i = 0; i < from.size(); ++i) {
    from_mean += from[i] / n;
    to_mean += to[i] / n;
  }
  double sine = 0, cosine = 0;
  for (std::size_t i = 0; i < from.size(); ++i) {
    const Eigen::Vector3d a = from[i] - from_mean, b = to[i] - to_mean;
    cosine += a.x() * b.x() + a.y() * b.y();
    sine += a.x() * b.y() - a.y() * b.x();
  }
  Pose T = poseFromRpy(Eigen::Vector3d::Zero(), 0, 0, std::atan2(sine, cosine));
  T.translation() = to_mean - T.linear() * from_mean;
  return T;
}

GraphSolution solveLidarGraph(const std::vector<Keyframe>& keyframes, const GraphOptions& o) {
  if (keyframes.size() < 2) throw std::invalid_argument("solveLidarGraph: needs at least 2 key poses");

  std::vector<Eigen::Vector3d> odom_m, map_m;
  for (const auto& k : keyframes)
    if (k.gps) {
      odom_m.push_back(k.T_odom_body * k.gps->p_body_antenna_m);
      map_m.push_back(k.gps->p_map_antenna_m);
    }
  const Pose T_map_odom = odom_m.empty() ? Pose::Identity() : alignLevel(odom_m, map_m);

  PoseGraph graph;
  for (std::size_t i = 0; i < keyframes.size(); ++i) {
    const Keyframe& k = keyframes[i];
    graph.T_map_body.push_back(T_map_odom * k.T_odom_body);
    if (i > 0)
      graph.factors.emplace_back(BetweenFactor{
          i - 1, i, k.since_last.T_start_end, whiteningOf(flooredOdometry(k.since_last.covariance, o)), {}});
    if (k.gps)
      graph.factors.emplace_back(PositionFactor{i,
                                                k.gps->p_map_antenna_m,
                                                k.gps->p_body_antenna_m,
                                                whiteningOf(floored(k.gps->cov_map_m2, o.gps_min_sigma_m)),
                                                {RobustLoss::Kind::cauchy, o.gps_robust_width}});
    if (k.attitude)
      graph.factors.emplace_back(AttitudeFactor{
          i,
          k.attitude->R_map_body,
          whiteningOf(floored(k.attitude->covariance_rad2, o.attitude_min_sigma_deg * kDegree)),
          {}});
    else
      graph.factors.emplace_back(LevelFactor{i, o.level_sigma_deg * kDegree, {}});
  }
  if (odom_m.empty()) graph.held = 0;
  OptimiseOptions solver;
  solver.max_iterations = o.max_iterations;
  const OptimiseResult result = optimise(graph, solver);

  GraphSolution solution{
      std::move(graph.T_map_body), result.initial_cost, result.final_cost, 0, 0, result.converged};
  double squared_m2 = 0;
  for (std::size_t i = 0; i < keyframes.size(); ++i) {
    if (const auto& gps = keyframes[i].gps) {
      squared_m2 += (solution.T_map_body[i] * gps->p_body_antenna_m - gps->p_map_antenna_m).squaredNorm();
      ++solution.gps_factors;
    }
  }
  if (solution.gps_factors > 0)
    solution.gps_rmse_m = std::sqrt(squared_m2 / static_cast<double>(solution.gps_factors));
  return solution;
}

}  // namespace raceloc
