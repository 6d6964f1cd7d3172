#include <cmath>

#include "core/backend.hpp"

namespace raceloc::gpu {

PassSetup passSetup(const Transform& T_map_source, double voxel_size_m, const MatchOptions& options) {
  const auto& R = T_map_source.R;
  const auto& t = T_map_source.t;
  const auto f = [](double x) { return static_cast<float>(x); };
  PassSetup setup{};
  setup.R_map_source = {f(R[0]), f(R[1]), f(R[2]), f(R[3]), f(R[4]), f(R[5]), f(R[6]), f(R[7]), f(R[8])};
  if (!cellOf(t[0], t[1], t[2], voxel_size_m, setup.anchor))
    setup.anchor = {0, 0, 0};  // no voxel is near anyway
  setup.t_m = {f(t[0] - setup.anchor.x * voxel_size_m), f(t[1] - setup.anchor.y * voxel_size_m),
               f(t[2] - setup.anchor.z * voxel_size_m)};
  setup.voxel_m = f(voxel_size_m);
  setup.voxels_per_m = voxel_size_m > 0 ? f(1 / voxel_size_m) : 0.0F;
  setup.squared_max_distance_m2 = f(options.max_distance_m * options.max_distance_m);
  setup.robust = {f(options.robust_width * options.robust_width)};
  setup.voxels_around = options.neighbour_voxels;
  return setup;
}

Linearization linearization(const Pass& pass) {
  const auto& s = pass.sums;
  Linearization out;
  const auto H = [&out](std::size_t row, std::size_t column) -> double& { return out.H[6 * row + column]; };
  std::size_t upper = 0;
  for (std::size_t i = 0; i < 3; ++i) {
    for (std::size_t j = i; j < 3; ++j, ++upper) {
      H(i, j) = H(j, i) = s[kHrr + upper];
      H(3 + i, 3 + j) = H(3 + j, 3 + i) = s[kHtt + upper];
    }
    for (std::size_t j = 0; j < 3; ++j) H(i, 3 + j) = H(3 + j, i) = s[kHrt + 3 * i + j];
  }
  for (std::size_t i = 0; i < 6; ++i) out.b[i] = s[kB + i];
  out.cost = s[kCost];
  out.squared_distance_m2 = s[kDistance];
  out.pairs = std::llround(s[kPairs]);
  out.inliers = std::llround(s[kInliers]);
  return out;
}

}  // namespace raceloc::gpu
