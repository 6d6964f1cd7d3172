#include "core/se3_lm.hpp"

#include <algorithm>
#include <cmath>

namespace raceloc::gpu {

namespace {

constexpr std::int64_t kFewestInliers = 10;
constexpr double kLargestTurn_rad = 0.5;  // a longer step leaves the range of the linearization
constexpr double kFirstDamping = 1e-3;
constexpr double kCostRounding = 1e-6;  // of the float costs of a pass

double norm3(const double* v) { return std::sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2]); }

bool finite(const Linearization& at) {
  const auto good = [](double x) { return std::isfinite(x); };
  return std::all_of(at.H.begin(), at.H.end(), good) && std::all_of(at.b.begin(), at.b.end(), good) &&
         good(at.cost);
}

bool finite(const Transform& T) {
  const auto good = [](double x) { return std::isfinite(x); };
  return std::all_of(T.R.begin(), T.R.end(), good) && std::all_of(T.t.begin(), T.t.end(), good);
}

bool isShort(const Step& xi, const MatchOptions& o) {
  return norm3(xi.data()) < o.rotation_epsilon_rad && norm3(xi.data() + 3) < o.translation_epsilon_m;
}

Step clamped(Step xi) {
  const double turn_rad = norm3(xi.data());
  if (turn_rad <= kLargestTurn_rad) return xi;
  for (double& x : xi) x *= kLargestTurn_rad / turn_rad;
  return xi;
}

}  // namespace

Transform moved(const Transform& T, const Step& xi) {
  const double x = xi[0], y = xi[1], z = xi[2];
  const double angle2 = x * x + y * y + z * z, angle = std::sqrt(angle2);
  const bool small = angle < 1e-4;  // the series below are exact to 1e-17 there
  const double a = small ? 1 - angle2 / 6 : std::sin(angle) / angle;
  const double b = small ? 0.5 - angle2 / 24 : (1 - std::cos(angle)) / angle2;
  const double c = small ? 1.0 / 6 - angle2 / 120 : (angle - std::sin(angle)) / (angle2 * angle);
  const std::array<double, 9> K{0, -z, y, z, 0, -x, -y, x, 0};
  const std::array<double, 9> K2{x * x - angle2, x * y, x * z, x * y,         y * y - angle2,
                                 y * z,          x * z, y * z, z * z - angle2};
  std::array<double, 9> dR{}, V{};
  for (std::size_t i = 0; i < 9; ++i) {
    const double one = i % 4 == 0 ? 1 : 0;
    dR[i] = one + a * K[i] + b * K2[i];
    V[i] = one + b * K[i] + c * K2[i];
  }
  Transform out;
  for (std::size_t i = 0; i < 3; ++i) {
    out.t[i] = T.t[i];
    for (std::size_t k = 0; k < 3; ++k) {
      out.t[i] += T.R[3 * i + k] * (V[3 * k] * xi[3] + V[3 * k + 1] * xi[4] + V[3 * k + 2] * xi[5]);
    }
    for (std::size_t j = 0; j < 3; ++j) {
      out.R[3 * i + j] = T.R[3 * i] * dR[j] + T.R[3 * i + 1] * dR[3 + j] + T.R[3 * i + 2] * dR[6 + j];
    }
  }
  return out;
}

std::optional<Step> solveStep(const Linearization& at, double damping) {
  constexpr double smallest_pivot = 1e-6;
  std::array<double, 6> scale{};
  for (std::size_t i = 0; i < 6; ++i) {
    if (!(at.H[7 * i] > 0)) return std::nullopt;
    scale[i] = 1 / std::sqrt(at.H[7 * i]);
  }
  std::array<std::array<double, 6>, 6> L{};
  std::array<double, 6> D{};
  Step xi{};
  for (std::size_t i = 0; i < 6; ++i) {
    for (std::size_t j = 0; j < i; ++j) {
      double sum = at.H[6 * i + j] * scale[i] * scale[j];
      for (std::size_t k = 0; k < j; ++k) sum -= L[i][k] * D[k] * L[j][k];
      L[i][j] = sum / D[j];
    }
    D[i] = 1 + damping;
    for (std::size_t k = 0; k < i; ++k) D[i] -= L[i][k] * L[i][k] * D[k];
    if (!(D[i] > smallest_pivot)) return std::nullopt;
    xi[i] = -at.b[i] * scale[i];
    for (std::size_t k = 0; k < i; ++k) xi[i] -= L[i][k] * xi[k];
  }
  for (std::size_t i = 6; i-- > 0;) {
    xi[i] /= D[i];
    for (std::size_t k = i + 1; k < 6; ++k) xi[i] -= L[k][i] * xi[k];
  }
  for (std::size_t i = 0; i < 6; ++i) xi[i] *= scale[i];
  return xi;
}

Match gaussNewton(PassRunner& passes, const Transform& guess, const MatchOptions& options) {
  Match out;
  out.T_map_source = guess;
  out.stop = Stop::not_finite;
  if (!finite(guess)) return out;

  Linearization at = linearization(passes.run(guess));
  double damping = 0;
  const auto run = [&]() -> Stop {
    if (!finite(at)) return Stop::not_finite;
    if (at.inliers < kFewestInliers) return Stop::too_few_inliers;
    passes.freeze();
    while (out.iterations < options.max_iterations) {
      const std::optional<Step> full = solveStep(at, 0);
      if (!full) return Stop::singular;
      ++out.iterations;
      if (isShort(*full, options)) {
        out.T_map_source = moved(out.T_map_source, *full);
        return Stop::converged;
      }
      const std::optional<Step> step = damping > 0 ? solveStep(at, damping) : full;
      if (!step) return Stop::singular;
      const Transform candidate = moved(out.T_map_source, clamped(*step));
      const Pass pass = passes.run(candidate);
      const Linearization there = linearization(pass);
      if (!finite(there)) return Stop::not_finite;
      if (!(pass.sums[kFrozenCost] <= at.cost * (1 + kCostRounding))) {
        damping = std::max(kFirstDamping, 10 * damping);
        continue;
      }
      if (there.inliers < kFewestInliers) return Stop::too_few_inliers;
      out.T_map_source = candidate;
      at = there;
      passes.freeze();
      damping = damping > kFirstDamping ? damping / 10 : 0;
    }
    return Stop::max_iterations;
  };
  out.stop = run();
  out.last = at;
  if (out.stop == Stop::too_few_inliers && out.iterations > 0) {
    out.T_map_source = guess;
    out.last = linearization(passes.run(guess));
  }
  return out;
}

}  // namespace raceloc::gpu
