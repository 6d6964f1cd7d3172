#include "wall/wall_path.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "cloud/deskew.h"

namespace raceloc {

namespace {

constexpr double kSlowest_mps = 5;  // limits per v^2 would have no bound

/** The shift: a quintic from (offset, slope, bend) at x = 0 to (0, 0, 0) at x = length. */
struct Shift {
  double offset_m, slope, bend_per_m, length_m;

  /** Its n-th derivative by x, n = 0 .. 3. */
  [[nodiscard]] double at(double x_m, int n) const {
    if (x_m >= length_m) return 0;
    const double L = length_m, u = x_m / L, v = 1 - u;
    // Of the three boundary polynomials v^3 (1 + 3 u + 6 u^2), u v^3 (1 + 3 u), u^2 v^3 / 2.
    Eigen::Vector3d p;
    switch (n) {
      case 0:
        p << v * v * v * (1 + 3 * u + 6 * u * u), u * v * v * v * (1 + 3 * u), 0.5 * u * u * v * v * v;
        break;
      case 1:
        p << -30 * u * u * v * v, v * v * (1 + 2 * u - 15 * u * u), 0.5 * u * v * v * (2 - 5 * u);
        break;
      case 2:
        p << -60 * u * v * (1 - 2 * u), -12 * u * v * (3 - 5 * u), v * (1 - 8 * u + 10 * u * u);
        break;
      default:
        p << -60 * (1 - 6 * u + 6 * u * u), -12 * (3 - 16 * u + 15 * u * u), -9 + 36 * u - 30 * u * u;
    }
    return Eigen::Vector3d(offset_m, slope * L, bend_per_m * L * L).dot(p) / std::pow(L, n);
  }

  /** The largest |n-th derivative|, of 33 places. */
  [[nodiscard]] double most(int n) const {
    constexpr int kPlaces = 32;
    double most = 0;
    for (int k = 0; k <= kPlaces; ++k)
      most = std::max(most, std::abs(at(length_m * k / kPlaces * (1 - 1e-9), n)));
    return most;
  }
};

/** p_w(x) and the shift onto it. */
struct Line {
  Eigen::Vector3d beta;
  Shift shift;
  [[nodiscard]] double y_m(double x_m) const {
    return beta[0] + x_m * (beta[1] + x_m * beta[2]) + shift.at(x_m, 0);
  }
  [[nodiscard]] double slope(double x_m) const { return beta[1] + 2 * x_m * beta[2] + shift.at(x_m, 1); }
  [[nodiscard]] double curvature_per_m(double x_m) const {
    return (2 * beta[2] + shift.at(x_m, 2)) / std::pow(1 + slope(x_m) * slope(x_m), 1.5);
  }
};

}  // namespace

Path arcPath(double curvature_per_m, double length_m) {
  constexpr double kStep_m = 1;
  Path path;
  for (int k = 0; k * kStep_m <= length_m; ++k) {
    const double s_m = k * kStep_m;
    const Pose T = arc(s_m, curvature_per_m * s_m);
    path.push_back({s_m, T.translation().x(), T.translation().y(), curvature_per_m * s_m, curvature_per_m});
  }
  return path;
}

void WallPathOptions::describe(OptionList& keys) {
  keys.add("gap_m", gap_m, between(0.5, 50), "from the wall to the rear axle's centre [m]");
  keys.add("least_gap_m", least_gap_m, between(0, 50),
           "on the way to gap_m the path does not come nearer to the wall than this, or than the car is [m]");
  keys.add("step_m", step_m, between(0.1, 10), "between the points of the path [m]");
  keys.add("horizon_s", horizon_s, between(0.1, 10), "length of the path at the present speed [s] ...");
  keys.add("min_length_m", min_length_m, between(1, 200), "... and at least [m]");
  keys.add("lateral_limit_mps2", lateral_limit_mps2, above(0), "largest curvature times v^2 [m/s^2]");
  keys.add("shift_limit_mps2", shift_limit_mps2, above(0), "part of it that leads to the gap [m/s^2]");
  keys.add("shift_limit_mps3", shift_limit_mps3, above(0), "and its rate, times v^3 [m/s^3]");
  keys.atMost("least_gap_m", least_gap_m, "gap_m", gap_m);
}

WallPath planAlong(const Wall& wall, double gap_m, double speed_mps, double curvature_per_m,
                   const WallPathOptions& options) {
  if (!(gap_m > 0)) throw std::invalid_argument("planAlong: the gap must be > 0");
  if (!(speed_mps >= 0 && std::isfinite(speed_mps))) throw std::invalid_argument("planAlong: no speed");
  const double inwards = wall.side == Side::left ? -1 : 1, v_mps = std::max(speed_mps, kSlowest_mps);
  Line line{wall.beta, {}};
  line.beta[0] += inwards * gap_m * std::hypot(1.0, wall.beta[1]);
  line.shift = {-line.beta[0], -line.beta[1], curvature_per_m - 2 * line.beta[2], 0};

  // As short as its limits allow; the bend that the car has already is nobody's choice.
  const double bend_limit_per_m =
      std::max(options.shift_limit_mps2 / (v_mps * v_mps), std::abs(line.shift.bend_per_m));
  const double rate_limit_per_m2 = options.shift_limit_mps3 / (v_mps * v_mps * v_mps);
  constexpr double kShortest_m = 5, kLongest_m = 1000, kLonger = 1.1;
  const auto keepsOff = [&] {
    // From where the car is, or from least_gap_m on, it comes no nearer.
    const double least_m = std::min(options.least_gap_m, wall.clearance_m({0, 0})) - 0.05;
    for (int k = 0; k * options.step_m < line.shift.length_m; ++k) {
      const double x_m = k * options.step_m;
      if (wall.clearance_m({x_m, line.y_m(x_m)}) < least_m) return false;
    }
    return true;
  };
  line.shift.length_m = kShortest_m;
  while (line.shift.length_m < kLongest_m &&
         (line.shift.most(2) > bend_limit_per_m || line.shift.most(3) > rate_limit_per_m2))
    line.shift.length_m *= kLonger;
  bool is_gentle = true;
  for (; line.shift.length_m > kShortest_m && !keepsOff(); line.shift.length_m /= kLonger) is_gentle = false;

  WallPath path{wall.side, gap_m, {}, 0, 0, is_gentle};
  const double length_m = std::max(options.min_length_m, speed_mps * options.horizon_s);
  const double curvature_limit_per_m = options.lateral_limit_mps2 / (v_mps * v_mps);
  constexpr double kSteepest = 1;  // beyond, y over x is no way to write a path
  double x_m = 0;
  for (int k = 0; k * options.step_m <= length_m && std::abs(line.slope(x_m)) <= kSteepest; ++k) {
    const double s_m = k * options.step_m;
    const double curvature = line.curvature_per_m(x_m);
    path.points.push_back({s_m, x_m, line.y_m(x_m), std::atan(line.slope(x_m)), curvature});
    if (x_m <= wall.to_x_m) path.valid_m = s_m;
    if (x_m <= line.shift.length_m) path.settled_m = s_m;
    path.drivable = path.drivable && std::abs(curvature) <= curvature_limit_per_m;
    const double middle_m = x_m + 0.5 * options.step_m / std::hypot(1.0, line.slope(x_m));
    x_m += options.step_m / std::hypot(1.0, line.slope(middle_m));
  }
  if (x_m <= line.shift.length_m) path.settled_m += line.shift.length_m - x_m;
  return path;
}

}  // namespace raceloc
