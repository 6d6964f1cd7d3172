/** \file
 * Batch solution of a pose graph. */
#pragma once

#include "graph/pose_graph.h"

namespace raceloc {

struct OptimiseOptions {
  int max_iterations = 100;          ///< linear systems solved at most
  double relative_decrease = 1e-10;  ///< converged when a step lowers the cost by less than this share of it
};

struct OptimiseResult {
  double initial_cost, final_cost;  ///< half the sum of rho(r' r)
  int iterations;
  bool converged;  ///< false: max_iterations were not enough, or no step, however damped, lowers the cost
};

/** Minimises the cost over the poses by Gauss-Newton, damped (Levenberg-Marquardt, diag(H)) only after a step
 * that raised the cost. The result is the same to the last bit for the same input.
 * \throws std::invalid_argument if the factors leave a pose undetermined.
 * Source: Levenberg-Marquardt as in Madsen et al., Methods for non-linear least squares problems, 2004, 3.2;
 * losses as weights (Triggs et al. 2000, section 4.3, without the second-order term). */
OptimiseResult optimise(PoseGraph& graph, const OptimiseOptions& options);

}  // namespace raceloc
