/** \file
 * What the estimate is worth at an instant. */
#pragma once

#include <optional>
#include <string>

#include "core/options.h"
#include "fusion/estimator.h"

namespace raceloc {

enum class LocalizationState {
  ok,              ///< two sources or more confirm it, and none is missing or contradicts it
  degraded,        ///< it is held, but a source is missing, leaves the others or contradicts it
  dead_reckoning,  ///< by the car's own motion alone
  lost,            ///< not started, or its error may be larger than the alert limit
};
[[nodiscard]] const char* nameOf(LocalizationState state);

/** Section [integrity]. */
struct IntegrityOptions {
  double protection_sigmas = 5;
  double half_width_m = 1;
  double alert_limit_m = 3;
  void describe(OptionList& keys);
};

/** Bounds of the error, in the car's axes. */
struct ProtectionLevels {
  double lateral_m, longitudinal_m, heading_rad;
};

/** One state with the cause that decided it; `cause` is empty when the state is `ok`. */
struct Integrity {
  LocalizationState state = LocalizationState::lost;
  std::string cause = "not started";  ///< e.g. `gps_left left the others`
  double measured = 0;                ///< what was compared ...
  double limit = 0;  ///< ... and with what, in one unit; both 0 for causes that are not measured
  ProtectionLevels protection{};
  double alert_limit_m = 0;  ///< lateral: the gap from the car's side to the nearest wall
};

/** Bounds: so many sigmas of the filter's covariance, what sources that confirm the estimate are off from it in the mean,
 * and of the way without such a source a share: wheels that slip and a gyro that is off are no white noise. \param gap_m  from the car's middle to the nearest wall; none: it is not known, and alert_limit_m stands */
[[nodiscard]] Integrity assess(const EstimatorState& state, std::optional<double> gap_m,
                               const EstimatorOptions& options, const IntegrityOptions& integrity);

}  // namespace raceloc
