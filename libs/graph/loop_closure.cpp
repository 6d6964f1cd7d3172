#include "graph/loop_closure.h"

#include <raceloc/gpu/voxel_map.h>

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <limits>
#include <numeric>
#include <optional>
#include <set>
#include <utility>

#include "cloud/voxel_grid.h"
#include "registration/search.h"

namespace raceloc {

void LoopOptions::describe(OptionList& keys) {
  keys.add("every_ids", every_ids, between(1, 1000), "a loop is tried once in so many way-points of a lap");
  keys.add("neighbour_ids", neighbour_ids, between(0, 10),
           "where no earlier pass has the same ID, one up to so many away will do");
  keys.add("max_per_key", max_per_key, between(1, 10), "earlier passes that a key pose is matched with");
  keys.add("search_m", search_m, between(0, 50), "drift up to which a loop is looked for, in the plane [m]");
  keys.add("submap_m", submap_m, between(0, 100),
           "a submap is of key scans up to this far before and behind [m] ...");
  keys.add("submap_scans", submap_scans, between(1, 100), "... and of so many at most");
  keys.add("submap_voxel_m", submap_voxel_m, above(0), "it keeps one point a voxel of this edge [m]");
  keys.add("apart_m", apart_m, between(0.1, 10),
           "matches farther apart are two places; below the spacing of posts [m]");
  keys.add("rival_share", rival_share, between(0, 1),
           "a second place counts from this share of the best one's inliers per residual");
  keys.add("weakest_scale", weakest_scale, atLeast(1),
           "sigma along the weakest direction of a match, in units of what the match believes");
  keys.add("neighbour_m", neighbour_m, above(0),
           "loops less far apart along the drive are held against each other [m]");
  keys.add("min_agreeing", min_agreeing, between(1, 100), "neighbours that must confirm a loop");
  keys.add("min_lead", min_lead, between(1, 100),
           "loops by which a set must outnumber one that contradicts it");
}

// ---- Odometry between key poses

void OdometryChain::add(const BodyMotion& since_last) {
  if (x_keys.empty() || !(since_last.duration_s > 0)) {
    const bool first = x_keys.empty();
    x_keys.push_back({Pose::Identity(), Matrix6d::Zero(), first ? 0 : x_keys.back().path_m,
                      first ? 0 : x_keys.back().part + 1});
    return;
  }
  Key key = x_keys.back();
  key.T_part_body = key.T_part_body * since_last.T_start_end;
  const Matrix6d ad = adjoint(key.T_part_body);
  key.covariance_part += ad * since_last.covariance * ad.transpose();
  key.path_m += since_last.T_start_end.translation().norm();
  x_keys.push_back(key);
}

bool OdometryChain::joined(std::size_t a, std::size_t b) const {
  return x_keys.at(a).part == x_keys.at(b).part;
}

double OdometryChain::path_m(std::size_t key) const { return x_keys.at(key).path_m; }

Pose OdometryChain::T_between(std::size_t a, std::size_t b) const {
  return x_keys.at(a).T_part_body.inverse() * x_keys.at(b).T_part_body;
}

Matrix6d OdometryChain::covarianceBetween(std::size_t a, std::size_t b) const {
  const Matrix6d ad = adjoint(x_keys.at(b).T_part_body.inverse());
  const auto [first, last] = std::minmax(a, b);
  return ad * (x_keys.at(last).covariance_part - x_keys.at(first).covariance_part) * ad.transpose();
}

// ---- Candidates

std::vector<LoopCandidate> loopCandidates(const RacetrackDict& dict, const std::vector<Pose>& T_map_body,
                                          const LoopOptions& options) {
  const auto& entries = dict.entries();
  if (entries.empty()) return {};
  const std::size_t now = entries.size() - 1;
  // One in every_ids way-points of a lap: the first key pose of each such stretch.
  const bool stretch_goes_on = now > 0 && dict.samePass(now, now - 1) &&
                               entries[now].lap == entries[now - 1].lap &&
                               entries[now].id / options.every_ids == entries[now - 1].id / options.every_ids;
  if (stretch_goes_on) return {};

  std::vector<std::size_t> passes;
  const auto consider = [&](std::size_t entry) {
    const auto same = [&](std::size_t other) { return dict.samePass(entry, other); };
    if (!same(now) && std::none_of(passes.begin(), passes.end(), same)) passes.push_back(entry);
  };
  const auto wanted = static_cast<std::size_t>(options.max_per_key);
  for (int offset = 0; offset <= options.neighbour_ids; ++offset)
    for (const int id : {entries[now].id + offset, entries[now].id - offset}) {
      const auto& passages = dict.passages(id);
      if (!passages.empty() && passes.size() < wanted) consider(passages.front());
      for (auto entry = passages.rbegin(); entry != passages.rend() && passes.size() < wanted; ++entry)
        consider(*entry);
    }
  std::vector<LoopCandidate> candidates;
  const std::size_t j = entries[now].keys.key_L;
  for (const std::size_t entry : passes) {
    const std::size_t i = entries[entry].keys.key_L;
    candidates.push_back({i, j, T_map_body.at(i).inverse() * T_map_body.at(j), options.search_m});
  }
  return candidates;
}

// ---- Matching

LoopMatcher::LoopMatcher(gpu::Context& context, const OdometryChain& chain, KeyScans scans,
                         const LoopOptions& options, const GicpOptions& gicp,
                         const CovarianceOptions& covariance)
    : x_context(context),
      x_chain(chain),
      x_scans(std::move(scans)),
      x_options(options),
      x_gicp(gicp),
      x_covariance(covariance) {}

CovarianceCloud LoopMatcher::submap(std::size_t key) const {
  std::vector<std::size_t> members{key};
  const double step_m = 2 * x_options.submap_m / std::max(1, x_options.submap_scans - 1);
  const auto most = static_cast<std::size_t>(x_options.submap_scans);
  for (const int side : {-1, 1}) {
    double next_m = step_m;
    for (std::size_t k = key; members.size() < most;) {
      if (side < 0 ? k == 0 : k + 1 == x_chain.size()) break;
      k = side < 0 ? k - 1 : k + 1;
      const double away_m = std::abs(x_chain.path_m(k) - x_chain.path_m(key));
      if (!x_chain.joined(key, k) || away_m > x_options.submap_m + 0.5 * step_m) break;
      if (away_m < next_m) continue;
      members.push_back(k);
      next_m = away_m + step_m;
    }
  }
  Cloud merged;
  for (const std::size_t k : members) {
    const Cloud scan = transformed(x_scans(k), x_chain.T_between(key, k));
    merged.x.insert(merged.x.end(), scan.x.begin(), scan.x.end());
    merged.y.insert(merged.y.end(), scan.y.begin(), scan.y.end());
    merged.z.insert(merged.z.end(), scan.z.begin(), scan.z.end());
  }
  return withCovariances(x_context, voxelGrid(x_context, merged, x_options.submap_voxel_m), x_covariance);
}

namespace {

/** Where a match settled that began beside the best one. */
struct Settled {
  double along_m;  ///< from the best one, along its weakest direction
  Registration match;
};

/** Those settled closer than apart_m to one another are one place: the best of them, as uncertain along
 * `weakest` (source's frame) as they are spread, and more. In order of fit. */
std::vector<LoopHypothesis> placesOf(std::vector<Settled> settled, const Eigen::Vector3d& weakest,
                                     const LoopOptions& options) {
  std::sort(settled.begin(), settled.end(),
            [](const Settled& a, const Settled& b) { return a.along_m < b.along_m; });
  std::vector<std::pair<double, LoopHypothesis>> places;
  for (auto first = settled.begin(); first != settled.end();) {
    auto last = std::next(first);
    while (last != settled.end() && last->along_m - std::prev(last)->along_m < options.apart_m) ++last;
    const auto best = std::max_element(
        first, last, [](const Settled& a, const Settled& b) { return fitOf(a.match) < fitOf(b.match); });
    const double spread_m =
        std::max(best->along_m - first->along_m, std::prev(last)->along_m - best->along_m);
    LoopHypothesis place{best->match.T_target_source, best->match.covariance, best->match.residual_m,
                         best->match.inlier_share};
    const double believed_m2 = weakest.dot(place.covariance.bottomRightCorner<3, 3>() * weakest);
    const double more_m2 =
        (options.weakest_scale * options.weakest_scale - 1) * believed_m2 + spread_m * spread_m;
    place.covariance.bottomRightCorner<3, 3>() += more_m2 * weakest * weakest.transpose();
    places.emplace_back(fitOf(best->match), place);
    first = last;
  }
  std::stable_sort(places.begin(), places.end(),
                   [](const auto& a, const auto& b) { return a.first > b.first; });
  std::vector<LoopHypothesis> sorted;
  sorted.reserve(places.size());
  for (const auto& place : places) sorted.push_back(place.second);
  return sorted;
}

}  // namespace

LoopMatch LoopMatcher::match(const LoopCandidate& candidate) const {
  const CovarianceCloud source = submap(candidate.j), around = submap(candidate.i);
  gpu::VoxelMap target(x_context, x_gicp.voxel_size_m);
  target.insert(viewOf(around.cloud), around.covariances.view(), {});

  SearchOptions search;
  search.radius_m = candidate.drift_m;
  const Registration best = alignWithSearch(x_context, source, target, candidate.T_i_j, x_gicp, search);
  LoopMatch result{candidate, {}, best.residual_m, best.inlier_share};

  const double reach_m = candidate.drift_m + x_options.apart_m;
  const auto withinReach = [&](const Pose& T_i_j) {
    return (T_i_j.translation() - candidate.T_i_j.translation()).head<2>().norm() <= reach_m;
  };
  if (!best.trusted(x_gicp) || !withinReach(best.T_target_source)) return result;
  std::vector<Settled> settled{{0, best}};
  const Eigen::Vector3d weakest = best.weakest_direction;
  const double step_m = 0.5 * x_options.apart_m;  // where nothing holds a match, it settles where it began
  const int steps = static_cast<int>(std::ceil(2 * reach_m / step_m));
  for (int step = -steps; step <= steps; ++step) {
    const Pose T_start = best.T_target_source * Eigen::Translation3d(step * step_m * weakest);
    if (step == 0 || !withinReach(T_start)) continue;
    const Registration rival = align(x_context, source, target, T_start, x_gicp);
    if (!rival.trusted(x_gicp) || !withinReach(rival.T_target_source) ||
        fitOf(rival) < x_options.rival_share * fitOf(best))
      continue;
    const Pose T_best_rival = best.T_target_source.inverse() * rival.T_target_source;
    settled.push_back({weakest.dot(T_best_rival.translation()), rival});
  }
  result.hypotheses = placesOf(std::move(settled), weakest, x_options);
  return result;
}

// ---- Consistency

namespace {

constexpr double kChiSquare = 22.46;  // 6 degrees of freedom, exceeded by 0.1 % of true ones

/** A hypothesis of a loop, as a node of the graph of agreements. */
struct Node {
  std::size_t loop;  ///< number of its match
  const LoopHypothesis* place;
  std::vector<std::size_t> agree, sharply_agree, contradict;  ///< nodes of neighbouring loops
  std::size_t set = 0;
};

/** How far two hypotheses are from telling the same. */
struct Comparison {
  bool agree;    ///< within their covariances and those of the odometry
  bool sharply;  ///< they do, they are certain enough to tell two places apart, and nearer than those
  double off_m;
};

/** Odometry between two neighbouring loops, on both drives. */
struct Bridge {
  Pose T_ib_ia, T_ja_jb;
  Matrix6d covariance_i, covariance_j;  ///< of those, right increments
};

Comparison compare(const LoopHypothesis& a, const LoopHypothesis& b, const Bridge& bridge, double apart_m) {
  const Pose T_b = bridge.T_ib_ia * a.T_i_j * bridge.T_ja_jb;  // as `a` says
  const Vector6d e = se3Log(b.T_i_j.inverse() * T_b);
  // All as right increments of T_b; the one of T_ib_ia acts to the left of what follows it.
  const Matrix6d from_a = adjoint(bridge.T_ja_jb.inverse());
  const Matrix6d from_i = adjoint((a.T_i_j * bridge.T_ja_jb).inverse());
  const Matrix6d covariance = b.covariance + from_a * a.covariance * from_a.transpose() +
                              from_i * bridge.covariance_i * from_i.transpose() + bridge.covariance_j;
  const double distance2 = e.dot(covariance.ldlt().solve(e));
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> position(covariance.bottomRightCorner<3, 3>(),
                                                                Eigen::EigenvaluesOnly);
  const double off_m = e.tail<3>().norm();
  const bool possible = distance2 <= kChiSquare;
  const bool sharp = std::sqrt(position.eigenvalues()[2]) <= 0.25 * apart_m;
  return {possible, possible && sharp && off_m < apart_m, off_m};
}

/** Hypotheses and who agrees with whom. */
class Agreements {
 public:
  Agreements(const std::vector<LoopMatch>& matches, const OdometryChain& chain, const LoopOptions& options)
      : x_matches(matches), x_chain(chain), x_options(options), x_of_loop(matches.size()) {
    for (std::size_t loop = 0; loop < matches.size(); ++loop)
      for (const auto& place : matches[loop].hypotheses) {
        x_of_loop[loop].push_back(nodes.size());
        nodes.push_back({loop, &place, {}, {}, {}, nodes.size()});
      }
    connect();
    join();
  }

  std::vector<Node> nodes;
  std::vector<std::vector<std::size_t>> sets;  ///< nodes of each, the set with the most loops first

  [[nodiscard]] const std::vector<std::size_t>& ofLoop(std::size_t loop) const { return x_of_loop[loop]; }

  [[nodiscard]] Bridge bridge(std::size_t loop_a, std::size_t loop_b) const {
    const LoopCandidate &a = x_matches[loop_a].candidate, &b = x_matches[loop_b].candidate;
    return {x_chain.T_between(b.i, a.i), x_chain.T_between(a.j, b.j), x_chain.covarianceBetween(b.i, a.i),
            x_chain.covarianceBetween(a.j, b.j)};
  }

 private:
  [[nodiscard]] bool near(std::size_t key_a, std::size_t key_b) const {
    return x_chain.joined(key_a, key_b) &&
           std::abs(x_chain.path_m(key_a) - x_chain.path_m(key_b)) < x_options.neighbour_m;
  }

  void connect() {
    std::vector<std::size_t> by_path(
        x_matches.size());  // along the later drive, where every loop is once or twice
    std::iota(by_path.begin(), by_path.end(), std::size_t{0});
    const auto path_m = [&](std::size_t loop) { return x_chain.path_m(x_matches[loop].candidate.j); };
    std::stable_sort(by_path.begin(), by_path.end(),
                     [&](std::size_t a, std::size_t b) { return path_m(a) < path_m(b); });
    for (auto a = by_path.begin(); a != by_path.end(); ++a)
      for (auto b = std::next(a); b != by_path.end() && path_m(*b) - path_m(*a) < x_options.neighbour_m; ++b)
        if (near(x_matches[*a].candidate.i, x_matches[*b].candidate.i) &&
            near(x_matches[*a].candidate.j, x_matches[*b].candidate.j))
          connect(*a, *b);
  }

  void connect(std::size_t loop_a, std::size_t loop_b) {
    const Bridge between = bridge(loop_a, loop_b);
    for (const std::size_t a : x_of_loop[loop_a])
      for (const std::size_t b : x_of_loop[loop_b]) {
        const Comparison c = compare(*nodes[a].place, *nodes[b].place, between, x_options.apart_m);
        for (const auto& [from, to] : {std::pair{a, b}, std::pair{b, a}}) {
          (c.agree ? nodes[from].agree : nodes[from].contradict).push_back(to);
          if (c.sharply) nodes[from].sharply_agree.push_back(to);
        }
      }
  }

  void join() {
    std::vector<bool> seen(nodes.size(), false);
    for (std::size_t seed = 0; seed < nodes.size(); ++seed) {
      if (seen[seed]) continue;
      std::vector<std::size_t> members{seed};
      seen[seed] = true;
      for (std::size_t k = 0; k < members.size(); ++k)
        for (const std::size_t next : nodes[members[k]].sharply_agree)
          if (!seen[next]) {
            seen[next] = true;
            members.push_back(next);
          }
      sets.push_back(std::move(members));
    }
    std::stable_sort(sets.begin(), sets.end(),
                     [&](const auto& a, const auto& b) { return loopsIn(a).size() > loopsIn(b).size(); });
    for (std::size_t set = 0; set < sets.size(); ++set)
      for (const std::size_t node : sets[set]) nodes[node].set = set;
  }

  [[nodiscard]] std::set<std::size_t> loopsIn(const std::vector<std::size_t>& members) const {
    std::set<std::size_t> loops;
    for (const std::size_t node : members) loops.insert(nodes[node].loop);
    return loops;
  }

  const std::vector<LoopMatch>& x_matches;
  const OdometryChain& x_chain;
  const LoopOptions& x_options;
  std::vector<std::vector<std::size_t>> x_of_loop;
};

/** What became of a loop. */
struct Fate {
  std::optional<std::size_t> kept;  ///< the node that is believed
  bool ambiguous = false;
};

bool isKept(const Agreements& all, const std::vector<Fate>& fates, std::size_t node) {
  return fates[all.nodes[node].loop].kept == node;
}

std::size_t keptAmong(const Agreements& all, const std::vector<Fate>& fates,
                      const std::vector<std::size_t>& nodes) {
  return static_cast<std::size_t>(
      std::count_if(nodes.begin(), nodes.end(), [&](std::size_t node) { return isKept(all, fates, node); }));
}

/** Loops that a set can still speak for: open ones, of which it does not contradict what is kept. */
std::set<std::size_t> openLoops(const Agreements& all, std::size_t set, const std::vector<Fate>& fates) {
  std::set<std::size_t> loops;
  for (const std::size_t member : all.sets[set]) {
    const Node& node = all.nodes[member];
    if (!fates[node.loop].kept && !fates[node.loop].ambiguous && keptAmong(all, fates, node.contradict) == 0)
      loops.insert(node.loop);
  }
  return loops;
}

/** Other sets that say something else of the same loops or of their neighbours. */
std::set<std::size_t> rivalsOf(const Agreements& all, std::size_t set) {
  std::set<std::size_t> rivals;
  for (const std::size_t node : all.sets[set]) {
    for (const std::size_t other : all.ofLoop(all.nodes[node].loop)) rivals.insert(all.nodes[other].set);
    for (const std::size_t other : all.nodes[node].contradict) rivals.insert(all.nodes[other].set);
  }
  rivals.erase(set);
  return rivals;
}

/** Keeps of these nodes what contradicts nothing that is kept, those with most agreement first. */
void keepConsistent(const Agreements& all, std::vector<std::size_t> members, std::vector<Fate>& fates) {
  std::stable_sort(members.begin(), members.end(), [&](std::size_t a, std::size_t b) {
    return all.nodes[a].sharply_agree.size() > all.nodes[b].sharply_agree.size();
  });
  for (const std::size_t member : members) {
    const Node& node = all.nodes[member];
    if (!fates[node.loop].kept && keptAmong(all, fates, node.contradict) == 0) fates[node.loop].kept = member;
  }
}

}  // namespace

LoopClosures consistentLoops(const std::vector<LoopMatch>& matches, const OdometryChain& chain,
                             const LoopOptions& options) {
  const Agreements all(matches, chain, options);
  const auto needed = static_cast<std::size_t>(options.min_agreeing);
  const auto lead = static_cast<std::size_t>(options.min_lead);
  std::vector<Fate> fates(matches.size());
  for (std::size_t set = 0; set < all.sets.size(); ++set) {
    const auto loops = openLoops(all, set, fates);
    if (loops.size() < needed + 1) continue;
    const auto rivals = rivalsOf(all, set);
    const bool ambiguous = std::any_of(rivals.begin(), rivals.end(), [&](std::size_t rival) {
      return openLoops(all, rival, fates).size() + lead > loops.size();
    });
    if (!ambiguous) {
      keepConsistent(all, all.sets[set], fates);
      continue;
    }
    for (const std::size_t rival : rivals)
      for (const std::size_t loop : openLoops(all, rival, fates)) fates[loop].ambiguous = true;
    for (const std::size_t loop : loops) fates[loop].ambiguous = true;
  }
  // Those weak in a direction could not vote; what all kept neighbours agree with may come along.
  const std::vector<Fate> voted = fates;
  for (std::size_t loop = 0; loop < matches.size(); ++loop) {
    if (fates[loop].kept || fates[loop].ambiguous) continue;
    for (const std::size_t node : all.ofLoop(loop))
      if (!fates[loop].kept && keptAmong(all, voted, all.nodes[node].agree) >= needed &&
          keptAmong(all, fates, all.nodes[node].contradict) == 0)
        fates[loop].kept = node;
  }

  LoopClosures closures;
  for (std::size_t loop = 0; loop < matches.size(); ++loop) {
    const LoopMatch& match = matches[loop];
    const LoopCandidate& c = match.candidate;
    if (fates[loop].kept) {
      const Node& node = all.nodes[*fates[loop].kept];
      closures.edges.push_back({c.i, c.j, node.place->T_i_j, node.place->covariance, node.place->residual_m,
                                node.place->overlap, static_cast<int>(keptAmong(all, fates, node.agree)),
                                static_cast<int>(match.hypotheses.size()) - 1});
      continue;
    }
    RefusedLoop refused{c.i, c.j, LoopRefusal::alone, match.residual_m, match.overlap, 0};
    double least_m = std::numeric_limits<double>::infinity();
    for (const std::size_t node : all.ofLoop(loop))
      for (const std::size_t other : all.nodes[node].contradict)
        if (isKept(all, fates, other))
          least_m = std::min(least_m, compare(*all.nodes[node].place, *all.nodes[other].place,
                                              all.bridge(loop, all.nodes[other].loop), options.apart_m)
                                          .off_m);
    if (match.hypotheses.empty()) {
      refused.reason = LoopRefusal::no_match;
    } else if (fates[loop].ambiguous) {
      refused.reason = LoopRefusal::ambiguous;
    } else if (std::isfinite(least_m)) {
      refused.reason = LoopRefusal::disagrees;
      refused.off_m = least_m;
    }
    closures.refused.push_back(refused);
  }
  return closures;
}

std::string text(const RefusedLoop& refused) {
  const char* reason = "";
  switch (refused.reason) {
    case LoopRefusal::no_match:
      reason = "the submaps do not fit";
      break;
    case LoopRefusal::alone:
      reason = "too few neighbours confirm it";
      break;
    case LoopRefusal::disagrees:
      reason = "odometry and neighbours put it elsewhere";
      break;
    case LoopRefusal::ambiguous:
      reason = "it fits as well with all its neighbours shifted";
      break;
  }
  char line[240];
  std::snprintf(line, sizeof line,
                "key poses %zu and %zu: %s (residual %.3f m, overlap %.0f %%, off by %.2f m)", refused.i,
                refused.j, reason, refused.residual_m, 100 * refused.overlap, refused.off_m);
  return line;
}

}  // namespace raceloc
