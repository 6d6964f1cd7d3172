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
                  {"sources", std::move(verdicts)}};
  // A label may be anything: what is no UTF-8 is replaced rather than fatal.
  return line.dump(-1, ' ', false, Json::error_handler_t::replace);
}

}  // namespace raceloc
