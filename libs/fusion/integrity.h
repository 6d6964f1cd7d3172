/** \file
 * What the estimate is worth at an instant. */
#pragma once

#include <string>

namespace raceloc {

enum class LocalizationState {
  ok,              ///< at least two independent sources agree with the estimate
  degraded,        ///< it is held, by fewer sources than there should be or against one that contradicts it
  dead_reckoning,  ///< by the car's own motion alone
  lost,            ///< not started, or its error may be larger than the alert limit
};
[[nodiscard]] const char* nameOf(LocalizationState state);

/** Bounds of the error, in the car's axes. */
struct ProtectionLevels {
  double lateral_m, longitudinal_m, heading_rad;
};

/** One state with the cause that decided it; `cause` is empty when the state is `ok`. */
struct Integrity {
  LocalizationState state = LocalizationState::lost;
  std::string cause = "not started";  ///< e.g. `gps_left: leaves the others`, `no source`
  double measured = 0;                ///< what was compared ...
  double limit = 0;  ///< ... and with what, in one unit; both 0 for causes that are not measured
  ProtectionLevels protection{};
  double alert_limit_m = 0;  ///< lateral: the gap from the car's side to the nearest wall
};

}  // namespace raceloc
