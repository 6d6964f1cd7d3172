/** \file
 * Loops of the pose graph: candidates by racetrack ID, matched as submaps, kept where neighbours agree.
 *
 * \code
 * dict.add({key, key}, *ids.idAt(T_map_body.back()), session);         // O(1) each
 * for (const auto& c : loopCandidates(dict, T_map_body, options)) matches.push_back(matcher.match(c));
 * const LoopClosures loops = consistentLoops(matches, chain, options); // over all matches so far
 * \endcode
 * Source: reading.md section 3, eq_loop_factor. */
#pragma once

#include <raceloc/gpu/context.h>

#include <functional>
#include <string>
#include <vector>

#include "cloud/covariances.h"
#include "core/options.h"
#include "graph/keyframe.h"
#include "registration/gicp_options.h"
#include "track/racetrack_dict.h"

namespace raceloc {

/** Section [loops]. */
struct LoopOptions {
  int every_ids = 10;
  int neighbour_ids = 1;
  int max_per_key = 2;
  double search_m = 8;
  double submap_m = 15;
  int submap_scans = 7;
  double submap_voxel_m = 0.5;
  double apart_m = 2;
  double rival_share = 0.88;
  double weakest_scale = 2;
  double neighbour_m = 250;
  int min_agreeing = 2;
  int min_lead = 2;
  void describe(OptionList& keys);
};

/** Odometry from one key pose to another, in O(1). A key pose whose motion since the last one has no duration begins
 * a new part (a session): no odometry leads to it. */
class OdometryChain {
 public:
  void add(const BodyMotion& since_last);

  [[nodiscard]] std::size_t size() const { return x_keys.size(); }
  [[nodiscard]] bool joined(std::size_t a, std::size_t b) const;  ///< of one part
  [[nodiscard]] double path_m(std::size_t key) const;             ///< driven since the first key pose
  [[nodiscard]] Pose T_between(std::size_t a,
                               std::size_t b) const;  ///< T_a_b; a and b joined, either may be first
  [[nodiscard]] Matrix6d covarianceBetween(std::size_t a,
                                           std::size_t b) const;  ///< of T_a_b, right increment

 private:
  struct Key {
    Pose T_part_body;
    Matrix6d
        covariance_part;  ///< of the steps so far, all of them carried into the part's frame and added up
    double path_m;
    int part;
  };
  std::vector<Key> x_keys;
};

/** Two key poses that may have seen the same place. */
struct LoopCandidate {
  std::size_t i, j;  ///< numbers in the LiDAR graph (key_L), i < j
  Pose T_i_j;        ///< as it is believed so far
  double drift_m;    ///< how far from the truth that may be, in the plane: the radius of the search
};

/** Candidates of the key pose that the dictionary took last: earlier passes over its ID, or else over an ID up to
 * neighbour_ids away, at most max_per_key of them, the first pass and the latest ones; none but every every_ids
 * way-points. O(1): independent of the number of laps and of key poses.
 * \param T_map_body  estimates so far, by key_L */
[[nodiscard]] std::vector<LoopCandidate> loopCandidates(const RacetrackDict& dict,
                                                        const std::vector<Pose>& T_map_body,
                                                        const LoopOptions& options);

/** One place where the submap of j fits into that of i. */
struct LoopHypothesis {
  Pose T_i_j;
  /** Right increment (rad, m): the match's, but along its weakest direction with weakest_scale times its sigma and the
   * spread of where matches settle that start beside it. So a direction that nothing in the scene holds is weak. */
  Matrix6d covariance;
  double residual_m;  ///< of the match, see Registration
  double overlap;     ///< its inlier share, 0..1
};

/** All of them for one candidate: several, where posts repeat. */
struct LoopMatch {
  LoopCandidate candidate;
  std::vector<LoopHypothesis> hypotheses;  ///< the best fit first; empty: nothing fits
  double residual_m, overlap;              ///< of the best fit, trusted or not
};

/** The scan of a key pose: body frame, de-skewed; called as often as submaps need it. */
using KeyScans = std::function<Cloud(std::size_t key)>;

/** Matches candidates by submaps: up to submap_scans key scans within submap_m along the drive, by odometry in the
 * frame of the key pose, one point a voxel. From the guess by alignWithSearch() within drift_m; then, from steps of
 * apart_m / 2 to both sides along the weakest direction of that match, by align(): where those settle elsewhere and
 * fit nearly as well (rival_share), the place repeats itself. Keeps references to the context and the chain. */
class LoopMatcher {
 public:
  LoopMatcher(gpu::Context& context, const OdometryChain& chain, KeyScans scans, const LoopOptions& options,
              const GicpOptions& gicp, const CovarianceOptions& covariance);
  /** \throws std::out_of_range for a key that is not in the chain */
  [[nodiscard]] LoopMatch match(const LoopCandidate& candidate) const;

 private:
  [[nodiscard]] CovarianceCloud submap(std::size_t key) const;

  gpu::Context& x_context;
  const OdometryChain& x_chain;
  KeyScans x_scans;
  LoopOptions x_options;
  GicpOptions x_gicp;
  CovarianceOptions x_covariance;
};

/** A loop for the graph: T_i_j with its covariance (right increment: rad, m). */
struct LoopEdge {
  std::size_t i, j;
  Pose T_i_j;
  Matrix6d covariance;
  double residual_m, overlap;
  int agreeing;  ///< kept neighbours; it agrees with every one of them
  int rivals;    ///< other places where it fits too: the neighbours decided
};

enum class LoopRefusal {
  no_match,   ///< the submaps do not fit anywhere within the search
  alone,      ///< fewer than min_agreeing neighbours confirm it
  disagrees,  ///< odometry and kept neighbours put it elsewhere
  ambiguous,  ///< it and its neighbours fit nearly as well shifted all together
};

struct RefusedLoop {
  std::size_t i, j;
  LoopRefusal reason;
  double residual_m, overlap;  ///< of the best fit
  double off_m;                ///< `disagrees`: the least by which it misses a kept neighbour's word; else 0
};
/** "key poses 12 and 3400: too few neighbours confirm it (residual 0.150 m, ...)": a line of the QA report. */
[[nodiscard]] std::string text(const RefusedLoop& refused);

/** In the order of the matches. */
struct LoopClosures {
  std::vector<LoopEdge> edges;
  std::vector<RefusedLoop> refused;
};

/** Which hypotheses to believe. Two loops less than neighbour_m apart along both drives are neighbours; with the
 * odometry T_ib_ia, T_ja_jb between them they agree if
 *   e = log(T_b^-1 * T_ib_ia * T_a * T_ja_jb)
 * passes a chi-square test (6 degrees of freedom, 0.1 %) under the covariances of all four; else they contradict each
 * other. Agreement is sharp if e is shorter than apart_m and its sigma at most apart_m / 4: then it tells one place
 * from the next. Hypotheses joined by sharp agreement form a set. The sets with the most loops come first, and of each
 * those are kept, the ones with most agreement first, that contradict nothing kept.
 *
 * Posts one off make a set too, but only of places where posts are all there is, while the truth is in every place's
 * list. So a set is believed only if it has min_agreeing + 1 loops, and min_lead more than any set that contradicts it
 * or speaks for the same loops; else both are ambiguous. Loops weak in a direction vote for nothing; they are kept if
 * they agree with min_agreeing kept neighbours and contradict none.
 *
 * The covariances of the odometry must be honest: floor them before. Pure: the order of the matches does not matter
 * but for ties. Source: pairwise consistency, Mangelson et al., ICRA 2018; here on windows of the drive, with rivals.
 * */
[[nodiscard]] LoopClosures consistentLoops(const std::vector<LoopMatch>& matches, const OdometryChain& chain,
                                           const LoopOptions& options);

}  // namespace raceloc
