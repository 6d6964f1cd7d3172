#include "raceloc/gpu/matcher.h"

#include "api/check.hpp"
#include "api/voxel_map_storage.hpp"
#include "core/se3_lm.hpp"

namespace raceloc::gpu {

namespace {

void check(const PointsView& source, const CovariancesView& covariances, const MatchOptions& o) {
  requireSameSize(source, covariances);
  requireCountable(source.size);
  require(o.max_iterations >= 1, "max_iterations", o.max_iterations, ">= 1");
  requirePositive("translation_epsilon_m", o.translation_epsilon_m);
  requirePositive("rotation_epsilon_rad", o.rotation_epsilon_rad);
  require(o.neighbour_voxels == 1 || o.neighbour_voxels == 7 || o.neighbour_voxels == 27, "neighbour_voxels",
          o.neighbour_voxels, "1, 7 or 27");
  require(o.robust_width >= 0 && std::isfinite(o.robust_width), "robust_width", o.robust_width,
          "finite and >= 0");
  requirePositive("max_distance_m", o.max_distance_m);
}

/** Calls `use` with the passes of a source against a voxel map. */
template <class Use>
auto withPasses(Context& context, const PointsView& source, const CovariancesView& covariances,
                const VoxelMap& map, const MatchOptions& options, const Use& use) {
  check(source, covariances, options);
  return use(context.implementation().passes(source, covariances, map.storage().table(),
                                             map.storage().mirror(), options));
}

/** The same against points. */
template <class Use>
auto withPasses(Context& context, const PointsView& source, const CovariancesView& covariances,
                const NearestTarget& target, const MatchOptions& options, const Use& use) {
  check(source, covariances, options);
  if (context.backend() == Backend::cpu)
    return use(context.implementation().nearestPasses(source, covariances, target.storage(), options));
  const auto cpu = makeCpuBackend(1);
  return use(cpu->nearestPasses(source, covariances, target.storage(), options));
}

}  // namespace

Linearization linearize(Context& context, const PointsView& source, const CovariancesView& covariances,
                        const VoxelMap& map, const Transform& T_map_source, const MatchOptions& options) {
  return withPasses(context, source, covariances, map, options,
                    [&](PassRunner& passes) { return linearization(passes.run(T_map_source)); });
}

Linearization linearize(Context& context, const PointsView& source, const CovariancesView& covariances,
                        const NearestTarget& target, const Transform& T_target_source,
                        const MatchOptions& options) {
  return withPasses(context, source, covariances, target, options,
                    [&](PassRunner& passes) { return linearization(passes.run(T_target_source)); });
}

Match match(Context& context, const PointsView& source, const CovariancesView& covariances,
            const VoxelMap& map, const Transform& T_map_source_guess, const MatchOptions& options) {
  return withPasses(context, source, covariances, map, options,
                    [&](PassRunner& passes) { return gaussNewton(passes, T_map_source_guess, options); });
}

Match match(Context& context, const PreparedScan& source, const VoxelMap& map,
            const Transform& T_map_source_guess, const MatchOptions& options) {
  check(source.points.view(), source.covariances.view(), options);
  return gaussNewton(
      context.implementation().passes(source, map.storage().table(), map.storage().mirror(), options),
      T_map_source_guess, options);
}

Match match(Context& context, const PointsView& source, const CovariancesView& covariances,
            const NearestTarget& target, const Transform& T_target_source_guess,
            const MatchOptions& options) {
  return withPasses(context, source, covariances, target, options,
                    [&](PassRunner& passes) { return gaussNewton(passes, T_target_source_guess, options); });
}

std::vector<Match> matchAll(Context& context, const PointsView& source, const CovariancesView& covariances,
                            const VoxelMap& map, const std::vector<Transform>& T_map_source_guesses,
                            const MatchOptions& options) {
  return withPasses(context, source, covariances, map, options, [&](PassRunner& passes) {
    std::vector<Match> matches;
    matches.reserve(T_map_source_guesses.size());
    for (const Transform& guess : T_map_source_guesses)
      matches.push_back(gaussNewton(passes, guess, options));
    return matches;
  });
}

}  // namespace raceloc::gpu
