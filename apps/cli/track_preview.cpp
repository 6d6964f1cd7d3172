#include "cli/track_preview.h"

#include <algorithm>
#include <cctype>
#include <cmath>
#include <cstdio>

#include "eval/gnuplot.h"

namespace raceloc {

namespace {

constexpr double kStep_m = 4;
constexpr double kWaypoint_m = 100;

std::string row(const Eigen::Vector3d& p_map_m, const std::string& more = "") {
  char text[80];
  std::snprintf(text, sizeof text, "%.2f %.2f ", p_map_m.x(), p_map_m.y());
  return text + more + "\n";
}

/** Calls `at` at even steps from one station to another, both included. */
template <class At>
void along(double from_m, double to_m, At at) {
  const int steps = std::max(1, static_cast<int>(std::ceil((to_m - from_m) / kStep_m)));
  for (int k = 0; k <= steps; ++k) at(from_m + k * (to_m - from_m) / steps);
}

/** Beside the road, `out_m` from its edge. */
Eigen::Vector3d beside(const Track& track, double s_m, Side side, double out_m) {
  const RoadFrame centre = track.at(s_m);
  const double n_m = side == Side::left ? centre.left_m + out_m : -centre.right_m - out_m;
  return centre.T_map_road * Eigen::Vector3d(0, n_m, 0);
}

std::string block(const std::string& name, const std::string& rows) {
  return "$" + name + " << EOD\n" + (rows.empty() ? "NaN NaN NaN\n" : rows) + "EOD\n";
}

std::string footprint(const Track& track, const Scenery& scenery, Side side) {
  std::string rows;
  along(scenery.from_m, scenery.to_m,
        [&](double s_m) { rows += row(beside(track, s_m, side, scenery.offset_m)); });
  along(scenery.from_m, scenery.to_m, [&](double way_m) {
    const double s_m = scenery.from_m + scenery.to_m - way_m;
    rows += row(beside(track, s_m, side, scenery.offset_m + scenery.depth_m));
  });
  return rows + row(beside(track, scenery.from_m, side, scenery.offset_m)) + "\n";
}

/** In single quotes, within which gnuplot takes nothing for a command. */
std::string gnuplotString(const std::string& text) {
  std::string safe = "'";
  for (const char c : text)
    safe += c == '\'' ? std::string("''")
                      : std::string(1, std::iscntrl(static_cast<unsigned char>(c)) != 0 ? ' ' : c);
  return safe + "'";
}

bool spansRoad(SceneryKind kind) {
  return kind == SceneryKind::gantry || kind == SceneryKind::overpass || kind == SceneryKind::tunnel;
}

}  // namespace

std::string trackPreview(const Circuit& circuit, const RacingLine& line, const SpeedProfile& profile) {
  const Track& track = circuit.track;
  std::string edges, walls, fences, built, trees, spans, path, waypoints;
  for (const Side side : {Side::left, Side::right}) {
    along(0, track.length_m(), [&](double s_m) { edges += row(beside(track, s_m, side, 0)); });
    edges += "\n";
  }
  for (const auto& barrier : circuit.barriers) {
    std::string& rows = barrier.fence_m > 0 ? fences : walls;
    along(barrier.from_m, barrier.to_m,
          [&](double s_m) { rows += row(beside(track, s_m, barrier.side, barrier.offset_m)); });
    rows += "\n";
  }
  for (const auto& scenery : circuit.scenery) {
    if (spansRoad(scenery.kind))
      spans += row(beside(track, scenery.from_m, Side::left, scenery.offset_m)) +
               row(beside(track, scenery.from_m, Side::right, scenery.offset_m)) + "\n";
    else
      for (const Side side : {Side::left, Side::right})
        if (scenery.side == side || scenery.side == Side::both)
          (scenery.kind == SceneryKind::trees ? trees : built) += footprint(track, scenery, side);
  }
  const auto onLine = [&](double s_m) -> Eigen::Vector3d {
    const Pose T_map_surface = track.surface(s_m, line.at(s_m).n_m).T_map_surface;
    return T_map_surface.translation();
  };
  along(0, track.length_m(),
        [&](double s_m) { path += row(onLine(s_m), std::to_string(3.6 * profile.at(s_m).speed_mps)); });
  for (int number = 0; number * kWaypoint_m < track.length_m(); ++number)
    waypoints += row(onLine(number * kWaypoint_m), number % 5 == 0 ? std::to_string(number) : "\"\"");

  char title[300];
  std::snprintf(
      title, sizeof title,
      "%s: %.0f m; lap %.1f s at %.0f km/h, top %.0f km/h; way-points every %.0f m of the racing line",
      circuit.name.c_str(), track.length_m(), profile.lap_s(), 3.6 * profile.mean_mps(),
      3.6 * profile.top_mps(), kWaypoint_m);
  const Eigen::Vector3d start = onLine(0), ahead = onLine(0.03 * track.length_m());
  char arrow[200];
  std::snprintf(arrow, sizeof arrow, "set arrow 1 from %.1f,%.1f to %.1f,%.1f lw 3 lc rgb '#D55E00' front\n",
                start.x(), start.y(), ahead.x(), ahead.y());
  return gnuplot(
      block("edges", edges) + block("walls", walls) + block("fences", fences) + block("built", built) +
      block("trees", trees) + block("spans", spans) + block("path", path) + block("waypoints", waypoints) +
      "set terminal pngcairo size 1600,1200 font 'DejaVu Sans,11' noenhanced\n"
      "set size ratio -1\nset grid lc rgb '#E0E0E0'\nset xlabel 'x, east [m]'\nset ylabel 'y, north [m]'\n"
      "set bmargin 7\nset key outside bottom horizontal\nset cblabel 'speed [km/h]'\nset palette defined (0 "
      "'#440154', 0.33 "
      "'#31688E', 0.67 '#35B779', 1 '#FDE725')\nset title " +
      gnuplotString(title) + "\n" + arrow +
      "plot $trees with filledcurves closed fc rgb '#BFE0BF' title 'trees', "
      "$built with filledcurves closed fc rgb '#C8B8A8' title 'stands, buildings', "
      "$edges with lines lw 1 lc rgb '#404040' title 'edges of the road', "
      "$walls with lines lw 2 lc rgb '#0072B2' title 'walls', "
      "$fences with lines lw 2 lc rgb '#CC79A7' title 'walls with a fence', "
      "$spans with lines lw 4 lc rgb '#000000' title 'gantries, bridges', "
      "$path using 1:2:3 with lines lw 2 lc palette title 'racing line', "
      "$waypoints using 1:2 with points pt 7 ps 0.5 lc rgb '#D55E00' title 'way-points', "
      "$waypoints using 1:2:3 with labels offset 0,0.7 font ',9' notitle\n");
}

}  // namespace raceloc
