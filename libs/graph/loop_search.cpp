#include "graph/loop_search.h"

#include <algorithm>

#include "graph/map_graphs.h"

namespace raceloc {

namespace {

/** What a loop's neighbours say is heard on both its sides: so many times neighbour_m back. */
constexpr double kHeard = 2;

}  // namespace

LoopSearch::LoopSearch(const PoseGraph& graph, const OdometryChain& chain, const LoopOptions& options)
    : x_chain(chain), x_options(options), x_smoother({}, graph.held) {
  x_smoother.update(graph.T_map_body, graph.factors);
}

void LoopSearch::add(const std::vector<LoopMatch>& matches) {
  if (matches.empty()) return;
  x_matches.insert(x_matches.end(), matches.begin(), matches.end());
  const double from_m = x_chain.path_m(matches.back().candidate.j) - kHeard * x_options.neighbour_m;
  const auto latest = std::partition_point(x_matches.begin(), x_matches.end(), [&](const LoopMatch& match) {
    return x_chain.path_m(match.candidate.j) < from_m;
  });
  std::vector<Factor> closed;
  for (const LoopEdge& edge : consistentLoops({latest, x_matches.end()}, x_chain, x_options).edges)
    if (x_closed.insert({edge.i, edge.j}).second) closed.push_back(loopFactor(edge));
  if (!closed.empty()) x_smoother.update({}, closed);
}

}  // namespace raceloc
