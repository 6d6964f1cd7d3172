#include "eval/time_picture.h"

#include <algorithm>
#include <cmath>

#include "eval/format.h"
#include "eval/gnuplot.h"
#include "eval/picture.h"

namespace raceloc {

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
