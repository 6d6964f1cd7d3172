#include "graph/smoother.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <utility>

namespace raceloc {

namespace {

/** L gets room for this many poses, or for half as many as it has. */
constexpr std::size_t kLeastRoom = 256;
/** What a renewal costs in flops of updates, which run at about a fourth of the speed of a factorization's;
 * measured. Ordering, linearising and assembling take as long as kRenewalPerPose flops a pose. */
constexpr double kRenewalPerFlop = 0.25, kRenewalPerPose = 3e4;

}  // namespace

Smoother::Smoother(const SmootherOptions& options, std::optional<std::size_t> held) : x_options(options) {
  x_graph.held = held;
}

LinearFactor Smoother::lineariseNow(std::size_t factor) const {
  return linearise(x_graph.factors[factor], x_graph.T_map_body, x_graph.held);
}

void Smoother::update(const std::vector<Pose>& new_T_map_body, const std::vector<Factor>& new_factors) {
  const std::size_t old_poses = x_graph.T_map_body.size(), old_factors = x_graph.factors.size();
  const std::size_t poses = old_poses + new_T_map_body.size();
  for (const Factor& factor : new_factors)
    if (firstKey(factor) >= poses || (secondKey(factor) >= poses && secondKey(factor) != kNoPose))
      throw std::out_of_range("Smoother: a factor of a pose that is not there");

  x_graph.T_map_body.insert(x_graph.T_map_body.end(), new_T_map_body.begin(), new_T_map_body.end());
  x_graph.factors.insert(x_graph.factors.end(), new_factors.begin(), new_factors.end());
  x_factors_of.resize(poses);
  x_information.resize(poses, Matrix6d::Zero());
  x_since_check.resize(poses);
  for (std::size_t f = old_factors; f < x_graph.factors.size(); ++f) {
    const LinearFactor term = lineariseNow(f);
    x_in_L.push_back(term);
    x_factors_of[term.i].push_back(f);
    x_restless.insert(term.i);
    x_information[term.i] += term.J_i.transpose() * term.J_i;
    if (term.j == kNoPose) continue;
    x_factors_of[term.j].push_back(f);
    x_restless.insert(term.j);
    x_information[term.j] += term.J_j.transpose() * term.J_j;
  }
  if (x_graph.held && *x_graph.held >= old_poses && *x_graph.held < poses)
    x_information[*x_graph.held] += Matrix6d::Identity();
  if (!x_L || x_L->room() < new_T_map_body.size() || !extend(old_poses, old_factors)) renew();
  relax();
  for (int round = 1; round < x_options.rounds && !x_stale.empty(); ++round) {
    if (!relineariseSome()) renew();
    relax();
  }
  if (worthRenewing()) {
    renew();
    relax();
  }
}

/** Rows of the new poses, from `old_poses` on, and the new factors, from `old_factors` on, into L. */
bool Smoother::extend(std::size_t old_poses, std::size_t old_factors) {
  // A new factor's part on poses that L has is an update; the rest of it comes with the rows of its new poses.
  std::vector<LinearFactor> on_old;
  for (std::size_t f = old_factors; f < x_in_L.size(); ++f) {
    LinearFactor term = x_in_L[f];
    if (term.i >= old_poses) {
      if (term.j >= old_poses) continue;
      std::swap(term.i, term.j);
      std::swap(term.J_i, term.J_j);
    }
    if (term.j != kNoPose && term.j >= old_poses) term.j = kNoPose;
    on_old.push_back(term);
  }
  if (!x_L->update(on_old)) return false;
  for (std::size_t pose = old_poses; pose < x_graph.T_map_body.size(); ++pose) {
    std::vector<std::pair<std::size_t, Matrix6d>> columns;
    for (const std::size_t f : x_factors_of[pose]) {
      const LinearFactor& term = x_in_L[f];
      const bool first = term.i == pose;
      const std::size_t other = first ? term.j : term.i;
      if (other >= pose) continue;  // kNoPose too
      const Matrix6d block =
          first ? Matrix6d(term.J_j.transpose() * term.J_i) : Matrix6d(term.J_i.transpose() * term.J_j);
      const auto there = std::find_if(columns.begin(), columns.end(),
                                      [&](const auto& column) { return column.first == other; });
      if (there == columns.end())
        columns.emplace_back(other, block);
      else
        there->second += block;
    }
    if (!x_L->append(x_information[pose], columns)) return false;
  }
  return true;
}

/** Orders, linearises and factorizes the whole graph at the estimate. */
void Smoother::renew() {
  const std::size_t poses = x_graph.T_map_body.size();
  std::vector<std::pair<std::size_t, std::size_t>> links;
  for (const LinearFactor& term : x_in_L)
    if (term.j != kNoPose) links.emplace_back(term.i, term.j);
  x_L.emplace(poses, links, std::max(kLeastRoom, poses / 2));
  x_L->clear();
  if (x_graph.held) x_L->hold(*x_graph.held);
  x_information.assign(poses, Matrix6d::Zero());
  if (x_graph.held) x_information[*x_graph.held].setIdentity();
  for (std::size_t f = 0; f < x_in_L.size(); ++f) {
    const LinearFactor term = x_in_L[f] = lineariseNow(f);
    x_L->add(term);
    x_information[term.i] += term.J_i.transpose() * term.J_i;
    if (term.j == kNoPose) continue;
    x_information[term.j] += term.J_j.transpose() * term.J_j;
  }
  if (!x_L->factorize()) throw std::invalid_argument("Smoother: the factors leave a pose undetermined");
  x_stale.clear();
  x_restless.clear();
  for (std::size_t pose = 0; pose < poses; ++pose) x_restless.insert(x_restless.end(), pose);
  ++x_renewals;
}

/** Solves the linear model where poses are not at rest, and moves what moves. */
void Smoother::relax() {
  std::vector<std::pair<std::size_t, Vector6d>> pushes;
  bool all_at_rest = true;
  for (const std::size_t pose : std::exchange(x_restless, {})) {
    const Vector6d g = modelGradient(pose);
    all_at_rest = all_at_rest &&
                  g.dot(x_information[pose].llt().solve(g)) < x_options.rest_sigma * x_options.rest_sigma;
    pushes.emplace_back(pose, -g);
  }
  if (all_at_rest) return;
  std::vector<std::size_t> far;
  x_L->solveMoving(pushes, [&](std::size_t pose, const Vector6d& step) {
    const double way_sigma = inSigmas(pose, step);
    if (way_sigma < x_options.rest_sigma) return false;  // not taken: what pushed the pose is still there
    if (move(pose, step, way_sigma)) far.push_back(pose);
    return true;
  });
  std::vector<std::size_t> in_doubt;
  for (const std::size_t pose : far) {
    x_since_check[pose] = {};
    in_doubt.insert(in_doubt.end(), x_factors_of[pose].begin(), x_factors_of[pose].end());
  }
  std::sort(in_doubt.begin(), in_doubt.end());
  in_doubt.erase(std::unique(in_doubt.begin(), in_doubt.end()), in_doubt.end());  // of two poses: once
  for (const std::size_t f : in_doubt)
    if ((residualOf(x_graph.factors[f], x_graph.T_map_body).r - x_in_L[f].r).norm() > x_options.model_sigma)
      x_stale.insert(f);
}

double Smoother::inSigmas(std::size_t pose, const Vector6d& step) const {
  return std::sqrt(step.dot(x_information[pose] * step));
}

Vector6d Smoother::modelGradient(std::size_t pose) const {
  Vector6d g = Vector6d::Zero();
  for (const std::size_t f : x_factors_of[pose])
    g += (x_in_L[f].i == pose ? x_in_L[f].J_i : x_in_L[f].J_j).transpose() * x_in_L[f].r;
  return g;
}

/** Moves a pose, and the residuals of its factors as the linear model has them. \return whether it has come so far
 * that the models of its factors may be off: their errors are of second order, a turn times a way */
bool Smoother::move(std::size_t pose, const Vector6d& step, double way_sigma) {
  x_graph.T_map_body[pose] = x_graph.T_map_body[pose] * se3Exp(step);
  for (const std::size_t f : x_factors_of[pose])
    x_in_L[f].r += (x_in_L[f].i == pose ? x_in_L[f].J_i : x_in_L[f].J_j) * step;
  Way& way = x_since_check[pose];
  way.turn_rad += step.head<3>().norm();
  way.sigma += way_sigma;
  return way.turn_rad * way.sigma > 0.5 * x_options.model_sigma;
}

/** False: there is too much to do, or L did not survive. */
bool Smoother::relineariseSome() {
  if (x_stale.size() > x_options.relinearised_per_update) return false;
  std::vector<LinearFactor> before, after;
  for (const std::size_t f : std::exchange(x_stale, {})) {
    LinearFactor& term = x_in_L[f];
    before.push_back(term);
    x_information[term.i] -= term.J_i.transpose() * term.J_i;
    if (term.j != kNoPose) x_information[term.j] -= term.J_j.transpose() * term.J_j;
    term = lineariseNow(f);
    after.push_back(term);
    x_information[term.i] += term.J_i.transpose() * term.J_i;
    x_restless.insert(term.i);
    if (term.j == kNoPose) continue;
    x_information[term.j] += term.J_j.transpose() * term.J_j;
    x_restless.insert(term.j);
  }
  return x_L->update(after) && x_L->downdate(before);  // in this order it is never indefinite on the way
}

bool Smoother::worthRenewing() const {
  return x_L->flopsChanged() > kRenewalPerFlop * x_L->flopsWhole() +
                                   kRenewalPerPose * static_cast<double>(x_graph.T_map_body.size());
}

OptimiseResult Smoother::finish(const OptimiseOptions& options) {
  const OptimiseResult result = optimise(x_graph, options);
  renew();
  return result;
}

Matrix6d Smoother::marginalCovariance(std::size_t key) const {
  if (key >= x_graph.T_map_body.size()) throw std::out_of_range("Smoother: no such pose");
  return x_L->inverseBlock(key);
}

}  // namespace raceloc
