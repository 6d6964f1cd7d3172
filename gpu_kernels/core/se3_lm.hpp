/** \file
 * Gauss-Newton with Levenberg-Marquardt damping on SE(3), on the host and in double. */
#pragma once

#include <array>
#include <optional>

#include "core/backend.hpp"
#include "raceloc/gpu/matcher.h"

namespace raceloc::gpu {

using Step = std::array<double, 6>;  ///< rotation [rad], then translation [m]

/** T Exp(xi). Source: Sola et al., arXiv:1812.01537, Eqs. (25), (172). */
[[nodiscard]] Transform moved(const Transform& T, const Step& xi);

/** Solves (H + damping diag(H)) xi = -b by LDL' of H scaled to a unit diagonal; nothing if H is not positive
 * definite beyond the rounding of its float sums. */
[[nodiscard]] std::optional<Step> solveStep(const Linearization& at, double damping);

/** The loop behind match(). A step is kept if the cost over the pairs of the pose before does not grow there;
 * a rejected one raises the damping. It has converged when the undamped step is short: a step is never short
 * merely because it was damped. */
[[nodiscard]] Match gaussNewton(PassRunner& passes, const Transform& guess, const MatchOptions& options);

}  // namespace raceloc::gpu
