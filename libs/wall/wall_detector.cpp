#include "wall/wall_detector.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <utility>

#include "cloud/covariances.h"
#include "cloud/scan_check.h"
#include "wall/wall_fit.h"

namespace raceloc {

double Wall::clearance_m(const Eigen::Vector2d& p_body_m) const {
  const double across_m = (p_body_m.y() - y_m(p_body_m.x())) / std::hypot(1.0, slope(p_body_m.x()));
  return side == Side::left ? -across_m : across_m;
}

Wall ahead(Wall wall) {
  if (wall.beta_ahead) wall.beta = *std::exchange(wall.beta_ahead, std::nullopt);
  return wall;
}

WallScan ahead(WallScan walls) {
  for (auto* wall : {&walls.left, &walls.right})
    if (*wall) *wall = (*wall)->is_passed ? std::nullopt : std::optional(ahead(**wall));
  return walls;
}

namespace {

/** Points of the curve, moved, and the parabola through them: in the plane of the road, as turns of a tenth of a second
 * are small. */
Eigen::Vector3d moved(const Eigen::Vector3d& beta, const Pose& T_last_now) {
  const Pose T_now_last = T_last_now.inverse();
  const double middle_m = T_last_now.translation().x();
  Eigen::Matrix3d X;
  Eigen::Vector3d y;
  for (int k = 0; k < 3; ++k) {
    constexpr double kApart_m = 10;
    const double x_m = middle_m + kApart_m * (k - 1);
    const Eigen::Vector3d p_m =
        T_now_last * Eigen::Vector3d(x_m, Eigen::Vector3d(1, x_m, x_m * x_m).dot(beta), 0);
    X.row(k) << 1, p_m.x(), p_m.x() * p_m.x();
    y[k] = p_m.y();
  }
  return X.inverse() * y;
}

}  // namespace

Wall moved(const Wall& wall, const Pose& T_last_now, double dt_s) {
  const double middle_m = T_last_now.translation().x();
  Wall out = wall;
  out.beta = moved(wall.beta, T_last_now);
  if (wall.beta_ahead) out.beta_ahead = moved(*wall.beta_ahead, T_last_now);
  // The covariance of y(x) = [1 x x^2] beta, at x + middle.
  Eigen::Matrix3d shift;
  shift << 1, middle_m, middle_m * middle_m, 0, 1, 2 * middle_m, 0, 0, 1;
  out.covariance = shift * wall.covariance * shift.transpose();
  out.from_x_m -= middle_m;
  out.to_x_m -= middle_m;
  out.is_passed = wall.is_passed || out.to_x_m < 0;
  out.age_s += dt_s;
  return out;
}

void WallOptions::describe(OptionList& keys) {
  keys.add("cell_m", cell_m, between(0.1, 5), "edge of the cells whose heights are compared [m]");
  keys.add("min_spread_m", min_spread_m, between(0.05, 5),
           "heights in a cell that spread less are ground [m]");
  keys.add("foot_m", foot_m, between(0.01, 5), "the lowest so much of a cell is ground in any case [m]");
  keys.add(
      "reach_m", reach_m, between(0.1, 20),
      "points that are higher above the lowest one of their cell are left out: bridges and branches [m]");
  keys.add("min_points", min_points, between(2, 1000),
           "in a cell, the lowest one included; with fewer it is ground");
  keys.add("max_range_m", max_range_m, between(5, 500), "ahead, behind and to each side [m]");
  keys.add("cluster_radius_m", cluster_radius_m, between(0.1, 20), "nearer cells are of one cluster [m]");
  keys.add("min_length_m", min_length_m, between(1, 200),
           "a shorter cluster begins no wall: cars are shorter [m]");
  keys.add("max_distance_m", max_distance_m, between(1, 200), "a farther wall is of no use [m]");
  keys.add("max_gap_m", max_gap_m, between(0, 200), "gaps that are bridged along the curve [m]");
  keys.add("robust_width_m", robust_width_m, between(0.01, 1), "width of the Cauchy loss [m]");
  keys.add("max_residual_m", max_residual_m, between(0.01, 1),
           "median distance from the curve, above which it is no wall, or ends [m]");
  keys.add("max_heading_deg", max_heading_deg, between(1, 80),
           "direction of a wall against the car's; what turns farther off is no wall [deg]");
  keys.add("min_radius_m", min_radius_m, between(5, 1000), "what bends more sharply is no wall: radius [m]");
  keys.add("keep_s", keep_s, between(0, 10), "a wall is remembered so long after it was seen [s]");
  keys.atMost("min_spread_m", min_spread_m, "reach_m", reach_m);
}

gpu::StandingOptions WallOptions::forKernels() const {
  const auto f = [](double x) { return static_cast<float>(x); };
  return {f(cell_m), f(min_spread_m), f(foot_m), f(reach_m), min_points, f(max_range_m)};
}

namespace {

ScanVerdict verdictOn(const Cloud& cloud) {
  std::size_t i = 0;
  while (i < cloud.size() && !cloud.point(i).allFinite()) ++i;
  if (i == cloud.size()) return ScanVerdict::no_points;
  return showsGround(cloud, Pose::Identity()).value_or(true) ? ScanVerdict::good
                                                             : ScanVerdict::ground_not_below;
}

}  // namespace

WallDetector::WallDetector(gpu::Context& context, const WallOptions& options)
    : x_context(context), x_options(options), x_fit(std::make_unique<WallFit>(options)) {
  requireConsistent("wall", options);
}
WallDetector::~WallDetector() = default;

WallScan WallDetector::detect(const Cloud& cloud, double stamp_s, const Pose& T_last_now) {
  WallScan scan{stamp_s, ScanVerdict::good, std::nullopt, std::nullopt};
  if (x_last) {
    const double dt_s = stamp_s - x_last->stamp_s;
    if (!(dt_s > 0)) throw std::invalid_argument("WallDetector: stamps must increase");
    for (auto [now, last] : {std::pair(&scan.left, &x_last->left), std::pair(&scan.right, &x_last->right)})
      if (*last && (*last)->age_s + dt_s <= x_options.keep_s) *now = moved(**last, T_last_now, dt_s);
  }
  x_cells = gpu::standingCells(x_context, viewOf(cloud), x_options.forKernels(), nullptr, std::move(x_cells));
  x_labels = gpu::clusters(x_context, x_cells.face.view(), static_cast<float>(x_options.cluster_radius_m),
                           std::move(x_labels));
  x_fit->take(x_cells, x_labels);
  scan.verdict = verdictOn(cloud);
  if (scan.verdict == ScanVerdict::good)
    for (auto [side, now] : {std::pair(Side::left, &scan.left), std::pair(Side::right, &scan.right)})
      if (auto seen = x_fit->find(side)) *now = seen;
  x_last = scan;
  return scan;
}

}  // namespace raceloc
