#include "raceloc/gpu/matcher.h"

#include "api/check.hpp"
#include "api/voxel_map_storage.hpp"
#include "core/se3_lm.hpp"

namespace raceloc::gpu {

namespace {

std::unique_ptr<PassRunner> checkedPasses(Context& context, const PointsView& source,
                                          const CovariancesView& covariances, const VoxelMap& map,
                                          const MatchOptions& o) {
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
  return context.implementation().passes(source, covariances, map.storage().table(), map.storage().mirror(),
                                         o);
}

}  // namespace

Linearization linearize(Context& context, const PointsView& source, const CovariancesView& covariances,
                        const VoxelMap& map, const Transform& T_map_source, const MatchOptions& options) {
  return linearization(checkedPasses(context, source, covariances, map, options)->run(T_map_source));
}

Match match(Context& context, const PointsView& source, const CovariancesView& covariances,
            const VoxelMap& map, const Transform& T_map_source_guess, const MatchOptions& options) {
  return gaussNewton(*checkedPasses(context, source, covariances, map, options), T_map_source_guess, options);
}

}  // namespace raceloc::gpu
