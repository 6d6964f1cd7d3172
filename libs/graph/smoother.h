/** \file
 * Incremental smoothing of a pose graph. */
#pragma once

#include <memory>
#include <optional>
#include <set>
#include <vector>

#include "graph/block_cholesky.h"
#include "graph/optimise.h"
#include "graph/pose_graph.h"

namespace raceloc {

struct SmootherOptions {
  /** A pose is at rest while it would move by less than this many of its standard deviations, given its
   * neighbours. */
  double rest_sigma = 0.005;
  /** A factor is linearised anew when its linear model is off by this many sigmas at the estimate. */
  double model_sigma = 0.2;
  int rounds = 6;                            ///< solves per update at most
  std::size_t relinearised_per_update = 16;  ///< factors; if more are off, L is computed anew
};

/** Keeps a pose graph's estimate near the minimum of its cost while poses and factors arrive.
 *
 * The Cholesky factor L of the normal equations is changed, not computed again: new poses are new rows of it, new
 * factors a rank-6 update. Each factor has a linear model, with the Jacobian that L has; an update solves the
 * model exactly where poses are not at rest, from there to the root of the elimination tree, and goes on to the
 * neighbours of those that move. Factors whose model is off at the estimate are taken out of L and put back as they
 * are now. When the changes have cost as much as ordering and factorizing everything anew, or too many models are
 * off, that is done (rent or buy: twice the least cost at most).
 *
 * Work per update goes with the number of poses that move: few between loops, up to all of them at a loop, and at
 * renewals, which come at intervals in proportion to the graph. finish() ends in the batch solution. The same input
 * gives the same bits.
 * Source: Kaess et al., iSAM, T-RO 24(6), 2008, and iSAM2, IJRR 31(2), 2012 (fluid relinearisation, partial
 * propagation); Davis and Hager, SIAM J. Matrix Anal. Appl. 26(3), 2005 (row addition). */
class Smoother {
 public:
  /** \param held  a pose that does not move, for graphs that nothing ties to the map */
  explicit Smoother(const SmootherOptions& options, std::optional<std::size_t> held = std::nullopt);

  /** One step. New poses get the next keys, in order; their values are first guesses. Factors may be of any
   * poses, but every new pose must be determined by the factors there are by now.
   * \throws std::out_of_range if a factor's key is no pose's, std::invalid_argument if a pose is undetermined;
   * after the latter the smoother is of no more use. */
  void update(const std::vector<Pose>& new_T_map_body, const std::vector<Factor>& new_factors);

  /** Takes what is left to the minimum, by optimise(), and renews L there. */
  OptimiseResult finish(const OptimiseOptions& options);

  [[nodiscard]] const PoseGraph& graph() const { return x_graph; }  ///< its poses are the estimate
  /** Covariance of a right increment (rotation [rad], translation [m]) of a pose, all others free: a block of
   * (L L')^-1. \throws std::out_of_range if there is no such pose. */
  [[nodiscard]] Matrix6d marginalCovariance(std::size_t key) const;
  /** How often L was computed anew. */
  [[nodiscard]] int renewals() const { return x_renewals; }

 private:
  struct Way {
    double turn_rad = 0, sigma = 0;
  };
  [[nodiscard]] bool extend(std::size_t old_poses, std::size_t old_factors);
  void renew();
  void relax();
  [[nodiscard]] bool relineariseSome();
  [[nodiscard]] Vector6d modelGradient(std::size_t pose) const;
  [[nodiscard]] double inSigmas(std::size_t pose, const Vector6d& step) const;
  bool move(std::size_t pose, const Vector6d& step, double way_sigma);
  [[nodiscard]] LinearFactor lineariseNow(std::size_t factor) const;
  [[nodiscard]] bool worthRenewing() const;

  SmootherOptions x_options;
  PoseGraph x_graph;
  std::vector<std::vector<std::size_t>> x_factors_of;  ///< of each pose
  std::vector<LinearFactor> x_in_L;                    ///< each factor's linear model, J as L has it
  std::vector<Matrix6d> x_information;                 ///< diagonal blocks of L L', near enough
  std::vector<Way> x_since_check;  ///< how far each pose has gone since its factors were checked
  std::optional<BlockCholesky> x_L;
  std::set<std::size_t> x_restless;  ///< poses to look at
  std::set<std::size_t> x_stale;     ///< factors to linearise anew
  int x_renewals = 0;
};

}  // namespace raceloc
