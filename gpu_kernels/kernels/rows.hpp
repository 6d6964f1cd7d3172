/** \file
 * Points and covariances as the rows of one array, each `n` long: a copy to or from a device takes all of them. */
#pragma once

#include <vector>

#include "core/neighbour_grid.hpp"
#include "raceloc/gpu/types.h"

namespace raceloc::gpu {

inline constexpr std::size_t kPointRows = 3, kCovarianceRows = 6;

/** Where points go. */
struct PointsOut {
  float *x, *y, *z;
  [[nodiscard]] PointsView view(std::size_t n) const { return {x, y, z, n}; }
};

RACELOC_HD PointsOut pointRows(float* rows, std::size_t n) { return {rows, rows + n, rows + 2 * n}; }
inline PointsView pointRows(const float* rows, std::size_t n) { return {rows, rows + n, rows + 2 * n, n}; }

inline CovariancesOut covarianceRows(float* rows, std::size_t n, std::int32_t* neighbours) {
  return {rows, rows + n, rows + 2 * n, rows + 3 * n, rows + 4 * n, rows + 5 * n, neighbours};
}
inline CovariancesView covarianceRows(const float* rows, std::size_t n) {
  return {rows, rows + n, rows + 2 * n, rows + 3 * n, rows + 4 * n, rows + 5 * n, n};
}

/** Copies a row of an array. */
template <class T>
void takeRow(const T* row, std::size_t n, std::vector<T>& into) {
  into.assign(row, row + n);
}

}  // namespace raceloc::gpu
