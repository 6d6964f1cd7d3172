/** \file
 * Loops in the order of driving, each looked for from an estimate that the ones before have corrected. */
#pragma once

#include <set>
#include <utility>
#include <vector>

#include "graph/loop_closure.h"
#include "graph/smoother.h"

namespace raceloc {

/** Where fixes are gone, odometry drifts out of the reach of the search within a lap. Here loops bend the estimate at
 * once, those that consistentLoops() believes of the latest matches, so that the rest of the lap is looked for from
 * where it has closed so far. Work per key pose does not grow with the drive but for the Smoother's.
 *
 * What is believed in the end is told by all matches together, as if they had come at once; a loop that is then
 * refused has had its say in where others were looked for, under its robust loss. */
class LoopSearch {
 public:
  /** \param graph  without loops, near its minimum
   * \param chain  of the same key poses; a reference is kept */
  LoopSearch(const PoseGraph& graph, const OdometryChain& chain, const LoopOptions& options);

  [[nodiscard]] const std::vector<Pose>& T_map_body() const { return x_smoother.graph().T_map_body; }
  /** Matches of the next key pose's candidates. */
  void add(const std::vector<LoopMatch>& matches);
  [[nodiscard]] LoopClosures closures() const { return consistentLoops(x_matches, x_chain, x_options); }

 private:
  const OdometryChain& x_chain;
  LoopOptions x_options;
  Smoother x_smoother;
  std::vector<LoopMatch> x_matches;
  std::set<std::pair<std::size_t, std::size_t>> x_closed;  ///< keys of the loops that the estimate has
};

}  // namespace raceloc
