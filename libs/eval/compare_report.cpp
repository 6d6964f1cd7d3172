#include <algorithm>
#include <string>

#include "eval/compare.h"
#include "eval/curves.h"
#include "eval/format.h"

namespace raceloc {

namespace {

constexpr double kSignificant = 0.05;

std::string verdictOf(const Difference& d) {
  if (!d.significance) return "not known";
  if (d.significance->p > kSignificant) return "may be chance";
  return d.a_rmse < d.b_rmse ? "A is better" : "B is better";
}

}  // namespace

Table tableOf(const Comparison& c, const std::string& title) {
  Table table{
      title,
      {"rmse of", "A", "B", "A - B", "95 % interval", "p", "blocks correlate", "verdict"},
      {},
      format("%zu blocks of %.1f s; interval: block bootstrap, p: A and B swapped block by block, %d "
             "draws, seed %llu; p is of each row by itself",
             c.blocks, c.block_s, c.options.resamples, static_cast<unsigned long long>(c.options.seed))};
  for (const Difference& d : c.differences) {
    table.rows.push_back(
        {d.column, format("%.4f", d.a_rmse), format("%.4f", d.b_rmse), format("%+.4f", d.a_rmse - d.b_rmse),
         d.significance ? format("%+.4f .. %+.4f", d.significance->low, d.significance->high) : "-",
         d.significance ? format("%.4f", d.significance->p) : "-", format("%.2f", d.correlation),
         verdictOf(d)});
  }
  return table;
}

Picture comparisonPicture(const ErrorSeries& a, const ErrorSeries& b, const std::string& name) {
  const double first_s = std::min(a.stamp_s.front(), b.stamp_s.front());
  const double last_s = std::max(a.stamp_s.back(), b.stamp_s.back());
  std::string script;
  const auto add = [&](const std::string& block, const ErrorSeries& run) {
    script += "$" + block + " << EOD\n";
    for (const std::size_t i : extremes(run.errors[0]))
      script += number(run.stamp_s[i] - first_s) + " " + number(run.errors[0][i]) + "\n";
    script += "EOD\n";
  };
  add("a", a);
  add("b", b);
  script += "set xrange [0:" + number(std::max(last_s - first_s, 1e-3)) +
            "]\nset yrange [0:*]\nset xlabel 'time [s]'\nset ylabel 'error in the plane [m]'\n"
            "set key outside top left horizontal Left reverse samplen 2\nplot $a using 1:2 with lines lw 1.2 "
            "lc rgb '" +
            std::string(kBlue) + "' title 'A', $b using 1:2 with lines lw 1.2 lc rgb '" + kVermillion +
            "' title 'B'\n";
  return {name, "Error in the plane over time", 300, std::move(script)};
}

}  // namespace raceloc
