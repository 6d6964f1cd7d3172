#include <algorithm>
#include <cmath>
#include <utility>

#include "eval/acceleration.h"
#include "eval/cell_counts.h"
#include "eval/curves.h"
#include "eval/format.h"
#include "eval/plots.h"

namespace raceloc {

namespace {

constexpr std::size_t kFewestBins = 50;  // of a lap, when there are many
constexpr std::size_t kNamedLaps = 6;    // more do not fit into a key

/** The poses of one lap, as many as a curve shows: station on the lap and a value. */
class LapCurves {
 public:
  explicit LapCurves(const Evaluation& e)
      : x_poses(e.poses),
        x_stations_m(lapStations_m(e.poses, e.lap_starts_m)),
        x_stretch(stretchesOf(e.poses)) {
    for (std::size_t i = 0; i < x_poses.size(); ++i)
      if (i == 0 || x_stations_m[i] < x_stations_m[i - 1]) x_firsts.push_back(i);
    x_firsts.push_back(x_poses.size());
  }
  [[nodiscard]] std::size_t size() const { return x_firsts.size() - 1; }

  [[nodiscard]] std::string curve(std::size_t lap, double PoseError::*value) const {
    std::vector<double> y;
    for (std::size_t i = x_firsts[lap]; i < x_firsts[lap + 1]; ++i) y.push_back(x_poses[i].*value);
    std::string text;
    std::size_t before = x_firsts[lap];
    for (const std::size_t k : extremes(y, std::max(kBins / size(), kFewestBins))) {
      const std::size_t i = x_firsts[lap] + k;
      if (x_stretch[i] != x_stretch[before]) text += "\n";
      text += number(x_stations_m[i]) + " " + number(y[k]) + "\n";
      before = i;
    }
    return text;
  }

 private:
  const std::vector<PoseError>& x_poses;
  std::vector<double> x_stations_m;
  std::vector<int> x_stretch;
  std::vector<std::size_t> x_firsts;  // pose of each lap, and the end
};

}  // namespace

Picture stationPicture(const Evaluation& e) {
  constexpr const char* kColours[] = {kBlue, kVermillion, kGreen, "black", "#CC79A7", "#E69F00"};
  const LapCurves laps(e);
  const bool has_laps = e.lap_starts_m.size() > 1;
  std::string script, plots;
  for (std::size_t lap = 0; lap < laps.size(); ++lap) {
    const std::string number_text = std::to_string(lap + 1);
    script += "$lap" + number_text + " << EOD\n" + laps.curve(lap, &PoseError::position_plane_m) +
              "EOD\n$speed" + number_text + " << EOD\n" + laps.curve(lap, &PoseError::speed_mps) + "EOD\n";
    plots += ", $lap" + number_text + " using 1:2 with lines lw 1.2 lc rgb '" +
             kColours[lap % std::size(kColours)] + "' " +
             (lap >= kNamedLaps ? "notitle" : "title '" + (has_laps ? "lap " + number_text : "error") + "'");
  }
  script += "set xrange [0:" + number(std::max(lapLength_m(e.poses, e.lap_starts_m), 1.0)) +
            "]\nset yrange [0:*]\nset y2range [0:*]\nset y2tics\nset xlabel '" +
            (has_laps ? "way since the lap began [m]" : "way [m]") +
            "'\nset ylabel 'error in the plane [m]'\nset y2label 'speed [m/s]'\n"
            "set key outside top left horizontal Left reverse samplen 2\nplot ";
  for (std::size_t lap = 0; lap < laps.size(); ++lap)
    script += (lap == 0 ? "$speed" : ", $speed") + std::to_string(lap + 1) +
              " using 1:2 axes x1y2 with lines lw 1.2 lc rgb '" + kGrey + "' " +
              (lap == 0 ? "title 'speed'" : "notitle");
  return {"by_station", has_laps ? "Error by place on the lap" : "Error by way", 340, script + plots + "\n"};
}

Picture speedPicture(const Evaluation& e) {
  std::string script = "$bins << EOD\n";
  for (const ErrorBin& bin : e.by_speed)
    script +=
        "\"" + bin.name + "\" " + number(bin.lateral_rmse_m) + " " + number(bin.longitudinal_rmse_m) + "\n";
  script +=
      "EOD\nset style data histograms\nset style histogram clustered gap 1\nset style fill solid noborder\n"
      "set boxwidth 0.9\nset yrange [0:*]\nset ylabel 'rmse [m]'\n"
      "set key outside top left horizontal Left reverse samplen 2\nset xtics nomirror";
  if (e.by_speed.size() > 6) script += " rotate by -35 left";
  script += std::string("\nplot $bins using 2:xtic(1) lc rgb '") + kBlue +
            "' title 'lateral', $bins using 3 lc rgb '" + kVermillion + "' title 'longitudinal'\n";
  return {"by_speed", "Error by speed", 300, std::move(script)};
}

Picture ggPicture(const Evaluation& e) {
  CellCounts cells(CellCounts::Axes::linear, 0.02);
  double largest_g = 0.5;
  for (const auto& [along_mps2, across_mps2] : accelerations(e.poses)) {
    const double along_g = along_mps2 / kGravity_mps2, across_g = across_mps2 / kGravity_mps2;
    if (std::hypot(along_g, across_g) > 20) continue;  // a jump of the truth
    cells.add(across_g, along_g);
    largest_g = std::max({largest_g, std::abs(along_g), std::abs(across_g)});
  }
  const std::string range = "[" + number(-1.05 * largest_g) + ":" + number(1.05 * largest_g) + "]";
  std::string script = cells.block("cells") + countScale("poses") + "set size ratio -1\nset xrange " + range +
                       "\nset yrange " + range +
                       "\nset xlabel 'to the left [g]'\nset ylabel 'ahead [g]'\nset xzeroaxis lt 1 lc rgb "
                       "'#606060'\nset yzeroaxis lt 1 lc rgb '#606060'\nset parametric\nset trange [0:2*pi]\n"
                       "set samples 181\nplot ";
  for (int halves = 1; halves <= static_cast<int>(2.1 * largest_g); ++halves)
    script += number(0.5 * halves) + "*cos(t)," + number(0.5 * halves) +
              "*sin(t) with lines lw 0.7 dt 2 lc rgb '#808080' notitle, ";
  return {"gg", "Accelerations of the truth (gg-diagram)", 620, script + CellCounts::plot("cells") + "\n"};
}

}  // namespace raceloc
