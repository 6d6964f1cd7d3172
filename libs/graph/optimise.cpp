#include "graph/optimise.h"

#include <limits>
#include <stdexcept>
#include <utility>

#include "graph/block_cholesky.h"

namespace raceloc {

namespace {

constexpr double kFirstDamping = 1e-4, kLeastDamping = 1e-6, kMostDamping = 1e8;
/** A cost that rises by less than this share of it rose by rounding. */
constexpr double kRounding = 1e-12;
/** Steps below this [rad, m] change nothing that anyone can measure. */
constexpr double kNoStep = 1e-11;

BlockCholesky systemOf(const PoseGraph& graph) {
  std::vector<std::pair<std::size_t, std::size_t>> links;
  for (const Factor& factor : graph.factors)
    if (const std::size_t j = secondKey(factor); j != kNoPose) links.emplace_back(firstKey(factor), j);
  return {graph.T_map_body.size(), links};
}

/** Normal equations at an estimate: H goes into `system`, the gradient into `g`. \return the cost */
double assemble(const PoseGraph& graph, const std::vector<Pose>& T_map_body, BlockCholesky& system,
                Eigen::VectorXd& g) {
  system.clear();
  g.setZero();
  if (graph.held) system.hold(*graph.held);
  double sum = 0;
  for (const Factor& factor : graph.factors) {
    const LinearFactor term = linearise(factor, T_map_body, graph.held);
    system.add(term);
    g.segment<6>(static_cast<Eigen::Index>(6 * term.i)) += term.J_i.transpose() * term.r;
    if (term.j != kNoPose)
      g.segment<6>(static_cast<Eigen::Index>(6 * term.j)) += term.J_j.transpose() * term.r;
    sum += term.cost;
  }
  return 0.5 * sum;
}

}  // namespace

OptimiseResult optimise(PoseGraph& graph, const OptimiseOptions& options) {
  BlockCholesky system = systemOf(graph);
  Eigen::VectorXd g(6 * static_cast<Eigen::Index>(graph.T_map_body.size())), g_new(g.size());
  double cost = assemble(graph, graph.T_map_body, system, g);
  OptimiseResult result{cost, cost, 0, false};
  double damping = 0;
  std::vector<Pose> moved = graph.T_map_body;
  while (!result.converged && result.iterations < options.max_iterations) {
    ++result.iterations;
    const bool definite = system.factorize(damping);
    double new_cost = std::numeric_limits<double>::infinity();
    if (definite) {
      const Eigen::VectorXd step = system.solve(-g);
      for (std::size_t i = 0; i < moved.size(); ++i)
        moved[i] = graph.T_map_body[i] * se3Exp(step.segment<6>(static_cast<Eigen::Index>(6 * i)));
      new_cost = assemble(graph, moved, system, g_new);
      result.converged = step.lpNorm<Eigen::Infinity>() < kNoStep;
    }
    if (new_cost <= cost * (1 + kRounding)) {
      result.converged |= cost - new_cost <= options.relative_decrease * cost;
      cost = new_cost;
      graph.T_map_body.swap(moved);
      g.swap(g_new);
      damping = damping > kLeastDamping ? damping / 10 : 0;
      continue;
    }
    damping = damping > 0 ? 10 * damping : kFirstDamping;
    if (damping > kMostDamping) {
      if (!definite) throw std::invalid_argument("optimise: the factors leave a pose undetermined");
      break;
    }
    if (!result.converged) assemble(graph, graph.T_map_body, system, g);
  }
  result.final_cost = cost;
  return result;
}

}  // namespace raceloc
