/** \file
 * Smooth closed curves through points at equal steps. */
#pragma once

#include <Eigen/Core>
#include <Eigen/SparseCholesky>
#include <cmath>
#include <cstddef>
#include <stdexcept>
#include <vector>

namespace raceloc {

/** Cubic spline of N channels through equally spaced knots on a closed curve: twice continuously
 * differentiable everywhere, the seam included. */
template <int N>
class PeriodicSpline {
 public:
  using Vector = Eigen::Matrix<double, N, 1>;
  struct Value {
    Vector value, first, second;  ///< with its derivatives by the parameter
  };

  PeriodicSpline() = default;

  /** \param knots at the parameters 0, step, 2 step, ...; the first is not repeated at the end
   * \throws std::invalid_argument for fewer than 4 knots or a step that is not positive. */
  PeriodicSpline(std::vector<Vector> knots, double step) : x_knots(std::move(knots)), x_step(step) {
    const auto n = static_cast<Eigen::Index>(x_knots.size());
    if (n < 4 || !(step > 0))
      throw std::invalid_argument("PeriodicSpline: needs 4 knots and a positive step");
    // Second derivatives M: M[i-1] + 4 M[i] + M[i+1] = 6 (y[i-1] - 2 y[i] + y[i+1]) / step^2, cyclic.
    std::vector<Eigen::Triplet<double>> entries;
    Eigen::Matrix<double, Eigen::Dynamic, N> right(n, N);
    for (Eigen::Index i = 0; i < n; ++i) {
      const Eigen::Index before = (i + n - 1) % n, after = (i + 1) % n;
      entries.emplace_back(i, i, 4);
      entries.emplace_back(i, before, 1);
      entries.emplace_back(i, after, 1);
      right.row(i) = 6 / (step * step) * (at(before) - 2 * at(i) + at(after)).transpose();
    }
    Eigen::SparseMatrix<double> cyclic(n, n);
    cyclic.setFromTriplets(entries.begin(), entries.end());
    const Eigen::SimplicialLDLT<Eigen::SparseMatrix<double>> solver(cyclic);
    const Eigen::Matrix<double, Eigen::Dynamic, N> second = solver.solve(right);
    x_second.resize(x_knots.size());
    for (Eigen::Index i = 0; i < n; ++i) x_second[static_cast<std::size_t>(i)] = second.row(i).transpose();
  }

  [[nodiscard]] double period() const { return x_step * static_cast<double>(x_knots.size()); }
  [[nodiscard]] std::size_t size() const { return x_knots.size(); }

  /** At any parameter; one beyond the period wraps. */
  [[nodiscard]] Value operator()(double parameter) const {
    const double turns = parameter / period();
    const double knot = (turns - std::floor(turns)) * static_cast<double>(size());
    const auto i = std::min(static_cast<std::size_t>(knot), size() - 1);
    const std::size_t j = i + 1 == size() ? 0 : i + 1;
    const double b = knot - static_cast<double>(i), a = 1 - b, h = x_step;
    const Vector &y0 = x_knots[i], &y1 = x_knots[j], &m0 = x_second[i], &m1 = x_second[j];
    Value v;
    v.value = a * y0 + b * y1 + h * h / 6 * ((a * a * a - a) * m0 + (b * b * b - b) * m1);
    v.first = (y1 - y0) / h + h / 6 * ((1 - 3 * a * a) * m0 + (3 * b * b - 1) * m1);
    v.second = a * m0 + b * m1;
    return v;
  }

 private:
  [[nodiscard]] const Vector& at(Eigen::Index i) const { return x_knots[static_cast<std::size_t>(i)]; }
  std::vector<Vector> x_knots, x_second;
  double x_step = 1;
};

}  // namespace raceloc
