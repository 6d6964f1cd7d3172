#include "track/racing_line.h"

#include <ceres/ceres.h>

#include <algorithm>
#include <cmath>
#include <stdexcept>

namespace raceloc {

namespace {

constexpr double kKnots_m = 5;
constexpr double kShape_m = 1;  // between the points at which direction and curvature are tabulated

/** Bend of the polygon through three neighbours, each moved along its own left axis. */
class Bend : public ceres::SizedCostFunction<3, 1, 1, 1> {
 public:
  Bend(const Pose& before, const Pose& here, const Pose& after) {
    x_centre_m = before.translation() - 2 * here.translation() + after.translation();
    x_left << before.linear().col(1), -2 * here.linear().col(1), after.linear().col(1);
  }
  bool Evaluate(double const* const* n_m, double* residuals, double** jacobians) const override {
    Eigen::Map<Eigen::Vector3d> bend(residuals);
    bend = x_centre_m;
    for (int k = 0; k < 3; ++k) {
      bend += n_m[k][0] * x_left.col(k);
      if (jacobians != nullptr && jacobians[k] != nullptr) Eigen::Vector3d::Map(jacobians[k]) = x_left.col(k);
    }
    return true;
  }

 private:
  Eigen::Vector3d x_centre_m;
  Eigen::Matrix3d x_left;
};

std::vector<double> leastCurvature(const Track& track, double margin_m) {
  const auto knots = static_cast<std::size_t>(std::max(8.0, std::round(track.length_m() / kKnots_m)));
  const double step_m = track.length_m() / static_cast<double>(knots);
  std::vector<RoadFrame> frames;
  frames.reserve(knots);
  for (std::size_t i = 0; i < knots; ++i) frames.push_back(track.at(static_cast<double>(i) * step_m));

  std::vector<double> n_m(knots);
  ceres::Problem problem;
  for (std::size_t i = 0; i < knots; ++i) {
    const double low = std::min(margin_m - frames[i].right_m, 0.5 * (frames[i].left_m - frames[i].right_m));
    const double high = std::max(frames[i].left_m - margin_m, 0.5 * (frames[i].left_m - frames[i].right_m));
    n_m[i] = 0.5 * (low + high);
    problem.AddParameterBlock(&n_m[i], 1);
    problem.SetParameterLowerBound(&n_m[i], 0, low - 1e-6);
    problem.SetParameterUpperBound(&n_m[i], 0, high + 1e-6);
  }
  for (std::size_t i = 0; i < knots; ++i) {
    const std::size_t before = (i + knots - 1) % knots, after = (i + 1) % knots;
    problem.AddResidualBlock(
        new Bend(frames[before].T_map_road, frames[i].T_map_road, frames[after].T_map_road), nullptr,
        &n_m[before], &n_m[i], &n_m[after]);
  }
  ceres::Solver::Options options;
  options.linear_solver_type = ceres::SPARSE_NORMAL_CHOLESKY;
  options.sparse_linear_algebra_library_type = ceres::EIGEN_SPARSE;  // no BLAS: the same bits on any machine
  options.max_num_iterations = 500;
  options.function_tolerance = 1e-9;
  options.num_threads = 1;
  options.logging_type = ceres::SILENT;
  ceres::Solver::Summary summary;
  ceres::Solve(options, &problem, &summary);
  if (!summary.IsSolutionUsable()) throw std::runtime_error("RacingLine: " + summary.message);
  constexpr double kSteps =
      1 << 20;  // a micrometre: what rounding differs between machines is gone, no bend is made
  for (double& n : n_m) n = std::round(n * kSteps) / kSteps;
  return n_m;
}

PeriodicSpline<1> splineOf(const std::vector<double>& values, double step_m) {
  std::vector<PeriodicSpline<1>::Vector> knots;
  knots.reserve(values.size());
  for (const double value : values) knots.emplace_back(PeriodicSpline<1>::Vector(value));
  return {std::move(knots), step_m};
}

}  // namespace

RacingLine::RacingLine(const Track& track, double margin_m)
    : RacingLine(track, leastCurvature(track, margin_m)) {}

RacingLine::RacingLine(const Track& track, const std::vector<double>& n_m) {
  if (n_m.size() < 8) throw std::invalid_argument("RacingLine: needs 8 offsets");
  x_offset_m = splineOf(n_m, track.length_m() / static_cast<double>(n_m.size()));

  // The line is p + n left; its tangent in the surface's axes is (stretch of the surface, dn/ds, 0).
  struct Tangent {
    Eigen::Vector3d along_map, normal_map;
    double direction_rad, stretch;
  };
  const auto tangentAt = [&](double s_m) {
    const auto n = x_offset_m(s_m);
    const SurfacePoint here = track.surface(s_m, n.value[0]);
    const Eigen::Vector3d along(here.stretch, n.first[0], 0);
    return Tangent{here.T_map_surface.linear() * along.normalized(), here.T_map_surface.linear().col(2),
                   std::atan2(along.y(), along.x()), along.norm()};
  };
  const auto rows = static_cast<std::size_t>(std::max(8.0, std::round(track.length_m() / kShape_m)));
  const double step_m = track.length_m() / static_cast<double>(rows);
  std::vector<PeriodicSpline<4>::Vector> shape;
  shape.reserve(rows);
  constexpr double kHalf_m = 0.5;
  for (std::size_t i = 0; i < rows; ++i) {
    const double s_m = static_cast<double>(i) * step_m;
    const Tangent here = tangentAt(s_m);
    const Eigen::Vector3d bend = (tangentAt(s_m + kHalf_m).along_map - tangentAt(s_m - kHalf_m).along_map) /
                                 (2 * kHalf_m * here.stretch);
    shape.emplace_back(here.direction_rad, here.stretch, bend.dot(here.normal_map.cross(here.along_map)),
                       bend.dot(here.normal_map));
  }
  x_shape = {std::move(shape), step_m};
}

RacingLine::Point RacingLine::at(double s_m) const {
  const auto shape = x_shape(s_m).value;
  return {x_offset_m(s_m).value[0], shape[0], shape[1], shape[2], shape[3]};
}

}  // namespace raceloc
