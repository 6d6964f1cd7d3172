#include "cli/eval_args.h"

#include <charconv>
#include <sstream>
#include <vector>

#include "cli/app.h"
#include "core/errors.h"

namespace raceloc {

namespace {

constexpr char kManual[] = R"(NAME
  raceloc-eval - errors of an estimated trajectory against the truth

SYNOPSIS
  raceloc-eval --truth FILE --estimate FILE [--report FILE.html] [--picture FILE.svg]
               [--csv FILE] [--json FILE] [--align none|se3] [--max-gap S] [--segments M,M,...]

DESCRIPTION
  Reads two trajectories in TUM format, a line a pose: `stamp_s x y z qx qy qz qw`. Each pose of the estimate is
  compared with the truth interpolated at its stamp; poses outside the truth's span or in its gaps are counted and
  left out. Less than half of the estimate matched is an error.
  Prints rmse, mean, median, std and max of: position in 3-D and in the plane; lateral and longitudinal along the
  truth's heading; height; heading. Then the drift over segments of given lengths, as KITTI defines it.
  Warns when the two look like being in different frames.
  Pictures are drawn by gnuplot (Debian: gnuplot-nox). Files appear under their names only when they are whole.

EXAMPLES
  raceloc-eval --truth build/truth.tum --estimate build/race.tum --report build/report.html
  raceloc-eval --truth truth.tum --estimate odometry.tum --align se3 --segments 100,200,400,800
  raceloc-eval --truth truth.tum --estimate race.tum --json figures.json --csv errors.csv

EXIT STATUS
  0 done; 2 bad input or arguments, one line on stderr says what and where; 1 an error of the program.
)";

double positive(const std::string& text, const std::string& option, const std::string& unit) {
  double value = 0;
  const char* end = text.data() + text.size();
  const auto parsed = std::from_chars(text.data(), end, value);
  // std::from_chars knows "nan" and "inf"
  if (parsed.ec != std::errc() || parsed.ptr != end || !(value > 0 && value < 1e9))
    throw InputError("option " + option + ": \"" + text + "\", but it must be a number of " + unit + " > 0");
  return value;
}

std::vector<double> lengths(const std::string& text) {
  std::vector<double> lengths_m;
  std::istringstream fields(text);
  for (std::string field; std::getline(fields, field, ',');)
    lengths_m.push_back(positive(field, "--segments", "metres"));
  return lengths_m;
}

/** In single quotes where a shell needs them. */
std::string quoted(const std::string& word) {
  if (!word.empty() && word.find_first_of(" \t\n'\"\\$`&|;<>()*?[]#~!{}") == std::string::npos) return word;
  std::string text = "'";
  for (const char c : word) text += c == '\'' ? std::string("'\\''") : std::string(1, c);
  return text + "'";
}

}  // namespace

std::optional<EvalArgs> parseEvalArgs(int argc, char** argv) {
  CommandLine cmd(kManual);
  using Value = TCLAP::ValueArg<std::string>;
  Value truth("t", "truth", "true trajectory, TUM", true, "", "FILE", cmd);
  Value estimate("e", "estimate", "estimated trajectory, TUM", true, "", "FILE", cmd);
  Value report("r", "report", "write a page with figures and pictures, one self-contained HTML file", false,
               "", "FILE.html", cmd);
  Value picture("p", "picture", "write the picture of the trajectories alone, SVG", false, "", "FILE.svg",
                cmd);
  Value csv("", "csv", "write a line a matched pose with its errors", false, "", "FILE", cmd);
  Value json("", "json", "write the figures for other programs", false, "", "FILE", cmd);
  Value align(
      "", "align",
      "none: both are in one map frame (default); se3: move the estimate rigidly to the least squared "
      "distance first, for odometry without georeference",
      false, "none", "none|se3", cmd);
  Value max_gap("", "max-gap",
                "do not interpolate between truth poses further apart than this [s], default 0.5", false,
                "0.5", "S", cmd);
  Value segments("", "segments", "lengths of the drift segments [m], default 20,40,80", false, "20,40,80",
                 "M,M,...", cmd);
  if (!cmd.parse(argc, argv)) return std::nullopt;

  EvalArgs args;
  args.truth_path = truth.getValue();
  args.estimate_path = estimate.getValue();
  args.report_path = report.getValue();
  args.picture_path = picture.getValue();
  args.csv_path = csv.getValue();
  args.json_path = json.getValue();
  args.options.max_gap_s = positive(max_gap.getValue(), "--max-gap", "seconds");
  args.options.segment_lengths_m = lengths(segments.getValue());
  if (align.getValue() == "se3") {
    args.options.align = Alignment::se3;
  } else if (align.getValue() != "none") {
    throw InputError("option --align: \"" + align.getValue() + "\", but it must be none or se3");
  }
  args.command = "raceloc-eval";
  for (int i = 1; i < argc; ++i) args.command += " " + quoted(argv[i]);
  return args;
}

}  // namespace raceloc
