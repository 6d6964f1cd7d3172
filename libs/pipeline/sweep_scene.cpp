#include "pipeline/sweep_scene.h"

#include <mrpt/opengl/CBox.h>
#include <mrpt/opengl/CEllipsoid2D.h>
#include <mrpt/opengl/CPointCloud.h>
#include <mrpt/opengl/CSetOfLines.h>
#include <mrpt/opengl/CSetOfObjects.h>
#include <mrpt/opengl/CText3D.h>
#include <mrpt/opengl/stock_objects.h>

#include <algorithm>
#include <cmath>
#include <cstdio>

#include "sensors/pose_conversion.h"

namespace raceloc {

namespace {

using namespace mrpt::opengl;

/** A colour for the name of a cluster: neighbours' differ. */
mrpt::img::TColor colorOf(std::int32_t cluster) {
  const double hue = std::fmod(0.618 * cluster, 1.0);
  const auto channel = [&](double shift) {
    return static_cast<std::uint8_t>(std::lround(140 + 110 * std::cos(2 * M_PI * (hue + shift))));
  };
  return {channel(0), channel(1.0 / 3), channel(2.0 / 3)};
}

CSetOfLines::Ptr lines(float width, const mrpt::img::TColor& color) {
  auto set = CSetOfLines::Create();
  set->setLineWidth(width);
  set->setColor_u8(color);
  return set;
}

/** What stands, a bar a cell in the colour of its cluster; each wall as a fence, grey while it is only remembered; the path
 * on the ground. Body frame. */
CSetOfObjects::Ptr wallObjects(const WallReport& report) {
  auto objects = CSetOfObjects::Create();
  const auto& cells = report.cells;
  for (std::size_t i = 0; i < cells.size(); ++i) {
    auto bar = lines(3, colorOf(report.clusters[i]));
    bar->appendLine(cells.face.x[i], cells.face.y[i], cells.lowest_m[i], cells.face.x[i], cells.face.y[i],
                    cells.highest_m[i]);
    objects->insert(bar);
  }
  constexpr double kPost_m = 2;
  for (const auto* wall : {&report.walls.left, &report.walls.right}) {
    if (!*wall) continue;
    const Wall& w = **wall;
    auto fence = lines(4, w.age_s > 0 ? mrpt::img::TColor(150, 150, 150) : mrpt::img::TColor(230, 60, 200));
    const int pieces = static_cast<int>(std::ceil((w.to_x_m - w.from_x_m) / kPost_m));
    for (int i = 0; i < pieces; ++i) {
      const double x = w.from_x_m + i * kPost_m, to_x = std::min(x + kPost_m, w.to_x_m);
      for (const double z : {0.0, w.height_m}) fence->appendLine(x, w.y_m(x), z, to_x, w.y_m(to_x), z);
      fence->appendLine(x, w.y_m(x), 0.0, x, w.y_m(x), w.height_m);
    }
    objects->insert(fence);
  }
  if (report.guard.path) {
    auto way = lines(6, {60, 220, 90});
    const Path& points = report.guard.path->points;
    for (std::size_t i = 1; i < points.size(); ++i)
      way->appendLine(points[i - 1].x_m, points[i - 1].y_m, 0.0, points[i].x_m, points[i].y_m, 0.0);
    objects->insert(way);
  }
  return objects;
}

/** "guard wall_following: left wall 2.1 m from the wheel, reached in 1.3 s". */
std::string guardText(const GuardOutput& guard) {
  std::string text = std::string("guard ") + nameOf(guard.state);
  const Clearance& c = guard.clearance;
  char part[80];
  if (c.side) {
    std::snprintf(part, sizeof part, ": %s wall %.1f m from the wheel",
                  *c.side == Side::left ? "left" : "right", c.wheel_m);
    text += part;
  }
  if (c.time_to_wall_s) {
    std::snprintf(part, sizeof part, ", reached in %.1f s", *c.time_to_wall_s);
    text += part;
  }
  return text;
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

}  // namespace

mrpt::opengl::COpenGLScene::Ptr sweepScene(const LocalizerOutput& output) {
  const ScanMatch& m = *output.scan_match;
  const Eigen::Translation3d to_car(-m.T_map_body.translation());
  auto scene = COpenGLScene::Create();
  const mrpt::poses::CPose3D T_scene_body = toMrpt(to_car * m.T_map_body);

  auto car = CBox::Create(mrpt::math::TPoint3D(-1, -0.9, 0), mrpt::math::TPoint3D(3.8, 0.9, 1.2));
  car->setPose(T_scene_body);
  car->setColor_u8(mrpt::img::TColor(40, 120, 220, 180));
  scene->insert(car);
  auto axes = stock_objects::CornerXYZSimple(3, 2);
  axes->setPose(T_scene_body);
  scene->insert(axes);

  auto cloud = CPointCloud::Create();
  cloud->setAllPoints(m.scan_body.x, m.scan_body.y, m.scan_body.z);
  cloud->setPointSize(2);
  cloud->setPose(toMrpt(to_car * (m.trusted ? m.match.T_target_source : m.T_map_body)));
  cloud->setGradientColors({0.2F, 0.5F, 1.0F}, {1.0F, 0.9F, 0.2F});
  cloud->enableColorFromZ();
  scene->insert(cloud);

  double line_m = 4.0;
  const auto say = [&](const std::string& words, const mrpt::img::TColor& color) {
    auto text = CText3D::Create(words, "sans", 0.8);
    text->setPose(mrpt::poses::CPose3D(0, 0, line_m, 0, 0, M_PI / 2));
    text->setColor_u8(color);
    scene->insert(text);
    line_m += 1.2;
  };
  if (output.walls) {
    auto drawn = wallObjects(*output.walls);
    drawn->setPose(T_scene_body);
    scene->insert(drawn);
    say(guardText(output.walls->guard), {230, 160, 30});
  }
  if (!output.decision) return scene;
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
    scene->insert(ellipse);
    if (verdict) say(verdictText(*verdict), color);
  }
  return scene;
}

}  // namespace raceloc
