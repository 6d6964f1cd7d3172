#include "graph/map_graphs.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <utility>

#include "graph/graph_alignment.h"

namespace raceloc {

void GraphOptions::describe(OptionList& keys) {
  keys.add("odometry_sigma_m", odometry_sigma_m, above(0),
           "odometry is no better than this per key pose [m]");
  keys.add("odometry_sigma_deg", odometry_sigma_deg, above(0), "nor than this [deg]");
  keys.add("gps_min_sigma_m", gps_min_sigma_m, above(0),
           "no fix is believed to be better than this per axis [m]");
  keys.add("gps_robust_width", gps_robust_width, above(0),
           "width of the Cauchy loss on fixes and attitudes, in sigmas");
  keys.add("gps_refuse_sigma", gps_refuse_sigma, above(1), "fixes farther off are refused, in sigmas");
  keys.add("gps_poor_sigma_m", gps_poor_sigma_m, above(0), "fixes that claim more are listed as poor [m]");
  keys.add("gps_span_gap_s", gps_span_gap_s, atLeast(0),
           "bad fixes of a receiver less far apart are one span, and so is what lies between [s]");
  keys.add("gps_chain_share", gps_chain_share, above(0),
           "what LiDAR odometry may miss between two fixes, as a share of the way");
  keys.add("gps_chain_reach_s", gps_chain_reach_s, above(0),
           "a receiver that is off for longer is believed to be right again [s]");
  keys.add("attitude_min_sigma_deg", attitude_min_sigma_deg, above(0),
           "no INS is believed to be better than this [deg]");
  keys.add("level_sigma_deg", level_sigma_deg, above(0),
           "roll and pitch where neither INS nor accelerometer gives them: zero within this [deg]");
  keys.add("max_iterations", max_iterations, between(1, 10000), "steps of the solver at most");
}

namespace {

Eigen::Matrix3d floored(const Eigen::Matrix3d& covariance, double sigma) {
  return covariance + sigma * sigma * Eigen::Matrix3d::Identity();
}

constexpr RobustLoss kOnLoops{RobustLoss::Kind::cauchy, 3};

void addLevel(PoseGraph& graph, std::size_t i, const Keyframe& k, const GraphOptions& o) {
  if (k.level)
    graph.factors.emplace_back(LevelFactor{i, k.level->up_body, k.level->sigma_rad, {}});
  else
    graph.factors.emplace_back(LevelFactor{i, Eigen::Vector3d::UnitZ(), o.level_sigma_deg * kDegree, {}});
}

void addGps(PoseGraph& graph, std::size_t i, const Keyframe& k, double width, const GraphOptions& o) {
  for (const KeyGps& gps : k.gps)
    if (!gps.refused)
      graph.factors.emplace_back(PositionFactor{i,
                                                gps.p_map_antenna_m,
                                                gps.p_body_antenna_m,
                                                whiteningOf(flooredFix(gps.cov_map_m2, o)),
                                                {RobustLoss::Kind::cauchy, width}});
  for (const KeyAttitude& attitude : k.attitudes)
    graph.factors.emplace_back(
        AttitudeFactor{i,
                       attitude.R_map_body,
                       whiteningOf(floored(attitude.covariance_rad2, o.attitude_min_sigma_deg * kDegree)),
                       {RobustLoss::Kind::cauchy, width}});
  if (k.attitudes.empty()) addLevel(graph, i, k, o);
}

std::size_t endOfDrive(const std::vector<Keyframe>& keyframes, std::size_t begin) {
  std::size_t end = begin + 1;
  while (end < keyframes.size() && !beginsDrive(keyframes[end])) ++end;
  return end;
}

bool believesFixes(const std::vector<Keyframe>& keyframes, std::size_t begin, std::size_t end) {
  for (std::size_t i = begin; i < end; ++i)
    for (const KeyGps& gps : keyframes[i].gps)
      if (!gps.refused) return true;
  return false;
}

PoseGraph graphOf(GraphKind kind, const std::vector<Keyframe>& keyframes, std::vector<Pose> T_start,
                  double gps_width, const GraphOptions& o) {
  PoseGraph graph;
  graph.T_map_body = std::move(T_start);
  const bool has_gps = kind != GraphKind::lidar && believesFixes(keyframes, 0, keyframes.size());
  if (kind != GraphKind::lidar && !has_gps) graph.held = 0;
  for (std::size_t i = 0; i < keyframes.size(); ++i) {
    const Keyframe& k = keyframes[i];
    if (!beginsDrive(k)) {
      const BodyMotion& motion = kind == GraphKind::gps && k.reckoned ? *k.reckoned : k.since_last;
      graph.factors.emplace_back(BetweenFactor{
          i - 1, i, motion.T_start_end, whiteningOf(flooredOdometry(motion.covariance, o)), {}});
    } else if (kind == GraphKind::lidar || !believesFixes(keyframes, i, endOfDrive(keyframes, i))) {
      Vector6d sigma;
      sigma << Eigen::Vector3d::Constant(30 * kDegree), Eigen::Vector3d::Constant(100);
      graph.factors.emplace_back(
          PriorFactor{i, graph.T_map_body[i], sigma.cwiseInverse().asDiagonal().toDenseMatrix(), {}});
    }
    if (kind == GraphKind::lidar)
      addLevel(graph, i, k, o);
    else
      addGps(graph, i, k, gps_width, o);
  }
  return graph;
}

}  // namespace

PoseGraph graphWithoutLoops(GraphKind kind, const std::vector<Keyframe>& keyframes,
                            std::vector<Pose> T_map_body, const GraphOptions& o) {
  return graphOf(kind, keyframes, std::move(T_map_body), o.gps_robust_width, o);
}

Factor loopFactor(const LoopEdge& loop) {
  return BetweenFactor{loop.i, loop.j, loop.T_i_j, whiteningOf(loop.covariance), kOnLoops};
}

Matrix6d flooredOdometry(const Matrix6d& covariance, const GraphOptions& o) {
  Matrix6d floored = covariance;
  floored.diagonal().head<3>().array() += std::pow(o.odometry_sigma_deg * kDegree, 2);
  floored.diagonal().tail<3>().array() += std::pow(o.odometry_sigma_m, 2);
  return floored;
}

Eigen::Matrix3d flooredFix(const Eigen::Matrix3d& covariance, const GraphOptions& o) {
  return floored(covariance, o.gps_min_sigma_m);
}

std::vector<Pose> alignedOdometry(const std::vector<Keyframe>& keyframes) {
  std::vector<Pose> T_map_body;
  for (std::size_t begin = 0; begin < keyframes.size();) {
    const std::size_t end = endOfDrive(keyframes, begin);
    std::vector<Eigen::Vector3d> odom_m, map_m;
    Eigen::Vector3d up_odom = Eigen::Vector3d::Zero();
    for (std::size_t i = begin; i < end; ++i) {
      const Keyframe& k = keyframes[i];
      for (const KeyGps& gps : k.gps) {
        odom_m.push_back(k.T_odom_body * gps.p_body_antenna_m);
        map_m.push_back(gps.p_map_antenna_m);
      }
      for (const KeyAttitude& attitude : k.attitudes)
        up_odom += k.T_odom_body.linear() * attitude.R_map_body.row(2).transpose();
      if (k.attitudes.empty() && k.level) up_odom += k.T_odom_body.linear() * k.level->up_body;
    }
    if (up_odom.isZero()) up_odom = Eigen::Vector3d::UnitZ();
    const Pose T_map_odom =
        odom_m.size() < 2 ? Pose::Identity() : alignGraphs(odom_m, map_m, up_odom.normalized()).T_to_from;
    for (; begin < end; ++begin) T_map_body.push_back(T_map_odom * keyframes[begin].T_odom_body);
  }
  return T_map_body;
}

GraphSolution solveGraph(GraphKind kind, const std::vector<Keyframe>& keyframes,
                         const std::vector<LoopEdge>& loops, std::vector<Pose> T_start,
                         const GraphOptions& o) {
  if (keyframes.size() < 2 || T_start.size() != keyframes.size())
    throw std::invalid_argument("solveGraph: needs 2 or more key poses, and a start for each");
  OptimiseOptions solver;
  solver.max_iterations = o.max_iterations;
  GraphSolution solution{std::move(T_start), 0, true};
  for (const double wider : {64.0, 8.0, 1.0}) {
    PoseGraph graph = graphOf(kind, keyframes, std::move(solution.T_map_body), wider * o.gps_robust_width, o);
    if (kind != GraphKind::gps)
      for (const LoopEdge& loop : loops) graph.factors.push_back(loopFactor(loop));
    const OptimiseResult result = optimise(graph, solver);
    solution = {std::move(graph.T_map_body), result.final_cost, result.converged};
  }
  return solution;
}

double gpsRmse(const std::vector<Keyframe>& keyframes, const std::vector<Pose>& T_map_body) {
  double squared_m2 = 0;
  std::size_t fixes = 0;
  for (std::size_t i = 0; i < keyframes.size(); ++i)
    for (const KeyGps& gps : keyframes[i].gps) {
      if (gps.refused) continue;
      squared_m2 += (T_map_body[i] * gps.p_body_antenna_m - gps.p_map_antenna_m).squaredNorm();
      ++fixes;
    }
  return fixes > 0 ? std::sqrt(squared_m2 / static_cast<double>(fixes)) : 0;
}

}  // namespace raceloc
