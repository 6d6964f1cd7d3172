#include "eval/plots.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "eval/gnuplot.h"
#include "eval/plot_script.h"

namespace raceloc {

namespace {

constexpr std::size_t kBins = 1000;  // of a curve; up to two points each

/** Which samples a curve of at most 2 * kBins points needs: the lowest and the highest of each bin, and both
 * ends. */
std::vector<std::size_t> extremes(const std::vector<double>& y) {
  std::vector<std::size_t> kept;
  const std::size_t bins = std::min(kBins, y.size());
  for (std::size_t b = 0; b < bins; ++b) {
    const auto first = y.begin() + static_cast<std::ptrdiff_t>(b * y.size() / bins);
    const auto last = y.begin() + static_cast<std::ptrdiff_t>((b + 1) * y.size() / bins);
    const auto [low, high] = std::minmax_element(first, last);
    kept.push_back(static_cast<std::size_t>(low - y.begin()));
    kept.push_back(static_cast<std::size_t>(high - y.begin()));
  }
  kept.push_back(0);
  kept.push_back(y.size() - 1);
  std::sort(kept.begin(), kept.end());
  kept.erase(std::unique(kept.begin(), kept.end()), kept.end());
  return kept;
}

/** Every n-th index, so that at most 2 * kBins remain, and the last. */
std::vector<std::size_t> thinned(std::size_t size) {
  std::vector<std::size_t> kept;
  const std::size_t step = size / (2 * kBins) + 1;
  for (std::size_t i = 0; i < size; i += step) kept.push_back(i);
  if (kept.back() != size - 1) kept.push_back(size - 1);
  return kept;
}

/** Numbers the stretches that a line may connect: a new one starts at each index that `breaks`. */
template <class Breaks>
std::vector<int> stretches(std::size_t size, Breaks breaks) {
  std::vector<int> stretch(size, 0);
  for (std::size_t i = 1; i < size; ++i) stretch[i] = stretch[i - 1] + (breaks(i) ? 1 : 0);
  return stretch;
}

/** The estimate breaks where poses are unmatched, or missing for three times their usual interval. */
std::vector<int> stretchesOf(const std::vector<PoseError>& poses) {
  const auto interval_s = [&](std::size_t i) { return poses[i].stamp_s - poses[i - 1].stamp_s; };
  std::vector<double> intervals_s;
  for (std::size_t i = 1; i < poses.size(); ++i) intervals_s.push_back(interval_s(i));
  const double usual_s = intervals_s.empty() ? 0 : statisticsOf(intervals_s).median;
  return stretches(poses.size(), [&](std::size_t i) {
    return poses[i].estimate_index != poses[i - 1].estimate_index + 1 || interval_s(i) > 3 * usual_s;
  });
}

std::string curveOverTime(const std::vector<PoseError>& poses, double PoseError::*error) {
  std::vector<double> y;
  y.reserve(poses.size());
  for (const auto& pose : poses) y.push_back(pose.*error);
  const std::vector<int> stretch = stretchesOf(poses);
  std::string text;
  std::size_t before = 0;
  for (const std::size_t i : extremes(y)) {
    if (stretch[i] != stretch[before]) text += "\n";
    text += number(poses[i].stamp_s - poses.front().stamp_s) + " " + number(y[i]) + "\n";
    before = i;
  }
  return text;
}

}  // namespace

std::string trajectoryPicture(const Evaluation& evaluation) {
  const auto& truth = evaluation.truth.trajectory.poses;
  const auto& poses = evaluation.poses;
  Eigen::AlignedBox2d box;
  std::string script = "$truth << EOD\n";
  const std::vector<int> truth_stretch = stretches(truth.size(), [&](std::size_t i) {
    return truth[i].stamp_s - truth[i - 1].stamp_s > evaluation.options.max_gap_s;
  });
  std::size_t before = 0;
  for (const std::size_t i : thinned(truth.size())) {
    if (truth_stretch[i] != truth_stretch[before]) script += "\n";
    before = i;
    const Eigen::Vector3d p_m = truth[i].T_map_body.translation();
    box.extend(p_m.head<2>());
    script += number(p_m.x()) + " " + number(p_m.y()) + "\n";
  }
  script += "EOD\n$estimate << EOD\n";
  const std::vector<int> stretch = stretchesOf(poses);
  before = 0;
  double largest_m = 0;
  for (const std::size_t i : thinned(poses.size())) {
    const Eigen::Vector3d p_m = poses[i].T_map_estimate.translation();
    box.extend(p_m.head<2>());
    largest_m = std::max(largest_m, poses[i].position_plane_m);
    if (stretch[i] != stretch[before]) script += "\n";
    script += number(p_m.x()) + " " + number(p_m.y()) + " " + number(poses[i].position_plane_m) + "\n";
    before = i;
  }
  const Eigen::Vector3d start_m = truth.front().T_map_body.translation();
  script += "EOD\n$start << EOD\n" + number(start_m.x()) + " " + number(start_m.y()) + "\nEOD\n";

  // Equal axes: the height follows the shape of the track, within what a page can show.
  const Eigen::Vector2d size_m = box.sizes().cwiseMax(1.0);
  const int height_px =
      std::clamp(static_cast<int>(kPicture_px * 0.8 * size_m.y() / size_m.x()) + 120, 320, 900);
  const Eigen::Vector2d margin_m = Eigen::Vector2d::Constant(0.05 * size_m.maxCoeff());
  const Eigen::Vector2d low_m = box.min() - margin_m;
  const Eigen::Vector2d high_m = box.max() + margin_m;
  script += svgTerminal("trajectory", height_px);
  script += "set size ratio -1\nset xrange [" + number(low_m.x()) + ":" + number(high_m.x()) +
            "]\nset yrange [" + number(low_m.y()) + ":" + number(high_m.y()) + "]\n";
  script += std::string("set palette defined (0 '") + kBlue + "', 0.5 '#B07AA1', 1 '" + kVermillion + "')\n" +
            "set cbrange [0:" + number(std::max(largest_m, 1e-3)) + "]\n";
  script +=
      "set xlabel 'x [m]'\nset ylabel 'y [m]'\nset cblabel 'error in the plane [m]'\n"
      "set key outside top left horizontal Left reverse samplen 2\n";
  script += std::string("plot $truth using 1:2 with lines lw 6 lc rgb '") + kGrey +
            "' title 'truth', $estimate using 1:2:3 with lines lw 2 lc palette title 'estimate', "
            "$start using 1:2 with points pt 6 ps 1.2 lw 1.5 lc rgb 'black' title 'start'\n";
  return gnuplot(script);
}

std::string errorPicture(const Evaluation& evaluation) {
  struct Panel {
    const char* label;
    double PoseError::*error;
    const char* colour;
  };
  const Panel panels[] = {{"lateral [m]", &PoseError::lateral_m, kBlue},
                          {"longitudinal [m]", &PoseError::longitudinal_m, kVermillion},
                          {"height [m]", &PoseError::height_m, kGreen},
                          {"heading [deg]", &PoseError::heading_deg, "black"}};
  std::string script =
      svgTerminal("errors", 760) + "set xrange [0:" + number(std::max(evaluation.coveredTruth_s(), 1e-3)) +
      "]\nset multiplot layout 4,1 margins 0.10,0.98,0.07,0.98 spacing 0.03\n"
      "set xzeroaxis lt 1 lc rgb '#606060' lw 0.8\nunset key\nset format x ''\nset yrange [*<-0.01:0.01<*]\n";
  for (const Panel& panel : panels) {
    if (&panel == std::end(panels) - 1)
      script += "set format x '%.10g'\nset xlabel 'time since the first match [s]'\n";
    script += std::string("set label 1 '") + panel.label +
              "' at graph -0.085,0.5 center rotate\n$curve << EOD\n" +
              curveOverTime(evaluation.poses, panel.error) +
              "EOD\nplot $curve using 1:2 with lines lw 1.2 lc rgb '" + panel.colour + "'\n";
  }
  return gnuplot(script + "unset multiplot\n");
}

std::string distributionPicture(const Evaluation& evaluation) {
  struct Curve {
    const char* name;
    double PoseError::*error;
    int dash;
    const char* colour;
  };
  const Curve curves[] = {{"in the plane", &PoseError::position_plane_m, 1, "black"},
                          {"lateral", &PoseError::lateral_m, 1, kBlue},
                          {"longitudinal", &PoseError::longitudinal_m, 2, kVermillion},
                          {"height", &PoseError::height_m, 4, kGreen}};
  std::string script;
  std::string plots;
  for (const Curve& curve : curves) {
    std::vector<double> errors_m;
    for (const auto& pose : evaluation.poses) errors_m.push_back(std::abs(pose.*curve.error));
    std::sort(errors_m.begin(), errors_m.end());
    const std::string block = "$curve" + std::to_string(&curve - curves);
    script += block + " << EOD\n" + number(errors_m.front()) + " 0\n";
    for (const std::size_t i : thinned(errors_m.size()))
      script += number(errors_m[i]) + " " +
                number(100 * static_cast<double>(i + 1) / static_cast<double>(errors_m.size())) + "\n";
    script += "EOD\n";
    plots += (plots.empty() ? "plot " : ", ") + block + " using 1:2 with steps lw 1.5 dt " +
             std::to_string(curve.dash) + " lc rgb '" + curve.colour + "' title '" + curve.name + "'";
  }
  script += svgTerminal("distribution", 400);
  script +=
      "set xrange [0:*]\nset yrange [0:100]\nset ytics (0, 25, 50, 75, 95, 100)\n"
      "set xlabel 'size of the error [m]'\nset ylabel 'poses below [%]'\nset key bottom right Left reverse "
      "samplen 3\n";
  return gnuplot(script + plots + "\n");
}

namespace {

/** The number of a name by its first appearance. */
std::size_t numberOf(const std::string& name, std::vector<std::string>& names) {
  const auto known = std::find(names.begin(), names.end(), name);
  if (known != names.end()) return static_cast<std::size_t>(known - names.begin());
  names.push_back(name);
  return names.size() - 1;
}

std::string spansOf(const std::vector<TimeSpan>& spans) {
  constexpr const char* kShades[] = {"#EDEDED", "#D6EAF8", "#FCE5CD", "#E8DAEF"};
  std::vector<std::string> names;
  std::string script;
  for (std::size_t i = 0; i < spans.size(); ++i) {
    const auto& [from_s, to_s, name] = spans[i];
    const std::size_t known = names.size(), shade = numberOf(name, names);
    script += "set object " + std::to_string(i + 1) + " rect from " + number(from_s) + ",graph 0 to " +
              number(to_s) + ",graph 1 behind fc rgb '" + kShades[shade % std::size(kShades)] +
              "' fs solid noborder\n";
    if (shade == known)  // named where it is first
      script += "set label " + std::to_string(10 + shade) + " '" + name + "' at " + number(from_s) +
                ",graph " + number(0.93 - 0.1 * static_cast<double>(shade)) +
                " offset 0.5,0 tc rgb '#606060'\n";
  }
  return script;
}

std::string levelsOf(const TimePanel& panel) {
  std::string script = "unset arrow\nunset label 20\nunset label 21\nunset label 22\n";
  for (std::size_t i = 0; i < panel.levels.size(); ++i) {
    const auto& [value, name] = panel.levels[i];
    script += "set arrow " + std::to_string(i + 1) + " from graph 0,first " + number(value) +
              " to graph 1,first " + number(value) + " nohead dt 2 lc rgb 'black'\nset label " +
              std::to_string(20 + i) + " '" + name + "' at graph 0.01,first " + number(value) +
              " offset 0,0.6\n";
  }
  return script;
}

}  // namespace

std::string timePicture(const std::vector<TimePanel>& panels, const std::vector<TimeSpan>& spans) {
  constexpr const char* kColours[] = {kBlue, kVermillion, kGreen, "black"};
  constexpr int kPanel_px = 230, kFrame_px = 110;
  double from_s = HUGE_VAL, to_s = -HUGE_VAL;
  for (const TimePanel& panel : panels)
    for (const TimeCurve& curve : panel.curves) {
      const auto [first, last] = std::minmax_element(curve.time_s.begin(), curve.time_s.end());
      from_s = std::min(from_s, *first);
      to_s = std::max(to_s, *last);
    }
  const int height_px = kPanel_px * static_cast<int>(panels.size()) + kFrame_px;
  std::string script = svgTerminal("time", height_px) + "set xrange [" + number(from_s) + ":" + number(to_s) +
                       "]\nset multiplot layout " + std::to_string(panels.size()) + ",1 margins 0.09,0.98," +
                       number(60.0 / height_px) + "," + number(1 - 50.0 / height_px) +
                       " spacing 0.04\nset xzeroaxis lt 1 lc rgb '#606060' lw 0.8\nset format x ''\n"
                       "set key at graph 1,1.18 right horizontal Right samplen 2\n" +
                       spansOf(spans);
  std::vector<std::string> names;
  for (const TimePanel& panel : panels) {
    if (&panel == &panels.back()) script += "set format x '%.10g'\nset xlabel 'time [s]'\n";
    script += "set label 1 '" + panel.label + "' at graph -0.07,0.5 center rotate\n" + levelsOf(panel);
    std::string plots;
    for (const TimeCurve& curve : panel.curves) {
      const std::string block = "$curve" + std::to_string(&curve - panel.curves.data());
      script += block + " << EOD\n";
      for (std::size_t i = 0; i < curve.values.size(); ++i) {
        if (std::isfinite(curve.values[i])) script += number(curve.time_s[i]) + " " + number(curve.values[i]);
        script += "\n";
      }
      script += "EOD\n";
      plots += (plots.empty() ? "plot " : ", ") + block + " using 1:2 with lines lw 1.6 lc rgb '" +
               kColours[numberOf(curve.name, names) % std::size(kColours)] + "' " +
               (&panel == &panels.front() ? "title '" + curve.name + "'" : "notitle");
    }
    script += plots + "\nunset for [i=10:19] label i\n";
  }
  return gnuplot(script + "unset multiplot\n");
}

}  // namespace raceloc
