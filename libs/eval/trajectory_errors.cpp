#include "eval/trajectory_errors.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <numeric>
#include <stdexcept>
#include <system_error>
#include <utility>

#include "core/errors.h"

namespace raceloc {

namespace {

constexpr double kMinMatchShare = 0.5;
constexpr double kStampResolution_s = 1e-6;  // of the files
constexpr double kDegrees = 180 / M_PI;

std::string format(const char* pattern, double a, double b = 0, double c = 0) {
  char text[256];
  std::snprintf(text, sizeof text, pattern, a, b, c);
  return text;
}

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
                     "; make both with one origin, or move the estimate with --align se3");
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
    pose.heading_deg = kDegrees * wrapAngle(yawOf(pose.T_map_estimate) - heading_rad);

    const std::size_t before = i > 0 ? i - 1 : i;
    const std::size_t after = std::min(i + 1, poses.size() - 1);
    pose.station_m = poses[before].station_m + chord_m(before, i);
    if (after > before)
      pose.speed_mps =
          (chord_m(before, i) + chord_m(i, after)) / (poses[after].stamp_s - poses[before].stamp_s);
  }
}

RelativeError relativeError(const std::vector<PoseError>& poses, double length_m) {
  RelativeError sum{length_m, 0, 0, 0};
  std::size_t j = 0;
  for (std::size_t i = 0; i < poses.size(); ++i) {
    while (j < poses.size() && poses[j].station_m < poses[i].station_m + length_m) ++j;
    if (j == poses.size()) break;
    const Pose T_i_j_truth = poses[i].T_map_truth.inverse() * poses[j].T_map_truth;
    const Pose T_i_j_estimate = poses[i].T_map_estimate.inverse() * poses[j].T_map_estimate;
    const Pose error = T_i_j_estimate.inverse() * T_i_j_truth;
    const double own_length_m = poses[j].station_m - poses[i].station_m;
    sum.translation_percent += 100 * error.translation().norm() / own_length_m;
    sum.rotation_deg_per_m += kDegrees * Eigen::AngleAxisd(error.linear()).angle() / own_length_m;
    ++sum.segments;
  }
  if (sum.segments > 0) {
    sum.translation_percent /= static_cast<double>(sum.segments);
    sum.rotation_deg_per_m /= static_cast<double>(sum.segments);
  }
  return sum;
}

/** Mean of angles, if they agree to about 15 deg. */
std::optional<double> commonAngle_deg(const std::vector<double>& angles_deg) {
  if (angles_deg.empty()) return std::nullopt;
  Eigen::Vector2d sum(0, 0);
  for (const double a : angles_deg) sum += Eigen::Vector2d(std::cos(a / kDegrees), std::sin(a / kDegrees));
  if (sum.norm() < 0.97 * static_cast<double>(angles_deg.size())) return std::nullopt;
  return kDegrees * std::atan2(sum.y(), sum.x());
}

bool isQuarterTurn(double angle_deg) {
  return std::abs(angle_deg) > 45 && std::abs(std::remainder(angle_deg, 90)) < 10;
}

std::vector<std::string> frameWarnings(const std::vector<PoseError>& poses) {
  std::vector<std::string> warnings;
  const auto n = static_cast<double>(poses.size());
  Eigen::Vector3d offset_m = Eigen::Vector3d::Zero();
  for (const auto& p : poses) offset_m += (p.T_map_estimate.translation() - p.T_map_truth.translation()) / n;
  double scatter_m2 = 0;
  for (const auto& p : poses)
    scatter_m2 += (p.T_map_estimate.translation() - p.T_map_truth.translation() - offset_m).squaredNorm() / n;
  if (offset_m.norm() >= 1000 && std::sqrt(scatter_m2) < 0.1 * offset_m.norm())
    warnings.push_back(
        format("a constant offset of %.3f km (x %.0f m, y %.0f m): ", offset_m.norm() / 1000, offset_m.x(),
               offset_m.y()) +
        "the two files are hardly in one map frame (other origin, or UTM against local metres?)");

  std::vector<double> headings_deg;
  headings_deg.reserve(poses.size());
  for (const auto& p : poses) headings_deg.push_back(p.heading_deg);
  if (const auto turn_deg = commonAngle_deg(headings_deg); turn_deg && isQuarterTurn(*turn_deg))
    warnings.push_back(
        format("the headings differ by a constant %.0f deg: ", *turn_deg) +
        "the axes of the two files are hardly the same (map: x east, y north; body: x forward, y left)");

  // A truth that does not look where it drives makes the split into lateral and longitudinal worthless.
  std::vector<double> drifts_deg;
  bool moved = false;
  for (std::size_t i = 1; i < poses.size(); ++i) {
    const Eigen::Vector3d step_m =
        poses[i].T_map_truth.translation() - poses[i - 1].T_map_truth.translation();
    if (poses[i].speed_mps < 2 || step_m.head<2>().norm() < 0.1) continue;
    moved = true;
    drifts_deg.push_back(kDegrees *
                         wrapAngle(std::atan2(step_m.y(), step_m.x()) - yawOf(poses[i - 1].T_map_truth)));
  }
  const auto drift_deg = commonAngle_deg(drifts_deg);
  if (moved && (!drift_deg || std::abs(*drift_deg) > 30))
    warnings.push_back(
        "the truth's heading is " +
        (drift_deg ? format("%.0f deg off its path", *drift_deg) : "not along its path") +
        ": lateral, longitudinal and heading errors mean little (attitude missing, or a camera's axes?)");
  return warnings;
}

template <class Value>
Statistics statisticsOver(const std::vector<PoseError>& poses, Value value) {
  std::vector<double> values;
  values.reserve(poses.size());
  for (const auto& pose : poses) values.push_back(pose.*value);
  return statisticsOf(std::move(values));
}

}  // namespace

TrajectoryFile readTrajectoryFile(const std::string& path) {
  Trajectory trajectory = readTum(path);
  std::error_code no_regular_file;
  const auto bytes = std::filesystem::file_size(path, no_regular_file);
  return {path, no_regular_file ? 0 : bytes, std::move(trajectory)};
}

Statistics statisticsOf(std::vector<double> values) {
  if (values.empty()) throw std::invalid_argument("statisticsOf: no values");
  const auto n = static_cast<double>(values.size());
  Statistics s{};
  s.mean = std::accumulate(values.begin(), values.end(), 0.0) / n;
  double squares = 0;
  double deviations = 0;
  for (const double v : values) {
    squares += v * v;
    deviations += (v - s.mean) * (v - s.mean);
    s.max = std::max(s.max, std::abs(v));
  }
  s.rmse = std::sqrt(squares / n);
  s.std = std::sqrt(deviations / n);
  std::sort(values.begin(), values.end());
  const std::size_t half = values.size() / 2;
  s.median = values.size() % 2 == 1 ? values[half] : 0.5 * (values[half - 1] + values[half]);
  return s;
}

double Evaluation::matchShare() const {
  return static_cast<double>(poses.size()) / static_cast<double>(estimate.trajectory.poses.size());
}

double Evaluation::coveredTruth_s() const { return poses.back().stamp_s - poses.front().stamp_s; }

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
  if (options.align == Alignment::none) requireOneMap(e.truth, e.estimate);
  match(e);
  if (options.align == Alignment::se3) align(e);
  fillErrors(e.poses);

  e.position_3d_m = statisticsOver(e.poses, &PoseError::position_3d_m);
  e.position_plane_m = statisticsOver(e.poses, &PoseError::position_plane_m);
  e.lateral_m = statisticsOver(e.poses, &PoseError::lateral_m);
  e.longitudinal_m = statisticsOver(e.poses, &PoseError::longitudinal_m);
  e.height_m = statisticsOver(e.poses, &PoseError::height_m);
  e.heading_deg = statisticsOver(e.poses, &PoseError::heading_deg);
  for (const double length_m : options.segment_lengths_m)
    e.relative.push_back(relativeError(e.poses, length_m));

  e.path_length_m = e.poses.back().station_m;
  const auto [slowest, fastest] = std::minmax_element(
      e.poses.begin(), e.poses.end(), [](const auto& a, const auto& b) { return a.speed_mps < b.speed_mps; });
  e.min_speed_mps = slowest->speed_mps;
  e.max_speed_mps = fastest->speed_mps;
  e.warnings = frameWarnings(e.poses);
  return e;
}

}  // namespace raceloc
