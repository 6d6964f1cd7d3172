#include "pipeline/annotated_log.h"

#include <mrpt/obs/CObservation3DScene.h>
#include <mrpt/obs/CObservationOdometry.h>
#include <mrpt/obs/CObservationRawDAQ.h>

#include <utility>

#include "pipeline/sweep_scene.h"
#include "sensors/mrpt_stamp.h"
#include "sensors/pose_conversion.h"

namespace raceloc {

namespace {

std::string headerText(const std::vector<std::string>& sources) {
  std::string text =
      "[gate]\ncolumns = rule alarm, then of each source delta limit p_theta weight accepted\n";
  for (std::size_t i = 0; i < sources.size(); ++i)
    text += "source_" + std::to_string(i) + " = " + sources[i] + "\n";
  text +=
      "[integrity]\ncolumns = state (0 ok, 1 degraded, 2 dead reckoning, 3 lost) measured limit"
      " lateral_m longitudinal_m heading_rad alert_limit_m\n"
      "[guard]\ncolumns = state (0 localized, 1 wall following, 2 emergency, 3 no wall) wheel_to_wall_m"
      " time_to_wall_s, then of the left and of the right wall distance_m distance_sigma_m heading_rad "
      "length_m age_s\n";
  return text;
}

mrpt::obs::CObservationRawDAQ gateNumbers(const LocalizerOutput& output,
                                          const std::vector<std::string>& sources) {
  mrpt::obs::CObservationRawDAQ daq;
  daq.sensorLabel = "gate";
  daq.timestamp = toMrptStamp(output.decision->stamp_s);
  daq.AIN_double = {static_cast<double>(output.decision->decision.rule),
                    output.decision->decision.alarm ? 1.0 : 0.0};
  for (const auto& source : sources)
    if (const SourceVerdict* v = verdictOn(output, source))
      daq.AIN_double.insert(daq.AIN_double.end(),
                            {v->delta, v->limit, v->p_theta, v->weight, v->accepted ? 1.0 : 0.0});
    else
      daq.AIN_double.insert(daq.AIN_double.end(), 5, -1.0);
  daq.AIN_channel_count = static_cast<std::uint16_t>(daq.AIN_double.size());
  return daq;
}

mrpt::obs::CObservationRawDAQ integrityNumbers(const LocalizerOutput& output) {
  const Integrity& integrity = output.integrity;
  mrpt::obs::CObservationRawDAQ daq;
  daq.sensorLabel = "integrity";
  daq.timestamp = toMrptStamp(output.stamp_s);
  daq.AIN_double = {static_cast<double>(integrity.state),
                    integrity.measured,
                    integrity.limit,
                    integrity.protection.lateral_m,
                    integrity.protection.longitudinal_m,
                    integrity.protection.heading_rad,
                    integrity.alert_limit_m};
  daq.AIN_channel_count = static_cast<std::uint16_t>(daq.AIN_double.size());
  return daq;
}

constexpr double kNone = -1e9;  // of a quantity that may have any sign

mrpt::obs::CObservationRawDAQ guardNumbers(const WallReport& report) {
  const WallScan& walls = report.walls;
  const GuardOutput& guard = report.guard;
  mrpt::obs::CObservationRawDAQ daq;
  daq.sensorLabel = "guard";
  daq.timestamp = toMrptStamp(walls.stamp_s);
  daq.AIN_double = {static_cast<double>(guard.state), guard.clearance.side ? guard.clearance.wheel_m : kNone,
                    guard.clearance.time_to_wall_s.value_or(kNone)};
  for (const auto* wall : {&walls.left, &walls.right})
    if (*wall)
      daq.AIN_double.insert(daq.AIN_double.end(),
                            {(*wall)->distance_m(), (*wall)->distanceSigma_m(), (*wall)->heading_rad(),
                             (*wall)->length_m, (*wall)->age_s});
    else
      daq.AIN_double.insert(daq.AIN_double.end(), 5, kNone);
  daq.AIN_channel_count = static_cast<std::uint16_t>(daq.AIN_double.size());
  return daq;
}

}  // namespace

AnnotatedLog::AnnotatedLog(const std::string& path, const GeodeticPoint& origin,
                           std::vector<std::string> sources, int gzip_level)
    : x_sources(std::move(sources)), x_writer(path, {origin, headerText(x_sources)}, gzip_level) {}

void AnnotatedLog::write(const Sample& sample) {
  if (const auto* motion = std::get_if<MotionSample>(&sample))
    x_writer.writeVehicleAsDaq(*motion);
  else
    x_writer.write(sample);
}

void AnnotatedLog::write(const LocalizerOutput& output) {
  mrpt::obs::CObservationOdometry odometry;
  odometry.sensorLabel = "estimate";
  odometry.timestamp = toMrptStamp(output.stamp_s);
  odometry.odometry = mrpt::poses::CPose2D(toMrpt(output.T_map_body));
  x_writer.write(odometry);

  x_writer.writePose(output.stamp_s, "estimate_pose", output.T_map_body, output.covariance);
  x_writer.write(integrityNumbers(output));
  if (output.decision) x_writer.write(gateNumbers(output, x_sources));
  if (output.walls) x_writer.write(guardNumbers(*output.walls));
  if (!output.scan_match) return;
  mrpt::obs::CObservation3DScene scene;
  scene.timestamp = toMrptStamp(output.scan_match->stamp_s);
  scene.scene = sweepScene(output);
  x_writer.write(scene);
}

}  // namespace raceloc
