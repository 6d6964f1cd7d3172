/** \file
 * Cholesky factor of a pose graph's normal equations, in blocks of six: a thin owner of CHOLMOD's objects.
 * Ordering, factorization, update, downdate and triangular solves are SuiteSparse's.
 * Source: Chen et al., CHOLMOD, ACM TOMS 35(3), 2008; Davis and Hager, Dynamic supernodes in sparse Cholesky
 * update/downdate and triangular solves, ACM TOMS 35(4), 2009. */
#pragma once

#include <functional>
#include <memory>
#include <utility>
#include <vector>

#include "graph/pose_graph.h"

namespace raceloc {

class BlockCholesky {
 public:
  /** Orders the poses (AMD on the graph of poses, not of their 6 numbers each) and analyses the pattern.
   * \param links   pairs of poses with a factor between them, in any order, repeated or not
   * \param spare   0: a factor that is only ever computed whole, supernodal where that pays. Else one that
   *                can be changed (simplicial L D L'), with room for so many poses to come; the newest poses
   *                are then ordered last, because the next factors will be theirs. */
  BlockCholesky(std::size_t poses, const std::vector<std::pair<std::size_t, std::size_t>>& links,
                std::size_t spare = 0);
  ~BlockCholesky();
  BlockCholesky(BlockCholesky&&) noexcept;
  BlockCholesky& operator=(BlockCholesky&&) noexcept;

  /** \name The whole system
   * @{ */
  void clear();                        ///< H = 0
  void add(const LinearFactor& term);  ///< H += J' J; its pair must be among the links
  void hold(std::size_t pose);         ///< H += I on a pose whose Jacobians are zero
  /** Factorizes H + damping * diag(H). False: not positive definite, the factor is of no use. */
  [[nodiscard]] bool factorize(double damping = 0);
  [[nodiscard]] Eigen::VectorXd solve(const Eigen::VectorXd& b) const;  ///< H x = b, all poses
  /** @} */

  /** \name Changes of a factor with room; false: it is no longer positive definite, build a new one
   * @{ */
  [[nodiscard]] std::size_t room() const;  ///< poses that can still be appended
  [[nodiscard]] bool update(const std::vector<LinearFactor>& terms) { return change(terms, true); }
  [[nodiscard]] bool downdate(const std::vector<LinearFactor>& terms) { return change(terms, false); }
  /** Appends the next pose: `diagonal` is its block of H, `columns` are blocks (pose, H_pose_new) of poses
   * before it. */
  [[nodiscard]] bool append(const Matrix6d& diagonal,
                            const std::vector<std::pair<std::size_t, Matrix6d>>& columns);
  using Visit = std::function<bool(std::size_t pose, const Vector6d& x)>;
  /** Solves H x = b where b is zero outside the poses given: exactly on the paths from them to the root of the
   * elimination tree, and on down from it below poses that move. What is left out would hardly move.
   * \param visit  gets each x once, ancestors first, and says whether that pose moves
   * Source: Kaess et al., iSAM2, IJRR 31(2), 2012 (partial state updates). */
  void solveMoving(const std::vector<std::pair<std::size_t, Vector6d>>& b, const Visit& visit) const;
  /** Block of H^-1. */
  [[nodiscard]] Matrix6d inverseBlock(std::size_t pose) const;
  /** @} */

  /** Floating point operations: of factorizing once, and of all changes since. */
  [[nodiscard]] double flopsWhole() const;
  [[nodiscard]] double flopsChanged() const;

 private:
  [[nodiscard]] bool change(const std::vector<LinearFactor>& terms, bool up);
  struct Store;
  std::unique_ptr<Store> x_;
};

}  // namespace raceloc
