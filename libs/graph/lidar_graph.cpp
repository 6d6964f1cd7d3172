#include "graph/lidar_graph.h"

#include <ceres/ceres.h>

#include <Eigen/Cholesky>
#include <cmath>
#include <stdexcept>

#include "graph/factors.h"

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

/** W with W' W = C^-1. */
template <int N>
Eigen::Matrix<double, N, N> whiteningOf(const Eigen::Matrix<double, N, N>& covariance) {
  const Eigen::Matrix<double, N, N> information = covariance.inverse();
  return information.llt().matrixU();
}

struct PoseBlocks {
  Eigen::Quaterniond q;
  Eigen::Vector3d p;
};

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

  std::vector<PoseBlocks> poses;
  poses.reserve(keyframes.size());
  for (const auto& k : keyframes) {
    const Pose T = T_map_odom * k.T_odom_body;
    poses.push_back({Eigen::Quaterniond(T.linear()), T.translation()});
  }

  ceres::Problem problem;
  for (auto& pose : poses) {
    problem.AddParameterBlock(pose.q.coeffs().data(), 4, new ceres::EigenQuaternionManifold);
    problem.AddParameterBlock(pose.p.data(), 3);
  }
  const double odometry_rad2 = std::pow(o.odometry_sigma_deg * M_PI / 180, 2);
  const double attitude_rad2 = std::pow(o.attitude_min_sigma_deg * M_PI / 180, 2);
  const double odometry_m2 = std::pow(o.odometry_sigma_m, 2);
  for (std::size_t i = 0; i < keyframes.size(); ++i) {
    const Keyframe& k = keyframes[i];
    double* q = poses[i].q.coeffs().data();
    double* p = poses[i].p.data();
    if (i > 0) {
      Matrix6d covariance = k.since_last.covariance;
      covariance.diagonal().head<3>().array() += odometry_rad2;
      covariance.diagonal().tail<3>().array() += odometry_m2;
      problem.AddResidualBlock(new ceres::AutoDiffCostFunction<BetweenFactor, 6, 4, 3, 4, 3>(
                                   new BetweenFactor{k.since_last.T_start_end, whiteningOf<6>(covariance)}),
                               nullptr, poses[i - 1].q.coeffs().data(), poses[i - 1].p.data(), q, p);
    }
    if (k.gps) {
      const Eigen::Matrix3d covariance =
          k.gps->cov_map_m2 + std::pow(o.gps_min_sigma_m, 2) * Eigen::Matrix3d::Identity();
      problem.AddResidualBlock(
          new ceres::AutoDiffCostFunction<GpsFactor, 3, 4, 3>(
              new GpsFactor{k.gps->p_map_antenna_m, k.gps->p_body_antenna_m, whiteningOf<3>(covariance)}),
          new ceres::CauchyLoss(o.gps_robust_width), q, p);
    }
    if (k.attitude)
      problem.AddResidualBlock(
          new ceres::AutoDiffCostFunction<AttitudeFactor, 3, 4>(new AttitudeFactor{
              Eigen::Quaterniond(k.attitude->R_map_body),
              whiteningOf<3>(k.attitude->covariance_rad2 + attitude_rad2 * Eigen::Matrix3d::Identity())}),
          nullptr, q);
    else
      problem.AddResidualBlock(
          new ceres::AutoDiffCostFunction<LevelFactor, 2, 4>(new LevelFactor{o.level_sigma_deg * M_PI / 180}),
          nullptr, q);
  }
  if (odom_m.empty()) {
    problem.SetParameterBlockConstant(poses[0].q.coeffs().data());
    problem.SetParameterBlockConstant(poses[0].p.data());
  }

  ceres::Solver::Options solver;
  solver.linear_solver_type = ceres::SPARSE_NORMAL_CHOLESKY;
  solver.sparse_linear_algebra_library_type = ceres::SUITE_SPARSE;
  solver.max_num_iterations = o.max_iterations;
  solver.function_tolerance = 1e-10;
  solver.num_threads = 1;  // the same bits every time
  solver.logging_type = ceres::SILENT;
  ceres::Solver::Summary summary;
  ceres::Solve(solver, &problem, &summary);
  if (!summary.IsSolutionUsable()) throw std::runtime_error("pose graph: " + summary.message);

  GraphSolution solution{
      {}, summary.initial_cost, summary.final_cost, 0, 0, summary.termination_type == ceres::CONVERGENCE};
  double squared_m2 = 0;
  for (std::size_t i = 0; i < keyframes.size(); ++i) {
    Pose T = Pose::Identity();
    T.linear() = poses[i].q.normalized().toRotationMatrix();
    T.translation() = poses[i].p;
    solution.T_map_body.push_back(T);
    if (const auto& gps = keyframes[i].gps) {
      squared_m2 += (T * gps->p_body_antenna_m - gps->p_map_antenna_m).squaredNorm();
      ++solution.gps_factors;
    }
  }
  if (solution.gps_factors > 0)
    solution.gps_rmse_m = std::sqrt(squared_m2 / static_cast<double>(solution.gps_factors));
  return solution;
}

}  // namespace raceloc
