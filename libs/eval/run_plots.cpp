#include "eval/run_plots.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "core/statistics.h"
#include "eval/cell_counts.h"
#include "eval/curves.h"
#include "eval/format.h"

namespace raceloc {

namespace {

constexpr std::size_t kMostSources = 12;
constexpr double kLowest_m = 1e-3, kHighest_m = 1e3;  // what is outside is drawn at the edge

/** On logarithmic axes: the errors of a good hour and of a bad second are decades apart. */
Picture stanfordPicture(const std::string& name, const std::string& direction,
                        const std::vector<Protected>& epochs) {
  double highest_m = 1;
  std::vector<double> limits_m;
  CellCounts cells(CellCounts::Axes::logarithmic, 0.05);
  const auto shown = [](double value) { return std::clamp(value, kLowest_m, kHighest_m); };
  for (const auto& [error, protection, alert_limit] : epochs) {
    cells.add(shown(error), shown(protection));
    highest_m = std::max({highest_m, 1.2 * shown(error), 1.2 * shown(protection)});
    if (std::isfinite(alert_limit)) limits_m.push_back(alert_limit);
  }
  const double limit_m = quantile(limits_m, 0.5);
  if (!limits_m.empty()) highest_m = std::max(highest_m, 1.5 * shown(limit_m));

  const std::string low = number(kLowest_m), high = number(highest_m);
  std::string script =
      cells.block("cells") + countScale("estimates") + "set size square\nset logscale xy\nset xrange [" +
      low + ":" + high + "]\nset yrange [" + low + ":" + high +
      "]\nset format xy '%g'\nset xlabel 'size of the " + direction +
      " error [m]'\nset ylabel 'protection level [m]'\nset object 1 polygon from " + low + "," + low +
      " to " + high + "," + high + " to " + high + "," + low + " to " + low + "," + low +
      " behind fc rgb '#FDECE3' fs solid noborder\n"
      "set label 1 'misleading' at graph 0.97,0.05 right tc rgb '#A04000'\n";
  if (!limits_m.empty())
    script += "set arrow 1 from " + low + "," + number(limit_m) + " to " + high + "," + number(limit_m) +
              " nohead dt 2 lc rgb 'black'\nset label 2 'alert limit (median)' at graph 0.02,first " +
              number(limit_m) + " offset 0,0.6\n";
  return {name, "Protection level over error, " + direction + " (Stanford diagram)", 620,
          script + "plot " + CellCounts::plot("cells") + ", x with lines lw 1 lc rgb 'black' notitle\n"};
}

/** Times and lengths of the innovations of one source that were accepted, or rejected. */
std::string innovations(const std::vector<DecisionLine>& lines, const std::string& source, bool accepted,
                        double first_s) {
  std::vector<double> times_s, lengths_m;
  for (const DecisionLine& line : lines) {
    if (line.source != source || line.accepted != accepted) continue;
    times_s.push_back(line.stamp_s - first_s);
    lengths_m.push_back(std::max(std::hypot(line.innovation_along_m, line.innovation_across_m), 1e-3));
  }
  std::string text;
  if (times_s.empty()) return "0 NaN\n";
  for (const std::size_t i : extremes(lengths_m))
    text += number(times_s[i]) + " " + number(lengths_m[i]) + "\n";
  return text;
}

}  // namespace

std::vector<Picture> stanfordPictures(const Stanford& stanford) {
  return {stanfordPicture("stanford_lateral", "lateral", stanford.lateral_m),
          stanfordPicture("stanford_longitudinal", "longitudinal", stanford.longitudinal_m)};
}

std::vector<Picture> decisionPictures(const std::vector<DecisionLine>& lines, double first_s) {
  std::vector<std::string> sources = sourcesOf(lines);
  if (sources.size() > kMostSources) sources.resize(kMostSources);
  const std::string x_range = "set xrange [" + number(lines.front().stamp_s - first_s) + ":" +
                              number(std::max(lines.back().stamp_s, lines.front().stamp_s + 1e-3) - first_s) +
                              "]\n";
  std::vector<Picture> pictures;
  for (std::size_t k = 0; k < sources.size(); ++k) {
    std::string script = "$accepted << EOD\n" + innovations(lines, sources[k], true, first_s) +
                         "EOD\n$rejected << EOD\n" + innovations(lines, sources[k], false, first_s) +
                         "EOD\n" + x_range +
                         "set logscale y\nset yrange [0.001:*]\nset format y '%g'\nset lmargin 10\n"
                         "set xlabel 'time since the first match [s]'\nset ylabel 'innovation [m]'\n"
                         "set key outside top left horizontal Left reverse samplen 1\n"
                         "plot $accepted using 1:2 with points pt 7 ps 0.25 lc rgb '" +
                         kBlue + "' title 'accepted', $rejected using 1:2 with points pt 7 ps 0.35 lc rgb '" +
                         kVermillion + "' title 'rejected'\n";
    pictures.push_back(
        {"gate_" + std::to_string(k + 1), "Gate: innovation of " + sources[k], 250, std::move(script)});
  }
  return pictures;
}

Picture latencyPicture(const std::vector<LatencyLine>& lines) {
  constexpr int kBars = 80;
  const LatencyFigures figures = latencyFigures(lines);
  const double range_ms = std::max(figures.max_ms, 1e-3), bar_ms = range_ms / kBars;
  std::vector<std::size_t> counts(kBars, 0);
  for (const LatencyLine& line : lines)
    ++counts[static_cast<std::size_t>(std::clamp(1e3 * line.scan_to_pose_s / bar_ms, 0.0, kBars - 1.0))];
  std::string script = "$bars << EOD\n";
  for (std::size_t k = 0; k < counts.size(); ++k)
    if (counts[k] > 0)
      script += number((static_cast<double>(k) + 0.5) * bar_ms) + " " + std::to_string(counts[k]) + "\n";
  script += "EOD\nset xrange [0:" + number(1.02 * range_ms) +
            "]\nset logscale y\nset yrange [0.7:*]\nset format y '%.0f'\nset boxwidth " + number(bar_ms) +
            "\nset style fill solid noborder\nset xlabel 'from the last point of a sweep to its pose [ms]'\n"
            "set ylabel 'sweeps'\nunset key\n";
  const auto mark = [&](const std::string& id, const std::string& name, double at_ms) {
    script += "set arrow " + id + " from " + number(at_ms) + ",graph 0 to " + number(at_ms) +
              ",graph 1 nohead dt 2 lc rgb 'black' front\nset label " + id + " '" + name + "' at " +
              number(at_ms) + ",graph 0.94 offset 0.4,0 front\n";
  };
  mark("1", "p50", figures.p50_ms);
  mark("2", "p99", figures.p99_ms);
  return {"latency", "Latency of the scan match", 300,
          script + "plot $bars using 1:2 with boxes lc rgb '" + kBlue + "'\n"};
}

}  // namespace raceloc
