#include "eval/trajectory_errors.h"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <stdexcept>
#include <system_error>
#include <utility>

#include "core/errors.h"
#include "eval/format.h"
#include "eval/frame_checks.h"

namespace raceloc {

namespace {

constexpr double kMinMatchShare = 0.5;

std::string span(const std::vector<StampedPose>& poses) {
  return format("%.3f .. %.3f s", poses.front().stamp_s, poses.back().stamp_s);
}

std::string originText(const GeodeticPoint& origin) {
  return format("lat %.8f lon %.8f height %.3f m", origin.latitude_deg, origin.longitude_deg,
                origin.height_m);
}

void requireOneMap(const TrajectoryFile& truth, const TrajectoryFile& estimate) {
  const auto& a = truth.trajectory.origin;
  const auto& b = estimate.trajectory.origin;
  constexpr double kSame_deg = 1e-8;  // 1 mm
  constexpr double kSame_m = 1e-3;
  if (!a || !b) return;
  if (std::abs(a->latitude_deg - b->latitude_deg) > kSame_deg ||
      std::abs(a->longitude_deg - b->longitude_deg) > kSame_deg ||
      std::abs(a->height_m - b->height_m) > kSame_m)
    throw InputError("truth " + truth.path + " and estimate " + estimate.path +
                     " have different map origins: " + originText(*a) + " against " + originText(*b) +
                     "; make both with one origin, or move the estimate with --align se3 or axes");
}

/** Matched poses with stamp, truth and estimate; the errors come later, after the alignment. */
void match(Evaluation& e) {
  const auto& truth = e.truth.trajectory.poses;
  const auto& estimate = e.estimate.trajectory.poses;
  for (std::size_t i = 0; i < estimate.size(); ++i) {
    const double stamp_s = estimate[i].stamp_s;
    if (const auto T_map_truth = interpolated(truth, stamp_s, e.options.max_gap_s)) {
      PoseError error{};
      error.estimate_index = i;
      error.stamp_s = stamp_s;
      error.T_map_truth = *T_map_truth;
      error.T_map_estimate = estimate[i].T_map_body;
      e.poses.push_back(error);
    } else if (stamp_s < truth.front().stamp_s || stamp_s > truth.back().stamp_s) {
      ++e.outside_truth;
    } else {
      ++e.in_gaps;
    }
  }
  if (e.matchShare() < kMinMatchShare)
    throw InputError(
        "estimate " + e.estimate.path + ": only " + std::to_string(e.poses.size()) + " of " +
        std::to_string(estimate.size()) + " poses have a truth in " + e.truth.path + " (estimate " +
        span(estimate) + ", truth " + span(truth) + "; " + std::to_string(e.in_gaps) +
        format(" in gaps wider than %g s), but at least %.0f %% must", e.options.max_gap_s,
               100 * kMinMatchShare) +
        "; check that both are of one drive and one clock (UTC or GPS time, seconds), or raise --max-gap");
}

void align(Evaluation& e) {
  if (e.poses.size() < 3)
    throw InputError("estimate " + e.estimate.path + ": " + std::to_string(e.poses.size()) +
                     " matched poses are too few to align; at least 3 are needed, or leave --align out");
  const auto n = static_cast<Eigen::Index>(e.poses.size());
  Eigen::Matrix3Xd estimate_m(3, n);
  Eigen::Matrix3Xd truth_m(3, n);
  for (Eigen::Index i = 0; i < n; ++i) {
    const PoseError& pose = e.poses[static_cast<std::size_t>(i)];
    estimate_m.col(i) = pose.T_map_estimate.translation();
    truth_m.col(i) = pose.T_map_truth.translation();
  }
  e.T_map_estimate_frame.matrix() = Eigen::umeyama(estimate_m, truth_m, false);
  for (PoseError& pose : e.poses) pose.T_map_estimate = e.T_map_estimate_frame * pose.T_map_estimate;
}

void turnAxes(Evaluation& e) {
  Eigen::Matrix3d sum = Eigen::Matrix3d::Zero();
  for (const PoseError& pose : e.poses)
    sum += pose.T_map_estimate.linear().transpose() * pose.T_map_truth.linear();
  e.R_estimate_truth_body = Eigen::Affine3d(sum).rotation();  // the rotation that is nearest to all of them
  for (PoseError& pose : e.poses) pose.T_map_estimate.rotate(e.R_estimate_truth_body);
}

/** Frames that are mixed up make every figure worthless; of an aligned estimate the motion is worth something. */
void checkFrames(Evaluation& e) {
  std::vector<std::string> mismatches = frameMismatches(e.poses);
  if (e.options.align == Alignment::none && !mismatches.empty()) {
    std::string all;
    for (const std::string& mismatch : mismatches) all += (all.empty() ? "" : "; ") + mismatch;
    throw InputError("estimate " + e.estimate.path + " against truth " + e.truth.path + ": " + all +
                     "; convert one of them, or move the estimate with --align se3 or axes");
  }
  e.warnings = std::move(mismatches);
  if (auto sideways = sidewaysTruth(e.poses)) e.warnings.push_back(*std::move(sideways));
}

void fillErrors(std::vector<PoseError>& poses) {
  const auto chord_m = [&](std::size_t i, std::size_t j) {
    return (poses[j].T_map_truth.translation() - poses[i].T_map_truth.translation()).norm();
  };
  for (std::size_t i = 0; i < poses.size(); ++i) {
    PoseError& pose = poses[i];
    const Eigen::Vector3d d_m = pose.T_map_estimate.translation() - pose.T_map_truth.translation();
    const double heading_rad = yawOf(pose.T_map_truth);
    const double c = std::cos(heading_rad);
    const double s = std::sin(heading_rad);
    pose.position_3d_m = d_m.norm();
    pose.position_plane_m = d_m.head<2>().norm();
    pose.longitudinal_m = c * d_m.x() + s * d_m.y();
    pose.lateral_m = c * d_m.y() - s * d_m.x();
    pose.height_m = d_m.z();
    pose.heading_deg = wrapAngle(yawOf(pose.T_map_estimate) - heading_rad) / kDegree;

    const std::size_t before = i > 0 ? i - 1 : i;
    const std::size_t after = std::min(i + 1, poses.size() - 1);
    pose.station_m = poses[before].station_m + chord_m(before, i);
    if (after > before)
      pose.speed_mps =
          (chord_m(before, i) + chord_m(i, after)) / (poses[after].stamp_s - poses[before].stamp_s);
  }
}

template <class Value>
Statistics statisticsOver(const std::vector<PoseError>& poses, Value value) {
  std::vector<double> values;
  values.reserve(poses.size());
  for (const auto& pose : poses) values.push_back(pose.*value);
  return statisticsOf(std::move(values));
}

}  // namespace

const char* nameOf(Alignment alignment) {
  switch (alignment) {
    case Alignment::none:
      return "none";
    case Alignment::se3:
      return "se3";
    case Alignment::axes:
      return "axes";
  }
  throw std::logic_error("alignment without a name");
}

TrajectoryFile readTrajectoryFile(const std::string& path) {
  Trajectory trajectory = readTum(path);
  std::error_code no_regular_file;
  const auto bytes = std::filesystem::file_size(path, no_regular_file);
  return {path, no_regular_file ? 0 : bytes, std::move(trajectory)};
}

double Evaluation::matchShare() const {
  return static_cast<double>(poses.size()) / static_cast<double>(estimate.trajectory.poses.size());
}

double Evaluation::coveredTruth_s() const { return poses.back().stamp_s - poses.front().stamp_s; }

Eigen::Vector3d Evaluation::bodyTurn_deg() const {
  const Eigen::AngleAxisd turn(R_estimate_truth_body);
  return turn.angle() / kDegree * turn.axis();
}

std::optional<Pose> interpolated(const std::vector<StampedPose>& truth, double stamp_s, double max_gap_s) {
  const auto after = std::lower_bound(truth.begin(), truth.end(), stamp_s,
                                      [](const StampedPose& pose, double t_s) { return pose.stamp_s < t_s; });
  if (after == truth.end()) return std::nullopt;
  if (after->stamp_s == stamp_s) return after->T_map_body;
  if (after == truth.begin()) return std::nullopt;
  const auto before = after - 1;
  const double gap_s = after->stamp_s - before->stamp_s;
  if (gap_s > max_gap_s + kStampResolution_s) return std::nullopt;
  const double share = (stamp_s - before->stamp_s) / gap_s;
  const Eigen::Vector3d p_before_m = before->T_map_body.translation();
  const Eigen::Vector3d p_after_m = after->T_map_body.translation();
  Pose T = Pose::Identity();
  T.linear() = Eigen::Quaterniond(before->T_map_body.linear())
                   .slerp(share, Eigen::Quaterniond(after->T_map_body.linear()))
                   .toRotationMatrix();
  T.translation() = p_before_m + share * (p_after_m - p_before_m);
  return T;
}

Evaluation evaluate(TrajectoryFile truth, TrajectoryFile estimate, const EvalOptions& options) {
  Evaluation e{};
  e.truth = std::move(truth);
  e.estimate = std::move(estimate);
  e.options = options;
  e.T_map_estimate_frame = Pose::Identity();
  e.R_estimate_truth_body.setIdentity();
  if (options.align == Alignment::none) requireOneMap(e.truth, e.estimate);
  match(e);
  if (options.align != Alignment::none) align(e);
  if (options.align == Alignment::axes) turnAxes(e);
  fillErrors(e.poses);
  checkFrames(e);

  e.position_3d_m = statisticsOver(e.poses, &PoseError::position_3d_m);
  e.position_plane_m = statisticsOver(e.poses, &PoseError::position_plane_m);
  e.lateral_m = statisticsOver(e.poses, &PoseError::lateral_m);
  e.longitudinal_m = statisticsOver(e.poses, &PoseError::longitudinal_m);
  e.height_m = statisticsOver(e.poses, &PoseError::height_m);
  e.heading_deg = statisticsOver(e.poses, &PoseError::heading_deg);
  for (const double length_m : options.segment_lengths_m)
    e.relative.push_back(relativeError(e.poses, length_m));
  for (const RpeStep& step : options.rpe_steps) e.rpe.push_back(relativePoseError(e.poses, step));
  e.lap_starts_m = lapStarts(e.poses);
  e.by_lap = errorsByLap(e.poses, e.lap_starts_m);
  e.by_sector = errorsBySector(e.poses, e.lap_starts_m, options.sectors);
  e.by_speed = errorsBySpeed(e.poses, options.speed_bin_mps);

  e.path_length_m = e.poses.back().station_m;
  const auto [slowest, fastest] = std::minmax_element(
      e.poses.begin(), e.poses.end(), [](const auto& a, const auto& b) { return a.speed_mps < b.speed_mps; });
  e.min_speed_mps = slowest->speed_mps;
  e.max_speed_mps = fastest->speed_mps;
  return e;
}

}  // namespace raceloc
