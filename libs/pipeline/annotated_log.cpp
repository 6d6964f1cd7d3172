#include "pipeline/annotated_log.h"

#include <mrpt/obs/CObservation3DScene.h>
#include <mrpt/obs/CObservationOdometry.h>
#include <mrpt/obs/CObservationRawDAQ.h>
#include <mrpt/opengl/CBox.h>
#include <mrpt/opengl/CEllipsoid2D.h>
#include <mrpt/opengl/COpenGLScene.h>
#include <mrpt/opengl/CPointCloud.h>
#include <mrpt/opengl/CText3D.h>
#include <mrpt/opengl/stock_objects.h>

#include <algorithm>
#include <cstdio>
#include <utility>

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
      " lateral_m longitudinal_m heading_rad alert_limit_m\n";
  return text;
}

const SourceVerdict* verdictOn(const LocalizerOutput& output, const std::string& source) {
  if (!output.decision) return nullptr;
  const auto& verdicts = output.decision->decision.sources;
  const auto found = std::find_if(verdicts.begin(), verdicts.end(),
                                  [&](const SourceVerdict& v) { return v.source == source; });
  return found == verdicts.end() ? nullptr : &*found;
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

/** "gps_left REJECTED 8.3 > 5.0". */
std::string verdictText(const SourceVerdict& v) {
  char text[160];
  if (v.accepted)
    std::snprintf(text, sizeof text, "%s ok %.2f, weight %.2f", v.source.c_str(), v.delta, v.weight);
  else
    std::snprintf(text, sizeof text, "%s %s %.1f > %.1f", v.source.c_str(),
                  v.left ? "LEFT THE OTHERS" : "REJECTED", v.delta, v.limit);
  return text;
}

/** At the end of the sweep. Axes as in the map, origin at the car: viewers look at the origin, and there the car stays.
 */
mrpt::obs::CObservation3DScene scene(const LocalizerOutput& output) {
  using namespace mrpt::opengl;
  const ScanMatch& m = *output.scan_match;
  const Eigen::Translation3d to_car(-m.T_map_body.translation());
  mrpt::obs::CObservation3DScene observation;
  observation.timestamp = toMrptStamp(m.stamp_s);
  observation.scene = COpenGLScene::Create();
  const mrpt::poses::CPose3D T_scene_body = toMrpt(to_car * m.T_map_body);

  auto car = CBox::Create(mrpt::math::TPoint3D(-1, -0.9, 0), mrpt::math::TPoint3D(3.8, 0.9, 1.2));
  car->setPose(T_scene_body);
  car->setColor_u8(mrpt::img::TColor(40, 120, 220, 180));
  observation.scene->insert(car);
  auto axes = stock_objects::CornerXYZSimple(3, 2);
  axes->setPose(T_scene_body);
  observation.scene->insert(axes);

  auto cloud = CPointCloud::Create();
  cloud->setAllPoints(m.scan_body.x, m.scan_body.y, m.scan_body.z);
  cloud->setPointSize(2);
  cloud->setPose(toMrpt(to_car * (m.trusted ? m.match.T_target_source : m.T_map_body)));
  cloud->setGradientColors({0.2F, 0.5F, 1.0F}, {1.0F, 0.9F, 0.2F});
  cloud->enableColorFromZ();
  observation.scene->insert(cloud);

  double line_m = 4.0;
  if (!output.decision) return observation;
  for (const auto& fix : output.decision->fixes) {
    const SourceVerdict* verdict = verdictOn(output, fix.source);
    const bool accepted = verdict && verdict->accepted;
    const mrpt::img::TColor color =
        accepted ? mrpt::img::TColor(40, 170, 60) : mrpt::img::TColor(220, 40, 40);
    auto ellipse = CEllipsoid2D::Create();
    ellipse->setCovMatrix(mrpt::math::CMatrixDouble22(fix.cov_p_m2));
    ellipse->setQuantiles(3.0F);
    const Eigen::Vector2d p_m = fix.p_map_m - m.T_map_body.translation().head<2>();
    ellipse->setLocation(p_m.x(), p_m.y(), 0);
    ellipse->setColor_u8(color);
    observation.scene->insert(ellipse);
    if (!verdict) continue;
    auto text = CText3D::Create(verdictText(*verdict), "sans", 0.8);
    text->setPose(mrpt::poses::CPose3D(0, 0, line_m, 0, 0, M_PI / 2));
    text->setColor_u8(color);
    observation.scene->insert(text);
    line_m += 1.2;
  }
  return observation;
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
  if (output.scan_match) x_writer.write(scene(output));
}

}  // namespace raceloc
