#include "graph/pose_graph.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <stdexcept>

namespace raceloc {

double RobustLoss::cost(double squared) const {
  const double width2 = width * width;
  switch (kind) {
    case Kind::none:
      return squared;
    case Kind::huber:
      return squared <= width2 ? squared : 2 * width * std::sqrt(squared) - width2;
    case Kind::cauchy:
      return width2 * std::log1p(squared / width2);
  }
  throw std::logic_error("RobustLoss: no such kind");
}

double RobustLoss::weight(double squared) const {
  const double width2 = width * width;
  switch (kind) {
    case Kind::none:
      return 1;
    case Kind::huber:
      return squared <= width2 ? 1 : width / std::sqrt(squared);
    case Kind::cauchy:
      return 1 / (1 + squared / width2);
  }
  throw std::logic_error("RobustLoss: no such kind");
}

namespace {

template <int N>
Eigen::Matrix<double, N, N> whitening(const Eigen::Matrix<double, N, N>& covariance) {
  const Eigen::LLT<Eigen::Matrix<double, N, N>> factor(covariance);
  if (factor.info() != Eigen::Success)
    throw std::invalid_argument("whiteningOf: the covariance is not positive definite");
  const Eigen::Matrix<double, N, N> information = factor.solve(Eigen::Matrix<double, N, N>::Identity());
  return information.llt().matrixU();
}

/** Log of SO(3), Eq. (141), through the quaternion because that keeps its digits near 0 and pi. */
Eigen::Vector3d rotationLog(const Eigen::Matrix3d& R) {
  const Eigen::Quaterniond q(R);
  const double sine = q.vec().norm();
  if (sine < 1e-12) return (q.w() < 0 ? -2.0 : 2.0) * q.vec();
  return 2 * std::atan2(q.w() < 0 ? -sine : sine, std::abs(q.w())) / sine * q.vec();
}

/** d Log(R exp(xi)) / d xi at theta = Log(R), Eq. (144). */
Eigen::Matrix3d inverseRightJacobian(const Eigen::Vector3d& theta) {
  const double angle = theta.norm();
  const Eigen::Matrix3d W = skew(theta);
  const double factor =
      angle < 1e-4 ? 1.0 / 12
                   : (1 - 0.5 * angle * std::cos(0.5 * angle) / std::sin(0.5 * angle)) / (angle * angle);
  return Eigen::Matrix3d::Identity() + 0.5 * W + factor * W * W;
}

/** Where a factor's Jacobians go. */
struct Jacobians {
  Matrix6d &J_i, &J_j;
};

/** Fills r of a factor before its loss, and its Jacobians where they are wanted; what it leaves is zero. */
struct Linearise {
  const std::vector<Pose>& T;
  Vector6d& r;
  const Jacobians* out;  ///< null: only r

  void operator()(const PriorFactor& f) const {
    const Eigen::Matrix3d R_E = f.T_map_body.linear().transpose() * T[f.i].linear();
    Vector6d e;
    e.head<3>() = rotationLog(R_E);
    e.tail<3>() = f.T_map_body.linear().transpose() * (T[f.i].translation() - f.T_map_body.translation());
    r.noalias() = f.whitening * e;
    if (!out) return;
    out->J_i.leftCols<3>().noalias() = f.whitening.leftCols<3>() * inverseRightJacobian(e.head<3>());
    out->J_i.rightCols<3>().noalias() = f.whitening.rightCols<3>() * R_E;
  }

  void operator()(const BetweenFactor& f) const {
    const Eigen::Matrix3d R_i_j = T[f.i].linear().transpose() * T[f.j].linear();
    const Eigen::Matrix3d R_j_i_measured = f.T_i_j.linear().transpose();
    const Eigen::Vector3d p_i_j = T[f.i].linear().transpose() * (T[f.j].translation() - T[f.i].translation());
    const Eigen::Matrix3d R_E = R_j_i_measured * R_i_j;
    Vector6d e;
    e.head<3>() = rotationLog(R_E);
    e.tail<3>() = R_j_i_measured * (p_i_j - f.T_i_j.translation());
    r.noalias() = f.whitening * e;
    if (!out) return;
    const Eigen::Matrix3d D = inverseRightJacobian(e.head<3>());
    Matrix6d J = Matrix6d::Zero();
    J.topLeftCorner<3, 3>() = D;
    J.bottomRightCorner<3, 3>() = R_E;
    out->J_j.noalias() = f.whitening * J;
    // exp(-xi_i) on the left of R_i_j and p_i_j: -R_i_j' xi on the right, and p + [p]x xi - rho.
    J.topLeftCorner<3, 3>() = -D * R_i_j.transpose();
    J.bottomLeftCorner<3, 3>() = R_j_i_measured * skew(p_i_j);
    J.bottomRightCorner<3, 3>() = -R_j_i_measured;
    out->J_i.noalias() = f.whitening * J;
  }

  void operator()(const PositionFactor& f) const {
    const Eigen::Matrix3d& R = T[f.i].linear();
    r.head<3>() = f.whitening * (T[f.i] * f.p_body_antenna_m - f.z_map_antenna_m);
    if (!out) return;
    out->J_i.topLeftCorner<3, 3>() = -f.whitening * R * skew(f.p_body_antenna_m);
    out->J_i.topRightCorner<3, 3>() = f.whitening * R;
  }

  void operator()(const AttitudeFactor& f) const {
    const Eigen::Vector3d e = rotationLog(f.R_map_body.transpose() * T[f.i].linear());
    r.head<3>() = f.whitening * e;
    if (!out) return;
    out->J_i.topLeftCorner<3, 3>() = f.whitening * inverseRightJacobian(e);
  }

  void operator()(const LevelFactor& f) const {
    const Eigen::Matrix3d& R = T[f.i].linear();
    r.head<2>() = (R * f.up_body).head<2>() / f.sigma_rad;
    if (!out) return;
    out->J_i.topLeftCorner<2, 3>() = -(R * skew(f.up_body)).topRows<2>() / f.sigma_rad;
  }
};

/** Fills `residual`, and the Jacobians before the loss where they are wanted. \return the root of the loss's weight */
double evaluate(const Factor& factor, const std::vector<Pose>& T_map_body, Residual& residual,
                const Jacobians* jacobians) {
  const std::size_t i = firstKey(factor), j = secondKey(factor);
  if (i >= T_map_body.size() || (j != kNoPose && j >= T_map_body.size()))
    throw std::out_of_range("linearise: a factor of a pose that is not there");
  residual.r.setZero();
  std::visit(Linearise{T_map_body, residual.r, jacobians}, factor);
  const auto& loss = std::visit([](const auto& f) -> const RobustLoss& { return f.loss; }, factor);
  residual.squared = residual.r.squaredNorm();
  residual.cost = loss.cost(residual.squared);
  const double root = std::sqrt(loss.weight(residual.squared));
  residual.r *= root;
  return root;
}

}  // namespace

Matrix6d whiteningOf(const Matrix6d& covariance) { return whitening<6>(covariance); }
Eigen::Matrix3d whiteningOf(const Eigen::Matrix3d& covariance) { return whitening<3>(covariance); }

std::size_t firstKey(const Factor& factor) {
  return std::visit([](const auto& f) { return f.i; }, factor);
}

std::size_t secondKey(const Factor& factor) {
  const auto* between = std::get_if<BetweenFactor>(&factor);
  return between ? between->j : kNoPose;
}

Residual residualOf(const Factor& factor, const std::vector<Pose>& T_map_body) {
  Residual residual;
  evaluate(factor, T_map_body, residual, nullptr);
  return residual;
}

LinearFactor linearise(const Factor& factor, const std::vector<Pose>& T_map_body,
                       std::optional<std::size_t> held) {
  LinearFactor out;
  out.i = firstKey(factor);
  out.j = secondKey(factor);
  out.J_i.setZero();
  out.J_j.setZero();
  const Jacobians jacobians{out.J_i, out.J_j};
  const double root = evaluate(factor, T_map_body, out, &jacobians);
  out.J_i *= held == out.i ? 0 : root;
  out.J_j *= held == out.j ? 0 : root;
  return out;
}

double costOf(const PoseGraph& graph) {
  double sum = 0;
  for (const Factor& factor : graph.factors) sum += residualOf(factor, graph.T_map_body).cost;
  return 0.5 * sum;
}

double chiSquareOf(const PoseGraph& graph) {
  double sum = 0;
  for (const Factor& factor : graph.factors) sum += residualOf(factor, graph.T_map_body).squared;
  return sum;
}

}  // namespace raceloc
