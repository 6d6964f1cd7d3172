#include "wall/wall_fit.h"

#include <Eigen/Dense>
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "core/statistics.h"

namespace raceloc {

namespace {

constexpr double kSeedHalf_m = 10;  // of the wall that is fitted first, beside the car
constexpr double kSeedGate_m = 1;   // what is farther from the first guess is not of the wall ...
constexpr double kGate_m = 0.8;     // ... and from what was refined
constexpr double kNear_m = 20;  // beyond, a cell weighs less: the distance that counts is the one at x = 0
constexpr double kLeanSigma = 0.5;      // tangent of a bank of 27 deg: what is known before
constexpr double kReach_m = 10;         // a wall that begins farther ahead or behind says nothing about x = 0
constexpr double kOwnShare = 0.6;       // of the metres of a seed, in which its face must lie on the curve
constexpr double kSharedError = 20;     // variance of the mean of cells over that of independent ones
constexpr double kLeastSigma_m = 0.01;  // of one cell
constexpr double kEndResidual = 2;      // of the wall's own: where a turn begins, no parabola fits for long
constexpr double kMostSigma_m = 0.5;    // of a distance that is worth knowing
constexpr int kFewest = 6;              // points on a curve of four unknowns

double cauchy(double off_m, double width_m) { return 1 / (1 + (off_m / width_m) * (off_m / width_m)); }

}  // namespace

double WallFit::Curve::off_m(const Eigen::Vector3f& p_m) const {
  const double x_m = double{p_m.x()}, x2_m2 = x_m * x_m;
  const double above_m = double{p_m.z()} - foot[1] * x_m - foot[2] * x2_m2;
  return double{p_m.y()} - b[0] - b[1] * x_m - b[2] * x2_m2 - b[3] * above_m;
}

void WallFit::take(const gpu::StandingCells& cells, const std::vector<std::int32_t>& clusters) {
  x_cells.clear();
  for (std::size_t i = 0; i < cells.size(); ++i)
    x_cells.push_back({{cells.face.x[i], cells.face.y[i], cells.face.z[i]},
                       {cells.upper.x[i], cells.upper.y[i], cells.upper.z[i]},
                       cells.lowest_m[i],
                       cells.highest_m[i],
                       clusters[i]});
  std::sort(x_cells.begin(), x_cells.end(), [](const WallCell& a, const WallCell& b) {
    return std::pair(a.face_m.x(), a.face_m.y()) < std::pair(b.face_m.x(), b.face_m.y());
  });
}

std::optional<Wall> WallFit::find(Side side) {
  constexpr std::size_t kTried = 8;
  constexpr float kNone_m = std::numeric_limits<float>::infinity();
  x_extents.assign(x_cells.size(), {Eigen::Array2f::Constant(kNone_m), Eigen::Array2f::Constant(-kNone_m)});
  x_long.clear();
  for (const WallCell& c : x_cells) {
    if (!c.isOn(side)) continue;
    Extent& extent = x_extents[static_cast<std::size_t>(c.cluster)];
    if (extent.low_m.x() == kNone_m) x_long.push_back(c.cluster);
    extent.low_m = extent.low_m.min(c.face_m.head<2>().array());
    extent.high_m = extent.high_m.max(c.face_m.head<2>().array());
  }
  const auto extent = [&](std::int32_t cluster) { return x_extents[static_cast<std::size_t>(cluster)]; };
  x_long.erase(std::remove_if(x_long.begin(), x_long.end(),
                              [&](auto c) { return extent(c).length_m() < x_options.min_length_m; }),
               x_long.end());
  const auto distance_m = [&](std::int32_t cluster) {
    return side == Side::left ? extent(cluster).low_m.y() : -extent(cluster).high_m.y();
  };
  std::sort(x_long.begin(), x_long.end(),
            [&](auto a, auto b) { return std::pair(distance_m(a), a) < std::pair(distance_m(b), b); });
  for (std::size_t k = 0; k < std::min(kTried, x_long.size()); ++k)
    if (auto wall = whole(x_long[k], side)) return wall;
  return std::nullopt;
}

bool WallFit::Curve::hasFoot(const WallCell& c) const {
  constexpr double kHigher_m = 0.3, kPerMetre = 0.01;  // beams are farther apart there
  const double x_m = double{c.face_m.x()};
  return double{c.lowest_m} - foot[0] - x_m * (foot[1] + x_m * foot[2]) <
         kHigher_m + kPerMetre * std::abs(x_m);
}

template <class Use>
void WallFit::forCells(const Window& window, const Use& use) const {
  auto cell = std::lower_bound(x_cells.begin(), x_cells.end(), window.from_m,
                               [](const WallCell& c, double x_m) { return double{c.face_m.x()} < x_m; });
  for (; cell != x_cells.end() && double{cell->face_m.x()} <= window.to_m; ++cell) use(*cell);
}

std::optional<WallFit::Curve> WallFit::seed(std::int32_t cluster, Side side, double least_x_m,
                                            Window& window) {
  const auto isOurs = [&](const WallCell& c) { return c.cluster == cluster && c.isOn(side); };
  double first_m = x_options.max_range_m, last_m = -first_m;
  forCells({last_m, first_m}, [&](const WallCell& c) {
    if (!isOurs(c)) return;
    first_m = std::min(first_m, double{c.face_m.x()});
    last_m = std::max(last_m, double{c.face_m.x()});
  });
  first_m = std::max(first_m, least_x_m);
  if (first_m > kReach_m || last_m < std::max(first_m, -kReach_m)) return std::nullopt;
  const double middle_m = std::clamp(0.0, first_m, std::max(first_m, last_m));
  window = {std::max(first_m, middle_m - kSeedHalf_m), std::min(last_m, middle_m + kSeedHalf_m)};

  // The first guess is through the cells that are nearest to the car, metre by metre: what stands behind the wall does
  // not pull it.
  constexpr std::size_t kMetres = static_cast<std::size_t>(2 * kSeedHalf_m) + 1;
  std::array<const WallCell*, kMetres> nearest{};
  forCells(window, [&](const WallCell& c) {
    if (!isOurs(c)) return;
    const WallCell*& best = nearest[static_cast<std::size_t>(double{c.face_m.x()} - window.from_m)];
    if (best == nullptr || std::abs(c.face_m.y()) < std::abs(best->face_m.y())) best = &c;
  });
  const auto seen =
      std::count_if(nearest.begin(), nearest.end(), [](const WallCell* c) { return c != nullptr; });
  if (seen < kFewest) return std::nullopt;
  Curve curve{Eigen::Vector4d::Zero(), Eigen::Vector3d::Zero()};
  for (const double width_m : {1e3, 1.0, 0.3}) {
    Eigen::Matrix3d A = Eigen::Vector3d(1e-9, 1e-9, 1e2).asDiagonal();  // a bend of 1 / 10 m is one sigma
    Eigen::Vector3d g = Eigen::Vector3d::Zero();
    for (const WallCell* c : nearest) {
      if (c == nullptr) continue;
      const double x_m = double{c->face_m.x()};
      const Eigen::Vector3d row(1, x_m, x_m * x_m);
      const double weight = cauchy(curve.off_m(c->face_m), width_m);
      A += weight * row * row.transpose();
      g += weight * double{c->face_m.y()} * row;
    }
    curve.b.head<3>() = A.ldlt().solve(g);
  }
  if (!refine(curve, window, kSeedGate_m) || !refine(curve, window, kGate_m)) return std::nullopt;
  const auto on_curve = std::count_if(nearest.begin(), nearest.end(), [&](const WallCell* c) {
    return c != nullptr && std::abs(curve.off_m(c->face_m)) < kGate_m;
  });
  if (static_cast<double>(on_curve) < kOwnShare * static_cast<double>(seen)) return std::nullopt;
  return curve;
}

void WallFit::fitFoot(Curve& curve, const Window& window, double gate_m) {
  // The lowest point of each metre: the upper half of a wall that leans over into the next cell has no foot there.
  const auto metres = static_cast<std::size_t>(window.to_m - window.from_m) + 1;
  x_lowest.assign(metres, std::numeric_limits<float>::infinity());
  forCells(window, [&](const WallCell& c) {
    if (std::abs(curve.off_m(c.face_m)) > gate_m) return;
    float& lowest_m = x_lowest[static_cast<std::size_t>(double{c.face_m.x()} - window.from_m)];
    lowest_m = std::min(lowest_m, c.lowest_m);
  });
  Eigen::Vector3d foot = Eigen::Vector3d::Zero();
  for (const double width_m : {1e3, 0.3, 0.1}) {
    Eigen::Matrix3d A = Eigen::Vector3d(1e-9, 1e-3, 1e2).asDiagonal();
    Eigen::Vector3d g = Eigen::Vector3d::Zero();
    for (std::size_t k = 0; k < metres; ++k) {
      if (!std::isfinite(x_lowest[k])) continue;
      const double x_m = window.from_m + 0.5 + static_cast<double>(k), z_m = double{x_lowest[k]};
      const Eigen::Vector3d row(1, x_m, x_m * x_m);
      const double weight = cauchy(z_m - row.dot(foot), width_m) * cauchy(x_m, kNear_m);
      A += weight * row * row.transpose();
      g += weight * z_m * row;
    }
    foot = A.ldlt().solve(g);
  }
  curve.foot = foot;
}

bool WallFit::refine(Curve& curve, const Window& window, double gate_m) {
  constexpr int kRounds = 3;
  for (int round = 0; round < kRounds; ++round) {
    fitFoot(curve, window, gate_m);
    const double lean_information =
        x_options.robust_width_m * x_options.robust_width_m / (kLeanSigma * kLeanSigma);
    Eigen::Matrix4d A = Eigen::Vector4d(1e-9, 1e-9, 1e-9, lean_information).asDiagonal();
    Eigen::Vector4d g = Eigen::Vector4d::Zero();
    int count = 0;
    forCells(window, [&](const WallCell& c) {
      if (!curve.hasFoot(c)) return;
      for (const Eigen::Vector3f* p_m : {&c.face_m, &c.upper_m}) {
        const double off_m = curve.off_m(*p_m);
        if (std::abs(off_m) > gate_m) continue;
        const double x_m = double{p_m->x()}, x2_m2 = x_m * x_m;
        const Eigen::Vector4d row(1, x_m, x2_m2,
                                  double{p_m->z()} - curve.foot[1] * x_m - curve.foot[2] * x2_m2);
        const double weight = cauchy(off_m, x_options.robust_width_m) * cauchy(x_m, kNear_m);
        A += weight * row * row.transpose();
        g += weight * double{p_m->y()} * row;
        ++count;
      }
    });
    if (count < kFewest) return false;
    curve.b = A.ldlt().solve(g);
    x_information = A;
  }
  return true;
}

std::optional<bool> WallFit::fits(const Curve& curve, double from_m, double to_m) {
  constexpr std::size_t kFewestCells = 2;
  x_off_m.clear();
  forCells({from_m, to_m}, [&](const WallCell& c) {
    if (!curve.hasFoot(c)) return;
    const double off_m = std::abs(curve.off_m(c.face_m));
    if (off_m < kGate_m) x_off_m.push_back(off_m);
  });
  if (x_off_m.size() < kFewestCells) return std::nullopt;
  return quantile(x_off_m.data(), x_off_m.data() + x_off_m.size(), 0.5) <=
         kEndResidual * x_options.max_residual_m;
}

Wall WallFit::wallOf(const Curve& curve, const Window& window, Side side) {
  Wall wall{side, curve.b.head<3>(), Eigen::Matrix3d::Zero(), window.from_m, window.to_m, 0, 0, 0, 0};
  const auto metres = static_cast<std::size_t>(window.to_m - window.from_m) + 1;
  x_lowest.assign(metres, 0);
  x_off_m.clear();
  forCells(window, [&](const WallCell& c) {
    const double off_m = std::abs(curve.off_m(c.face_m));
    if (off_m > kGate_m || !curve.hasFoot(c)) return;
    x_off_m.push_back(off_m);
    x_lowest[static_cast<std::size_t>(double{c.face_m.x()} - window.from_m)] = 1;
    wall.height_m = std::max(wall.height_m, double{c.highest_m - c.lowest_m});
  });
  wall.residual_m = quantile(x_off_m.data(), x_off_m.data() + x_off_m.size(), 0.5);
  for (std::size_t k = 0; k < metres; ++k)
    wall.length_m +=
        x_lowest[k] > 0 ? std::hypot(1.0, wall.slope(window.from_m + static_cast<double>(k))) : 0;
  const double sigma_m = std::max(kLeastSigma_m, 1.48 * wall.residual_m);
  wall.covariance = kSharedError * sigma_m * sigma_m * x_information.inverse().topLeftCorner<3, 3>();
  return wall;
}

std::optional<Wall> WallFit::whole(std::int32_t cluster, Side side) {
  auto wall = from(cluster, side, -x_options.max_range_m);
  if (wall && wall->from_x_m >= -kSeedHalf_m) return wall;
  auto ahead = from(cluster, side, 0);
  if (!wall) return ahead;
  if (ahead)
    wall->beta_ahead = ahead->beta;
  else
    wall->is_passed = wall->to_x_m < x_options.min_length_m;
  return wall;
}

std::optional<Wall> WallFit::from(std::int32_t cluster, Side side, double least_x_m) {
  Window window{};
  auto curve = seed(cluster, side, least_x_m, window);
  if (!curve) return std::nullopt;
  struct End {
    bool grows = true;
    double gap_m = 0;
  };
  End ahead, behind;
  behind.grows = window.from_m > least_x_m;
  Window tried = window;
  while (ahead.grows || behind.grows) {
    constexpr double kStep_m = 4, kStepShare = 0.2;
    const double step_m = kStep_m + kStepShare * (window.to_m - window.from_m);
    bool has_grown = false;
    const auto grow = [&](End& end, double& at_m, double& seen_m, double sign) {
      if (!end.grows) return;
      const double next_m = std::max(least_x_m, at_m + sign * step_m);
      const auto good = fits(*curve, std::min(at_m, next_m), std::max(at_m, next_m));
      end.gap_m = good ? 0 : end.gap_m + step_m;
      end.grows = good.value_or(end.gap_m <= x_options.max_gap_m) &&
                  std::abs(next_m) < x_options.max_range_m && next_m > least_x_m;
      at_m = next_m;
      if (!good || !*good) return;
      seen_m = next_m;
      has_grown = true;
    };
    grow(ahead, tried.to_m, window.to_m, 1);
    grow(behind, tried.from_m, window.from_m, -1);
    if (has_grown && !refine(*curve, window, kGate_m)) return std::nullopt;
  }
  const Wall wall = wallOf(*curve, window, side);
  const double x_m = std::clamp(0.0, wall.from_x_m, wall.to_x_m);
  const bool is_wall = wall.distanceSigma_m() <= kMostSigma_m &&
                       wall.residual_m <= x_options.max_residual_m &&
                       wall.length_m >= x_options.min_length_m && wall.distance_m() > 0 &&
                       wall.distance_m() <= x_options.max_distance_m &&
                       std::abs(std::atan(wall.slope(x_m))) <= x_options.max_heading_deg * kDegree &&
                       2 * std::abs(wall.beta[2]) * x_options.min_radius_m <= 1;
  return is_wall ? std::optional(wall) : std::nullopt;
}

}  // namespace raceloc
