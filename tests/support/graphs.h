/** \file
 * Pose graphs for tests: random ones with loops, and the same graph in the hands of Ceres. */
#pragma once

#include <ceres/ceres.h>
#include <ceres/rotation.h>

#include <stdexcept>

#include "graph/pose_graph.h"
#include "support/forall.h"

namespace raceloc::test {

/** Steps of about 2 m with turns, each measured with noise; loops between poses at random; the first pose known.
 * The estimate starts where the steps add up to. */
inline PoseGraph randomGraph(Random& rnd, int poses, int loops, const RobustLoss& loop_loss = {}) {
  const double sigma_rad = 0.01, sigma_m = 0.05;
  Matrix6d covariance = Matrix6d::Identity() * sigma_rad * sigma_rad;
  covariance.bottomRightCorner<3, 3>() = sigma_m * sigma_m * Eigen::Matrix3d::Identity();
  const Matrix6d W = whiteningOf(covariance);
  const auto noisy = [&](const Pose& T) {
    Vector6d noise;
    for (int k = 0; k < 6; ++k) noise(k) = rnd.normal(k < 3 ? sigma_rad : sigma_m);
    return Pose(T * se3Exp(noise));
  };
  std::vector<Pose> truth{rnd.pose(1, 50)};
  PoseGraph graph;
  graph.T_map_body = truth;
  graph.factors.emplace_back(PriorFactor{0, truth[0], 10 * W, {}});
  for (std::size_t i = 1; i < static_cast<std::size_t>(poses); ++i) {
    truth.push_back(truth.back() * poseFromRpy({2, 0, rnd.normal(0.1)}, rnd.normal(0.05), rnd.normal(0.05),
                                               0.1 + rnd.normal(0.1)));
    const Pose T = noisy(truth[i - 1].inverse() * truth[i]);
    graph.T_map_body.push_back(graph.T_map_body.back() * T);
    graph.factors.emplace_back(BetweenFactor{i - 1, i, T, W, {}});
  }
  for (int k = 0; k < loops; ++k) {
    const auto i = static_cast<std::size_t>(rnd.integer(0, poses - 3));
    const auto j = static_cast<std::size_t>(rnd.integer(static_cast<int>(i) + 2, poses - 1));
    const bool backwards = rnd.oneOf({true, false});
    const std::size_t a = backwards ? j : i, b = backwards ? i : j;
    graph.factors.emplace_back(BetweenFactor{a, b, noisy(truth[a].inverse() * truth[b]), W, loop_loss});
  }
  return graph;
}

/** The residuals again, written for automatic derivatives: nothing shared with the library's. A pose is two
 * blocks, quaternion (Eigen's order x y z w) and translation. */
struct CeresPrior {  // between the identity and the pose
  Pose T;
  Matrix6d W;
  template <class S>
  bool operator()(const S* q, const S* p, S* residual) const {
    const S identity[7] = {S(0), S(0), S(0), S(1), S(0), S(0), S(0)};
    return between(identity, identity + 4, q, p, residual);
  }
  template <class S>
  bool between(const S* q_i, const S* p_i, const S* q_j, const S* p_j, S* residual) const {
    const Eigen::Map<const Eigen::Quaternion<S>> Q_i(q_i), Q_j(q_j);
    const Eigen::Map<const Eigen::Matrix<S, 3, 1>> P_i(p_i), P_j(p_j);
    const Eigen::Quaternion<S> measured(Eigen::Quaterniond(T.linear()).cast<S>());
    const Eigen::Quaternion<S> e = measured.conjugate() * Q_i.conjugate() * Q_j;
    const S wxyz[4] = {e.w(), e.x(), e.y(), e.z()};
    Eigen::Matrix<S, 6, 1> error;
    ceres::QuaternionToAngleAxis(wxyz, error.data());
    error.template tail<3>() =
        measured.conjugate() * (Q_i.conjugate() * (P_j - P_i) - T.translation().cast<S>());
    Eigen::Map<Eigen::Matrix<S, 6, 1>> r(residual);
    r = W.cast<S>() * error;
    return true;
  }
};

struct CeresBetween : CeresPrior {
  template <class S>
  bool operator()(const S* q_i, const S* p_i, const S* q_j, const S* p_j, S* residual) const {
    return between(q_i, p_i, q_j, p_j, residual);
  }
};

struct CeresPosition {
  PositionFactor f;
  template <class S>
  bool operator()(const S* q, const S* p, S* residual) const {
    const Eigen::Map<const Eigen::Quaternion<S>> Q(q);
    const Eigen::Map<const Eigen::Matrix<S, 3, 1>> P(p);
    Eigen::Map<Eigen::Matrix<S, 3, 1>> r(residual);
    r = f.whitening.cast<S>() * (P + Q * f.p_body_antenna_m.cast<S>() - f.z_map_antenna_m.cast<S>());
    return true;
  }
};

struct CeresAttitude {
  AttitudeFactor f;
  template <class S>
  bool operator()(const S* q, S* residual) const {
    const Eigen::Quaternion<S> measured(Eigen::Quaterniond(f.R_map_body).cast<S>());
    const Eigen::Quaternion<S> e = measured.conjugate() * Eigen::Map<const Eigen::Quaternion<S>>(q);
    const S wxyz[4] = {e.w(), e.x(), e.y(), e.z()};
    Eigen::Matrix<S, 3, 1> error;
    ceres::QuaternionToAngleAxis(wxyz, error.data());
    Eigen::Map<Eigen::Matrix<S, 3, 1>> r(residual);
    r = f.whitening.cast<S>() * error;
    return true;
  }
};

struct CeresLevel {
  LevelFactor f;
  template <class S>
  bool operator()(const S* q, S* residual) const {
    const Eigen::Matrix<S, 3, 1> up = Eigen::Map<const Eigen::Quaternion<S>>(q) * f.up_body.cast<S>();
    residual[0] = up.x() / f.sigma_rad;
    residual[1] = up.y() / f.sigma_rad;
    return true;
  }
};

struct CeresBlocks {
  Eigen::Quaterniond q;
  Eigen::Vector3d p;
};

/** A factor as a residual block of `problem`. */
struct AddToCeres {
  ceres::Problem& problem;
  std::vector<CeresBlocks>& at;

  [[nodiscard]] double* q(std::size_t i) const { return at[i].q.coeffs().data(); }
  [[nodiscard]] double* p(std::size_t i) const { return at[i].p.data(); }
  [[nodiscard]] static ceres::LossFunction* loss(const RobustLoss& loss) {
    switch (loss.kind) {
      case RobustLoss::Kind::none:
        return nullptr;
      case RobustLoss::Kind::huber:
        return new ceres::HuberLoss(loss.width);
      case RobustLoss::Kind::cauchy:
        return new ceres::CauchyLoss(loss.width);
    }
    throw std::logic_error("no such loss");
  }

  void operator()(const PriorFactor& f) const {
    problem.AddResidualBlock(
        new ceres::AutoDiffCostFunction<CeresPrior, 6, 4, 3>(new CeresPrior{f.T_map_body, f.whitening}),
        loss(f.loss), q(f.i), p(f.i));
  }
  void operator()(const BetweenFactor& f) const {
    problem.AddResidualBlock(new ceres::AutoDiffCostFunction<CeresBetween, 6, 4, 3, 4, 3>(
                                 new CeresBetween{{f.T_i_j, f.whitening}}),
                             loss(f.loss), q(f.i), p(f.i), q(f.j), p(f.j));
  }
  void operator()(const PositionFactor& f) const {
    problem.AddResidualBlock(new ceres::AutoDiffCostFunction<CeresPosition, 3, 4, 3>(new CeresPosition{f}),
                             loss(f.loss), q(f.i), p(f.i));
  }
  void operator()(const AttitudeFactor& f) const {
    problem.AddResidualBlock(new ceres::AutoDiffCostFunction<CeresAttitude, 3, 4>(new CeresAttitude{f}),
                             loss(f.loss), q(f.i));
  }
  void operator()(const LevelFactor& f) const {
    problem.AddResidualBlock(new ceres::AutoDiffCostFunction<CeresLevel, 2, 4>(new CeresLevel{f}),
                             loss(f.loss), q(f.i));
  }
};

/** Ceres with SuiteSparse on the same graph, from its estimate. \return poses and final cost */
inline std::pair<std::vector<Pose>, double> solvedByCeres(const PoseGraph& graph) {
  std::vector<CeresBlocks> at;
  for (const Pose& T : graph.T_map_body) at.push_back({Eigen::Quaterniond(T.linear()), T.translation()});
  ceres::Problem problem;
  for (auto& pose : at) {
    problem.AddParameterBlock(pose.q.coeffs().data(), 4, new ceres::EigenQuaternionManifold);
    problem.AddParameterBlock(pose.p.data(), 3);
  }
  for (const Factor& factor : graph.factors) std::visit(AddToCeres{problem, at}, factor);
  if (graph.held) {
    problem.SetParameterBlockConstant(at[*graph.held].q.coeffs().data());
    problem.SetParameterBlockConstant(at[*graph.held].p.data());
  }
  ceres::Solver::Options solver;
  solver.linear_solver_type = ceres::SPARSE_NORMAL_CHOLESKY;
  solver.sparse_linear_algebra_library_type = ceres::SUITE_SPARSE;
  solver.max_num_iterations = 200;
  solver.function_tolerance = 1e-15;
  solver.gradient_tolerance = 1e-12;
  solver.parameter_tolerance = 1e-14;
  solver.logging_type = ceres::SILENT;
  ceres::Solver::Summary summary;
  ceres::Solve(solver, &problem, &summary);
  std::vector<Pose> poses;
  for (const auto& pose : at) {
    Pose T = Pose::Identity();
    T.linear() = pose.q.normalized().toRotationMatrix();
    T.translation() = pose.p;
    poses.push_back(T);
  }
  return {poses, summary.final_cost};
}

/** Largest difference of any number of any pose, over the size of the graph [1 or m]. */
inline double difference(const std::vector<Pose>& a, const std::vector<Pose>& b) {
  double worst = 0, size_m = 1;
  for (std::size_t i = 0; i < a.size(); ++i) {
    worst = std::max(worst, (a[i].matrix() - b[i].matrix()).lpNorm<Eigen::Infinity>());
    size_m = std::max(size_m, a[i].translation().norm());
  }
  return worst / size_m;
}

}  // namespace raceloc::test
