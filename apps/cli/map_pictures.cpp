#include "cli/map_pictures.h"

#include <algorithm>
#include <cmath>
#include <utility>
#include <vector>

#include "eval/format.h"
#include "eval/gnuplot.h"
#include "eval/picture.h"

namespace raceloc {

namespace {

constexpr char kPurple[] = "#CC79A7";
constexpr char kOrange[] = "#E69F00";
constexpr char kSky[] = "#56B4E9";

/** Rows of numbers under a name, and how they are drawn: none of it where there are no rows. */
class Curves {
 public:
  void row(double x, double y) { x_rows += number(x) + " " + number(y) + "\n"; }
  void gap() { x_rows += "\n"; }
  /** Ends the rows of one curve. \param style  as in gnuplot's plot command */
  void curve(const std::string& style) {
    if (x_rows.find_first_not_of('\n') != std::string::npos) {
      const std::string name = "$curve" + std::to_string(x_count++);
      x_data += name + " << EOD\n" + x_rows + "EOD\n";
      also(name + " using 1:2 " + style);
    }
    x_rows.clear();
  }
  void also(const std::string& plot) { x_plots += (x_plots.empty() ? "plot " : ", ") + plot; }
  [[nodiscard]] std::string script() const { return x_data + x_plots + "\n"; }

 private:
  std::string x_rows, x_data, x_plots;
  int x_count = 0;
};

std::string colour(const std::string& name) { return " lc rgb '" + name + "' "; }

/** How many points are above each cell of a grid; rows from south to north. */
struct Grid {
  Eigen::AlignedBox2d box;
  double cell_m;
  int columns, rows;
  std::vector<int> counts;
  [[nodiscard]] std::size_t index(int column, int row) const {
    return static_cast<std::size_t>(row) * static_cast<std::size_t>(columns) +
           static_cast<std::size_t>(column);
  }
};

Grid gridOf(const TiledMap& tiles, const Eigen::AlignedBox2d& box) {
  const double cell_m = box.sizes().maxCoeff() / (0.8 * kPicture_px);
  Grid grid{box,
            cell_m,
            static_cast<int>(std::ceil(box.sizes().x() / cell_m)),
            static_cast<int>(std::ceil(box.sizes().y() / cell_m)),
            {}};
  grid.counts.resize(grid.index(0, grid.rows));
  for (const auto& entry : tiles.tiles()) {
    const Tile& tile = entry.second;
    const Eigen::Vector2d corner_m = tileCorner(tile, tiles.tileSize()).head<2>();
    for (std::size_t i = 0; i < tile.cloud.size(); ++i) {
      const Eigen::Vector2d p_m = corner_m + tile.cloud.point(i).head<2>().cast<double>();
      const Eigen::Vector2i at = ((p_m - box.min()) / cell_m).array().floor().matrix().cast<int>();
      if (at.x() >= 0 && at.x() < grid.columns && at.y() >= 0 && at.y() < grid.rows)
        ++grid.counts[grid.index(at.x(), at.y())];
    }
  }
  return grid;
}

/** Panels below each other with one axis of stations, each with its key above it. */
std::string panels(const std::string& name, int count, int panel_px, const QaResult& qa) {
  constexpr int kTop_px = 42, kBottom_px = 56;
  const int height_px = count * panel_px + kTop_px + kBottom_px;
  const auto share = [&](int px) { return number(static_cast<double>(px) / height_px); };
  return svgTerminal(name, height_px) + "set multiplot layout " + std::to_string(count) +
         ",1 margins 0.13,0.98," + share(kBottom_px) + "," + share(height_px - kTop_px) + " spacing " +
         share(kTop_px) +
         "\nset xrange [0:" + number(qa.spacing_m * static_cast<double>(qa.stations.size())) +
         "]\nset key at graph 1,1 right bottom horizontal maxrows 1 Left reverse samplen 2\nset format x "
         "''\n";
}
std::string lastPanel(const QaResult& qa) {
  return std::string("set format x '%.10g'\nset xlabel '") +
         (qa.on_lap ? "station along the racing line [m]" : "driven [m]") + "'\n";
}
std::string panelLabel(const std::string& text) {
  std::string quoted;
  for (const char c : text) quoted += c == '\'' ? "''" : std::string(1, c == '\n' ? ' ' : c);
  return "set label 1 '" + quoted + "' at graph -0.105,0.5 center rotate\n";
}

}  // namespace

std::string mapPicture(const BuiltMap& built) {
  const MapContent& content = built.content;
  const auto& keys = content.key_poses;
  const auto at = [&](std::size_t key) {
    return Eigen::Vector2d(keys[key].T_map_body.translation().head<2>());
  };
  Eigen::AlignedBox2d box;
  for (std::size_t key = 0; key < keys.size(); ++key) box.extend(at(key));
  for (const WallPoint& wall : content.walls) box.extend(Eigen::Vector2d(wall.p_map_foot_m.head<2>()));
  const Eigen::Vector2d margin_m = Eigen::Vector2d::Constant(std::max(10.0, 0.04 * box.sizes().maxCoeff()));
  box = Eigen::AlignedBox2d(box.min() - margin_m, box.max() + margin_m);

  const Grid grid = gridOf(built.tiles, box);
  std::string script = "$points << EOD\n";
  for (int row = 0; row < grid.rows; ++row) {
    for (int column = 0; column < grid.columns; ++column) {
      const int count = grid.counts[grid.index(column, row)];
      script += (column > 0 ? " " : "") + number(std::round(100 * std::log1p(count)) / 100);
    }
    script += "\n";
  }
  script += "EOD\n";

  Curves curves;
  curves.also("$points matrix using (" + number(box.min().x() + grid.cell_m / 2) + "+$1*" +
              number(grid.cell_m) + "):(" + number(box.min().y() + grid.cell_m / 2) + "+$2*" +
              number(grid.cell_m) + "):3 with image notitle");
  const double spacing_m = content.info.waypoint_spacing_m;
  for (const WallSide side : {WallSide::left, WallSide::right}) {
    double before_m = 0;
    for (const WallPoint& wall : content.walls) {
      if (wall.side != side) continue;
      if (wall.station_m > before_m + 1.5 * spacing_m) curves.gap();
      before_m = wall.station_m;
      curves.row(wall.p_map_foot_m.x(), wall.p_map_foot_m.y());
    }
    curves.curve(side == WallSide::left ? "with lines lw 2.5" + colour(kPurple) + "title 'left wall'"
                                        : "with lines lw 2.5" + colour(kOrange) + "title 'right wall'");
  }
  for (const GpsSpan& span : built.report.gps_spans) {
    if (!span.refused) continue;
    curves.gap();
    for (std::size_t key = span.first; key <= span.last; ++key) curves.row(at(key).x(), at(key).y());
    curves.row(at(span.last).x(), at(span.last).y() + 0.1);  // a span of one fix shows too
  }
  curves.curve("with lines lw 7" + colour(kVermillion) + "title 'GPS refused'");
  const std::vector<std::string> colours{kBlue, kGreen, kSky, "#000000"};
  for (std::size_t n = 0; n < content.info.sessions.size(); ++n) {
    for (std::size_t key = 0; key < keys.size(); ++key)
      if (keys[key].session == content.info.sessions[n]) curves.row(at(key).x(), at(key).y());
    curves.curve("with lines lw 1.5" + colour(colours[n % colours.size()]) + "title '" +
                 std::to_string(n + 1) + ". drive'");
  }
  for (const MapWaypoint& w : content.waypoints) curves.row(w.p_map_m.x(), w.p_map_m.y());
  if (!content.waypoints.empty())
    curves.row(content.waypoints.front().p_map_m.x(), content.waypoints.front().p_map_m.y());
  curves.curve("with lines lw 1 dt 2" + colour("black") + "title 'racing line'");
  if (!content.waypoints.empty())
    curves.row(content.waypoints.front().p_map_m.x(), content.waypoints.front().p_map_m.y());
  curves.curve("with points pt 6 ps 1.2 lw 2" + colour("black") + "title 'station 0'");

  const int height_px =
      std::clamp(static_cast<int>(kPicture_px * 0.86 * box.sizes().y() / box.sizes().x()) + 130, 360, 900);
  script +=
      svgTerminal("map", height_px) +
      "set size ratio -1\nunset grid\nunset colorbox\nset palette defined (0 'white', 1 '#6A6A6A')\n"
      "set xlabel 'east [m]'\nset ylabel 'north [m]'\nset key outside top center horizontal Left reverse "
      "samplen 2\nset xrange [" +
      number(box.min().x()) + ":" + number(box.max().x()) + "]\nset yrange [" + number(box.min().y()) + ":" +
      number(box.max().y()) + "]\n";
  return gnuplot(script + curves.script());
}

std::string fixPicture(const QaResult& qa) {
  const auto count = static_cast<int>(qa.receivers.size());
  std::string script = panels("fixes", count, 190, qa) + "set logscale y\nset yrange [0.002<*:*]\n";
  for (std::size_t r = 0; r < qa.receivers.size(); ++r) {
    Curves curves;
    for (const bool refused : {false, true}) {
      for (const FixResidual& fix : qa.fixes)
        if (fix.receiver == r && fix.refused == refused && fix.station_m)
          curves.row(*fix.station_m, std::max(fix.off_m, 0.002));
      curves.curve(refused ? "with points pt 2 ps 0.5" + colour(kVermillion) + "title 'refused'"
                           : "with points pt 7 ps 0.25" + colour(kBlue) + "title 'believed'");
    }
    curves.also("NaN notitle");
    if (r + 1 == qa.receivers.size()) script += lastPanel(qa);
    script += panelLabel(qa.receivers[r].receiver + " [m]") + curves.script();
  }
  return gnuplot(script + "unset multiplot\n");
}

std::string loopPicture(const QaResult& qa, const MapReport& report, double degenerate_loop_sigma_m) {
  struct Kind {
    bool rivals, weak;
    std::string style;
  };
  Curves residuals;
  for (const Kind& kind :
       {Kind{false, false, "pt 7 ps 0.5" + colour(kBlue) + "title 'kept'"},
        Kind{false, true, "pt 6 ps 0.6 lw 1.5" + colour(kBlue) + "title 'degenerate'"},
        Kind{true, false, "pt 7 ps 0.5" + colour(kOrange) + "title 'fits elsewhere'"},
        Kind{true, true, "pt 6 ps 0.6 lw 1.5" + colour(kOrange) + "title 'elsewhere, degenerate'"}}) {
    for (const LoopResidual& loop : qa.loops)
      if ((loop.rivals > 0) == kind.rivals && (loop.weakest.sigma_m > degenerate_loop_sigma_m) == kind.weak &&
          loop.station_m)
        residuals.row(*loop.station_m, std::max(loop.off_m, 0.001));
    residuals.curve("with points " + kind.style);
  }
  residuals.also("NaN notitle");
  const std::pair<LoopRefusal, const char*> reasons[] = {{LoopRefusal::ambiguous, "ambiguous"},
                                                         {LoopRefusal::disagrees, "disagrees"},
                                                         {LoopRefusal::alone, "alone"},
                                                         {LoopRefusal::no_match, "no match"}};
  Curves refused;
  std::string tics;
  double y = 0;
  for (const auto& [reason, name] : reasons) {
    for (std::size_t i = 0; i < report.refused_loops.size(); ++i)
      if (report.refused_loops[i].reason == reason && qa.refused_loops_at_m[i])
        refused.row(*qa.refused_loops_at_m[i], y);
    tics += std::string(tics.empty() ? "'" : ", '") + name + "' " + number(y);
    y += 1;
  }
  refused.curve("with points pt 2 ps 0.6" + colour(kVermillion) + "notitle");
  refused.also("NaN notitle");
  return gnuplot(panels("loops", 2, 190, qa) + "set logscale y\nset yrange [0.001<*:*]\n" +
                 panelLabel("off the map [m]") + residuals.script() +
                 "unset logscale y\nset yrange [-0.7:3.7]\nset ytics (" + tics + ")\nunset label 1\n" +
                 lastPanel(qa) + refused.script() + "unset multiplot\n");
}

std::string sigmaPicture(const QaResult& qa, double degenerate_sigma_m) {
  Curves curves;
  for (const bool along : {false, true}) {
    for (const StationQa& s : qa.stations) {
      if (s.odometry)
        curves.row(s.station_m, along ? s.odometry->along_m : s.odometry->sigma_m);
      else
        curves.gap();
    }
    curves.curve(along ? "with lines lw 1.2 dt 2" + colour(kSky) + "title 'odometry, along'"
                       : "with lines lw 1.5" + colour(kBlue) + "title 'odometry, weakest'");
  }
  for (const LoopResidual& loop : qa.loops)
    if (loop.station_m) curves.row(*loop.station_m, loop.weakest.sigma_m);
  curves.curve("with points pt 7 ps 0.5" + colour(kOrange) + "title 'loops, weakest'");
  curves.also(number(degenerate_sigma_m) + " with lines lw 1" + colour(kVermillion) +
              "title 'limit of odometry'");
  return gnuplot(panels("sigma", 1, 240, qa) + "set logscale y\n" + panelLabel("sigma [m]") + lastPanel(qa) +
                 curves.script() + "unset multiplot\n");
}

std::string coveragePicture(const QaResult& qa) {
  Curves passes;
  for (const StationQa& s : qa.stations) passes.row(s.station_m, s.passes);
  passes.curve("with steps lw 1.5" + colour(kBlue) + "notitle");
  Curves found;
  const std::pair<bool StationQa::*, double> rows[] = {
      {&StationQa::road, 0}, {&StationQa::wall_right, 1}, {&StationQa::wall_left, 2}};
  for (const auto& [has, y] : rows) {
    for (const StationQa& s : qa.stations) {
      if (s.*has) {
        found.row(s.station_m, y);
        found.row(s.station_m + qa.spacing_m, y);
      } else {
        found.gap();
      }
    }
    found.curve("with lines lw 6" + colour(kGreen) + "notitle");
  }
  found.also("NaN notitle");
  return gnuplot(
      panels("coverage", 2, 130, qa) + "set yrange [-0.2:1.2<*]\nset ytics 1\n" + panelLabel("passes") +
      passes.script() +
      "set yrange [-0.7:2.7]\nset ytics ('road' 0, 'right wall' 1, 'left wall' 2)\nunset label 1\n" +
      lastPanel(qa) + found.script() + "unset multiplot\n");
}

}  // namespace raceloc
