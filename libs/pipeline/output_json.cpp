#include "pipeline/output_json.h"

#include <cmath>
#include <nlohmann/json.hpp>

namespace raceloc {

namespace {

using Json = nlohmann::ordered_json;  // keys in the order in which they are described

Json poseJson(const Pose& T_map_body) {
  const Eigen::Vector3d p_m = T_map_body.translation();
  const Eigen::Matrix3d R = T_map_body.linear();  // Rz(yaw) Ry(pitch) Rx(roll)
  return {{"x_m", p_m.x()},
          {"y_m", p_m.y()},
          {"z_m", p_m.z()},
          {"roll_rad", std::atan2(R(2, 1), R(2, 2))},
          {"pitch_rad", std::atan2(-R(2, 0), std::hypot(R(2, 1), R(2, 2)))},
          {"yaw_rad", yawOf(T_map_body)}};
}

Json covarianceJson(const Matrix6d& covariance) {
  Json rows = Json::array();
  for (Eigen::Index row = 0; row < 6; ++row)
    for (Eigen::Index col = 0; col < 6; ++col) rows.push_back(covariance(row, col));
  return rows;
}

Json verdictJson(const SourceVerdict& v) {
  return {{"source", v.source},     {"accepted", v.accepted}, {"delta", v.delta}, {"limit", v.limit},
          {"p_theta", v.p_theta},   {"weight", v.weight},     {"nis", v.nis},     {"inflation", v.inflation},
          {"confirms", v.confirms}, {"left", v.left}};
}

Json orNull(const std::optional<double>& value) { return value ? Json(*value) : Json(nullptr); }

const char* nameOf(Side side) { return side == Side::left ? "left" : "right"; }

const char* nameOf(ScanVerdict verdict) {
  switch (verdict) {
    case ScanVerdict::good:
      return "good";
    case ScanVerdict::no_points:
      return "no_points";
    case ScanVerdict::ground_not_below:
      return "ground_not_below";
  }
  return "no_points";
}

Json wallJson(const std::optional<Wall>& wall) {
  if (!wall) return nullptr;
  return {{"distance_m", wall->distance_m()},   {"distance_sigma_m", wall->distanceSigma_m()},
          {"heading_rad", wall->heading_rad()}, {"beta", {wall->beta[0], wall->beta[1], wall->beta[2]}},
          {"from_x_m", wall->from_x_m},         {"to_x_m", wall->to_x_m},
          {"length_m", wall->length_m},         {"residual_m", wall->residual_m},
          {"height_m", wall->height_m},         {"age_s", wall->age_s}};
}

Json pathJson(const std::optional<WallPath>& path) {
  if (!path) return nullptr;
  Json points = Json::array();
  for (const PathPoint& p : path->points) points.push_back({p.x_m, p.y_m, p.heading_rad, p.curvature_per_m});
  return {{"side", nameOf(path->side)},   {"gap_m", path->gap_m},       {"valid_m", path->valid_m},
          {"settled_m", path->settled_m}, {"drivable", path->drivable}, {"points", std::move(points)}};
}

Json wallsJson(const std::optional<WallReport>& report) {
  if (!report) return nullptr;
  const WallScan& walls = report->walls;
  const GuardOutput& guard = report->guard;
  const Clearance& clearance = guard.clearance;
  return {{"stamp_s", walls.stamp_s},
          {"scan", nameOf(walls.verdict)},
          {"left", wallJson(walls.left)},
          {"right", wallJson(walls.right)},
          {"guard", nameOf(guard.state)},
          {"nearest", clearance.side ? Json(nameOf(*clearance.side)) : Json(nullptr)},
          {"wheel_to_wall_m", clearance.side ? Json(clearance.wheel_m) : Json(nullptr)},
          {"time_to_wall_s", orNull(clearance.time_to_wall_s)},
          {"path", pathJson(guard.path)}};
}

}  // namespace

std::string outputJson(const LocalizerOutput& output, const OutputContext& context) {
  const auto& [number, age_s] = context;
  const GateDecision* decision = output.decision ? &output.decision->decision : nullptr;
  const Integrity& integrity = output.integrity;
  Json verdicts = Json::array();
  if (decision)
    for (const SourceVerdict& v : decision->sources) verdicts.push_back(verdictJson(v));
  const Json line{{"number", number},
                  {"stamp_s", output.stamp_s},
                  {"age_s", orNull(age_s)},
                  {"pose", poseJson(output.T_map_body)},
                  {"covariance", covarianceJson(output.covariance)},
                  {"speed_mps", output.speed_mps},
                  {"yaw_rate_rps", output.yaw_rate_rps},
                  {"state", nameOf(integrity.state)},
                  {"cause", integrity.cause},
                  {"measured", integrity.measured},
                  {"limit", integrity.limit},
                  {"protection",
                   {{"lateral_m", integrity.protection.lateral_m},
                    {"longitudinal_m", integrity.protection.longitudinal_m},
                    {"heading_rad", integrity.protection.heading_rad}}},
                  {"alert_limit_m", integrity.alert_limit_m},
                  {"rule", decision ? static_cast<int>(decision->rule) : 0},
                  {"alarm", decision && decision->alarm},
                  {"reset", decision && decision->reset},
                  {"sources", std::move(verdicts)},
                  {"walls", wallsJson(output.walls)}};
  // A label may be anything: what is no UTF-8 is replaced rather than fatal.
  return line.dump(-1, ' ', false, Json::error_handler_t::replace);
}

}  // namespace raceloc
