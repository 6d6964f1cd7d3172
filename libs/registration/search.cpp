#include "registration/search.h"

#include <algorithm>
#include <cmath>
#include <vector>

namespace raceloc {

void SearchOptions::describe(OptionList& keys) {
  keys.add("radius_m", radius_m, between(0, 200),
           "how far from the receiver's position the car is looked for [m]");
  keys.add("step_m", step_m, above(0.1), "distance between guesses [m]; about what a match can bridge");
  keys.add("finalists", finalists, between(1, 100), "guesses that are matched in full");
  keys.add("points", points, between(10, 1e6), "points of the scan that rank the guesses");
}

namespace {

/** Every n-th point, so that about `count` are left. */
CovarianceCloud thinned(const CovarianceCloud& full, std::size_t count) {
  const std::size_t stride = std::max<std::size_t>(1, full.cloud.size() / std::max<std::size_t>(1, count));
  CovarianceCloud some;
  for (std::size_t i = 0; i < full.cloud.size(); i += stride) {
    some.cloud.push(full.cloud.point(i));
    const gpu::Covariances& from = full.covariances;
    gpu::Covariances& to = some.covariances;
    to.xx.push_back(from.xx[i]);
    to.xy.push_back(from.xy[i]);
    to.xz.push_back(from.xz[i]);
    to.yy.push_back(from.yy[i]);
    to.yz.push_back(from.yz[i]);
    to.zz.push_back(from.zz[i]);
    to.neighbours.push_back(from.neighbours[i]);
  }
  return some;
}

struct Guess {
  std::int64_t inliers;
  double distance_m;  ///< from the given guess: the nearer of two equal ones is tried first
  Pose T_target_source;
};

}  // namespace

double fitOf(const Registration& match) { return match.inlier_share / (match.residual_m + 1e-3); }

Registration alignWithSearch(gpu::Context& context, const CovarianceCloud& source,
                             const gpu::VoxelMap& target, const Pose& T_target_source_guess,
                             const GicpOptions& options, const SearchOptions& search) {
  const CovarianceCloud some = thinned(source, static_cast<std::size_t>(search.points));
  std::vector<Guess> guesses;
  const int steps = static_cast<int>(search.radius_m / search.step_m);
  for (int ix = -steps; ix <= steps; ++ix)
    for (int iy = -steps; iy <= steps; ++iy) {
      const Eigen::Vector3d shift_m(ix * search.step_m, iy * search.step_m, 0);
      if (shift_m.norm() > search.radius_m) continue;
      const Pose T = Eigen::Translation3d(shift_m) * T_target_source_guess;
      const auto pass = gpu::linearize(context, viewOf(some.cloud), some.covariances.view(), target,
                                       toTransform(T), options.forKernels());
      guesses.push_back({pass.inliers, shift_m.norm(), T});
    }
  const auto better = [](const Guess& a, const Guess& b) {
    return a.inliers != b.inliers ? a.inliers > b.inliers : a.distance_m < b.distance_m;
  };
  std::stable_sort(guesses.begin(), guesses.end(), better);
  guesses.resize(std::min(guesses.size(), static_cast<std::size_t>(search.finalists)));

  const auto score = [&](const Registration& r) { return r.trusted(options) ? fitOf(r) : -1.0; };
  Registration best = align(context, source, target, T_target_source_guess, options);
  for (const auto& guess : guesses) {
    const Registration r = align(context, source, target, guess.T_target_source, options);
    if (score(r) > score(best)) best = r;
  }
  return best;
}

}  // namespace raceloc
