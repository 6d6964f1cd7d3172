#include "fusion/fusion_filter.h"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <utility>

#include "core/types.h"
#include "fusion/measurement.h"

namespace raceloc {

namespace {

void requireSound(const CarState& start) {
  if (!start.mean.allFinite() || !start.covariance.allFinite())
    throw std::invalid_argument("FusionFilter: the start is not finite");
  const Eigen::Matrix4d& P = start.covariance;
  const double rounding = 1e-9 * P.cwiseAbs().maxCoeff();
  if ((P - P.transpose()).cwiseAbs().maxCoeff() > rounding)
    throw std::invalid_argument("FusionFilter: the start's covariance is not symmetric");
  if (Eigen::SelfAdjointEigenSolver<Eigen::Matrix4d>(P, Eigen::EigenvaluesOnly).eigenvalues().minCoeff() <
      -rounding)
    throw std::invalid_argument("FusionFilter: the start's covariance is not positive semidefinite");
}

}  // namespace

void FusionOptions::describe(OptionList& keys) {
  keys.add("speed_sigma_mps", speed_sigma_mps, above(0),
           "error of the speed, averaged over one second [m/s]");
  keys.add("yaw_rate_sigma_rps", yaw_rate_sigma_rps, above(0),
           "error of the yaw rate, averaged over one second [rad/s]");
  keys.add("bias_sigma_rad", bias_sigma_rad, atLeast(0),
           "angle from heading to course: how large it gets [rad]");
  keys.add("bias_time_s", bias_time_s, above(0),
           "angle from heading to course: how long it stays the same [s]");
  keys.add("start_position_sigma_m", start_position_sigma_m, above(0), "of the first state [m]");
  keys.add("start_heading_sigma_rad", start_heading_sigma_rad, above(0), "of the first state [rad]");
}

CarState startState(const Eigen::Vector2d& p_map_m, double heading_rad, const FusionOptions& options) {
  const Eigen::Vector4d sigma(options.start_position_sigma_m, options.start_position_sigma_m,
                              options.start_heading_sigma_rad, options.bias_sigma_rad);
  return {{p_map_m.x(), p_map_m.y(), wrapAngle(heading_rad), 0}, sigma.cwiseAbs2().asDiagonal()};
}

FusionFilter::FusionFilter(const CarState& start, const FusionOptions& options,
                           const GateOptions& gate_options)
    : x_options(options), x_gate_options(gate_options) {
  requireSound(start);
  requireConsistent("gate", gate_options);
  KF_options.method = mrpt::bayes::kfEKFNaive;
  m_xkk.resize(4);
  m_pkk.setSize(4, 4);
  setState(start);
  OnNormalizeStateVector();
}

void FusionFilter::predict(double duration_s, const Control& control) {
  if (!(duration_s >= 0 && std::isfinite(duration_s) && isFinite(control)))
    throw std::invalid_argument("FusionFilter: duration must be >= 0, and the control finite");
  x_step = {duration_s, control};
  x_fix.reset();
  runOneKalmanIteration();
}

GateDecision FusionFilter::correct(const std::vector<PoseFix>& fixes) {
  GateResult result = gate(state(), fixes, x_gate_options);
  if (result.fused) {
    x_fix = std::move(result.fused);
    runOneKalmanIteration();
  }
  return result.decision;
}

CarState FusionFilter::state() const { return {m_xkk.asEigen(), m_pkk.asEigen()}; }

void FusionFilter::setState(const CarState& state) {
  m_xkk.asEigen() = state.mean;
  m_pkk.asEigen() = state.covariance;
}

double FusionFilter::courseMidway() const {
  return m_xkk[2] + m_xkk[3] + x_step.control.slip_rad +
         0.5 * x_step.duration_s * x_step.control.yaw_rate_rps;
}

double FusionFilter::biasKept() const { return std::exp(-x_step.duration_s / x_options.bias_time_s); }

void FusionFilter::OnGetAction(KFArray_ACT& u) const {
  u[0] = x_step.control.speed_mps;
  u[1] = x_step.control.yaw_rate_rps;
}

void FusionFilter::OnTransitionModel(const KFArray_ACT& u, KFArray_VEH& x, bool& skip) const {
  skip = x_fix.has_value();
  if (skip) return;
  const double T = x_step.duration_s, course_rad = x[2] + x[3] + x_step.control.slip_rad + 0.5 * T * u[1];
  x[0] += T * u[0] * std::cos(course_rad);
  x[1] += T * u[0] * std::sin(course_rad);
  x[2] += T * u[1];
  x[3] *= biasKept();
}

void FusionFilter::OnTransitionJacobian(KFMatrix_VxV& F) const {
  const double length_m = x_step.duration_s * x_step.control.speed_mps, course_rad = courseMidway();
  F.setIdentity();
  F(0, 2) = F(0, 3) = -length_m * std::sin(course_rad);
  F(1, 2) = F(1, 3) = length_m * std::cos(course_rad);
  F(3, 3) = biasKept();
}

void FusionFilter::OnTransitionNoise(KFMatrix_VxV& Q) const {
  const double T = x_step.duration_s, v = x_step.control.speed_mps;
  const double c = std::cos(courseMidway()), s = std::sin(courseMidway());
  // Columns: distance and turn by the control, which is off by sigma sqrt(T) in each.
  Eigen::Matrix<double, 4, 2> G;
  G << c, -0.5 * T * v * s,  //
      s, 0.5 * T * v * c,    //
      0, 1,                  //
      0, 0;
  const Eigen::Vector2d variance =
      T * Eigen::Vector2d(std::max(x_options.speed_sigma_mps, x_step.control.speed_sigma_mps),
                          x_options.yaw_rate_sigma_rps)
              .cwiseAbs2();
  Q.asEigen() = G * variance.asDiagonal() * G.transpose();
  Q(3, 3) = std::pow(x_options.bias_sigma_rad, 2) * -std::expm1(-2 * T / x_options.bias_time_s);
}

void FusionFilter::OnGetObservationNoise(KFMatrix_OxO& R) const {
  if (x_fix)
    R.asEigen() = noiseOf(*x_fix);
  else
    R.setIdentity();
}

void FusionFilter::OnGetObservationsAndDataAssociation(vector_KFArray_OBS& z, std::vector<int>& association,
                                                       const vector_KFArray_OBS& /*predictions*/,
                                                       const KFMatrix& /*S*/,
                                                       const std::vector<size_t>& /*indices*/,
                                                       const KFMatrix_OxO& /*R*/) {
  z.clear();
  association.clear();
  if (!x_fix) return;
  z.emplace_back();
  z.back().asEigen() = readingOf(*x_fix);
}

void FusionFilter::OnObservationModel(const std::vector<size_t>& /*indices*/,
                                      vector_KFArray_OBS& predictions) const {
  predictions.resize(1);
  predictions[0].asEigen() =
      x_fix ? predictedReading(*x_fix, m_xkk.asEigen()) : Eigen::Vector3d(Eigen::Vector3d::Zero());
}

void FusionFilter::OnObservationJacobians(size_t /*index*/, KFMatrix_OxV& Hx, KFMatrix_OxF& /*Hy*/) const {
  if (x_fix)
    Hx.asEigen() = observationMatrix(*x_fix, m_xkk[2]);
  else
    Hx.setZero();
}

void FusionFilter::OnSubstractObservationVectors(KFArray_OBS& reading, const KFArray_OBS& predicted) const {
  reading.asEigen() = innovation(reading.asEigen(), predicted.asEigen());
}

void FusionFilter::OnNormalizeStateVector() { m_xkk[2] = wrapAngle(m_xkk[2]); }

void FusionFilter::OnPostIteration() {
  const Eigen::Matrix4d P = m_pkk.asEigen();
  m_pkk.asEigen() = 0.5 * (P + P.transpose());
}

}  // namespace raceloc
