#include "raceloc/gpu/nearest_target.h"

#include <cmath>

#include "api/check.hpp"
#include "api/nearest_storage.hpp"

namespace raceloc::gpu {

NearestTarget::Storage::Storage(const PointsView& points, const CovariancesView& C) {
  Points taken;
  for (std::size_t i = 0; i < points.size; ++i) {
    const float x = points.x[i], y = points.y[i], z = points.z[i];
    if (!std::isfinite(x) || !std::isfinite(y) || !std::isfinite(z)) {
      ++x_dropped;
      continue;
    }
    taken.x.push_back(x);
    taken.y.push_back(y);
    taken.z.push_back(z);
    x_records.push_back({{x, y, z}, {C.xx[i], C.xy[i], C.xz[i], C.yy[i], C.yz[i], C.zz[i]}, {0, 0, 0}});
  }
  x_tree.build(taken.view());
}

NearestTarget::NearestTarget(const PointsView& points, const CovariancesView& covariances) {
  requireSameSize(points, covariances);
  requireCountable(points.size);
  x_storage = std::make_unique<Storage>(points, covariances);
}

NearestTarget::~NearestTarget() = default;
NearestTarget::NearestTarget(NearestTarget&&) noexcept = default;
NearestTarget& NearestTarget::operator=(NearestTarget&&) noexcept = default;

std::size_t NearestTarget::size() const { return x_storage->records().size(); }
std::size_t NearestTarget::dropped() const { return x_storage->dropped(); }

}  // namespace raceloc::gpu
