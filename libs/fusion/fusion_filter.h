/** \file
 * The car's planar state from its own motion and any number of pose sources. */
#pragma once

#include <mrpt/bayes/CKalmanFilterCapable.h>

#include <Eigen/Core>
#include <optional>
#include <vector>

#include "core/options.h"
#include "fusion/bayes_gate.h"
#include "fusion/fusion_types.h"

namespace raceloc {

/** Section [fusion]. Errors of speed and yaw rate are white: their sigma is that of the mean over one second,
 * so after t seconds distance and heading are off by sigma sqrt(t), however the time is cut into steps. The
 * angle b from heading to course is a first-order Gauss-Markov process: it forgets with `bias_time_s` and its
 * variance, when nobody observes it, goes to `bias_sigma_rad`^2 and no further. For times short against
 * bias_time_s it is a random walk of bias_sigma_rad sqrt(2 / bias_time_s) per root second. */
struct FusionOptions {
  double speed_sigma_mps = 0.1;
  double yaw_rate_sigma_rps = 0.001;
  double bias_sigma_rad = 0.02;
  double bias_time_s = 30;
  double start_position_sigma_m = 1.0;
  double start_heading_sigma_rad = 0.1;
  void describe(OptionList& keys);
};

/** A first state at a known place: b = 0, sigmas of the options, no correlation. */
[[nodiscard]] CarState startState(const Eigen::Vector2d& p_map_m, double heading_rad,
                                  const FusionOptions& options);

/** Extended Kalman filter with state [x y theta b] and control [v_x omega_z].
 *
 * In a step of duration T at speed v and yaw rate w the body moves by v T along theta + b + slip + w T / 2, turns by
 * w T, and b shrinks by exp(-T / bias_time_s). Noise of the control enters through the Jacobian by the
 * control, which is the paper's 6x6 transition (eq_state_extend) with its two control states eliminated. The
 * middle direction makes the chord too long by (w T)^2 / 24 of it. Source: Lee et al., eq_kalman_basic to
 * eq_state_extend; textbook EKF, P = (I - K H) P, kept symmetric. */
class FusionFilter : private mrpt::bayes::CKalmanFilterCapable<4, 3, 0, 2> {
 public:
  /** \throws std::invalid_argument if `start` is not finite or its covariance not symmetric positive
   * semidefinite \throws InputError if the options of the gate contradict each other */
  FusionFilter(const CarState& start, const FusionOptions& options, const GateOptions& gate_options);

  /** Dead reckoning over `duration_s` >= 0 at the constant rates of a control, whose stamp says nothing here.
   * \throws std::invalid_argument if a value is not finite or the duration negative; the state is then as before. */
  void predict(double duration_s, const Control& control);
  void predict(double duration_s, double speed_mps, double yaw_rate_rps) {
    predict(duration_s, {0, speed_mps, yaw_rate_rps});
  }

  /** Corrects by what gate() makes of the fixes, all of the filter's present time; not at all if it rejects
   * them. \return what it believed of each source, and why \throws std::invalid_argument as gate() does; the
   * state is then as before. */
  GateDecision correct(const std::vector<PoseFix>& fixes);

  [[nodiscard]] CarState state() const;
  /** Goes on from another state: one that state() gave, or a sound one. */
  void setState(const CarState& state);

 private:
  struct Step {
    double duration_s;
    Control control;
  };
  [[nodiscard]] double courseMidway() const;  ///< direction of the step's chord [rad]
  [[nodiscard]] double biasKept() const;      ///< what the step leaves of b, 0..1

  void OnGetAction(KFArray_ACT& u) const override;
  void OnTransitionModel(const KFArray_ACT& u, KFArray_VEH& x, bool& skip) const override;
  void OnTransitionJacobian(KFMatrix_VxV& F) const override;
  void OnTransitionNoise(KFMatrix_VxV& Q) const override;
  void OnGetObservationNoise(KFMatrix_OxO& R) const override;
  void OnGetObservationsAndDataAssociation(vector_KFArray_OBS& z, std::vector<int>& association,
                                           const vector_KFArray_OBS& predictions, const KFMatrix& S,
                                           const std::vector<size_t>& indices,
                                           const KFMatrix_OxO& R) override;
  void OnObservationModel(const std::vector<size_t>& indices, vector_KFArray_OBS& predictions) const override;
  void OnObservationJacobians(size_t index, KFMatrix_OxV& Hx, KFMatrix_OxF& Hy) const override;
  void OnSubstractObservationVectors(KFArray_OBS& reading, const KFArray_OBS& predicted) const override;
  void OnNormalizeStateVector() override;
  void OnPostIteration() override;

  FusionOptions x_options;
  GateOptions x_gate_options;
  Step x_step{};                 ///< what MRPT's next iteration predicts
  std::optional<PoseFix> x_fix;  ///< what it corrects with instead, when there is one
};

}  // namespace raceloc
