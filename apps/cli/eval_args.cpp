#include "cli/eval_args.h"

#include <filesystem>
#include <iostream>
#include <sstream>
#include <system_error>
#include <vector>

#include "cli/app.h"
#include "cli/command_text.h"
#include "cli/text_options.h"
#include "core/errors.h"
#include "core/output_file.h"
#include "eval/picture.h"
#include "eval/report.h"
#include "sensors/text_input.h"

namespace raceloc {

namespace {

constexpr char kEvalManual[] = R"(NAME
  raceloc-eval - errors of an estimated trajectory against the truth

SYNOPSIS
  raceloc-eval --truth FILE --estimate FILE [--integrity FILE] [--decisions FILE] [--latency FILE]
               [--report FILE.html] [--picture FILE.svg|FILE.png] [--pictures FOLDER] [--csv FILE] [--json FILE]
               [--align none|se3|axes] [--max-gap S] [--rpe STEP,...] [--segments M,...] [--sectors N] [--speed-bin V]
  raceloc-eval compare A B [--report FILE.html] [--json FILE] ...   two runs on one truth; see compare --help
  raceloc-eval cpu [--json FILE] ... -- COMMAND ...                 what a command costs; see cpu --help

DESCRIPTION
  Reads two trajectories in TUM format, a line a pose: `stamp_s x y z qx qy qz qw`. Each pose of the estimate is
  compared with the truth interpolated at its stamp; poses outside the truth's span or in its gaps are counted and
  left out. Less than half of the estimate matched is an error; so are two files that are hardly in one frame (a constant
  offset of kilometres, a constant quarter turn), unless the estimate is moved with --align se3 or axes.
  Prints rmse, mean, median, std and max of: position in 3-D and in the plane; lateral and longitudinal along the
  truth's heading; height; heading. Then the relative pose error over steps of time or way, the drift over segments of given
  lengths, as KITTI defines it, and the errors by lap, by sector of the lap and by speed. A lap ends where the truth
  comes by its first pose again; without a full lap, sectors are equal parts of the way.
  --integrity, --decisions and --latency take what raceloc-live wrote under the same options, and add: how often the error was
  above the protection level (Stanford diagram), the innovations of each source at the gate, the latency of the scan match
  (raceloc-live prints its median, p99 and maximum too).
  Pictures are drawn by gnuplot (Debian: gnuplot-nox). Files appear under their names only when they are whole.

EXAMPLES
  raceloc-eval --truth build/truth.tum --estimate build/race.tum --report build/report.html
  raceloc-eval --truth truth.tum --estimate odometry.tum --align se3 --segments 100,200,400,800 --rpe 1s,100m
  raceloc-eval --truth kitti_truth.tum --estimate odometry.tum --align axes
  raceloc-eval --truth truth.tum --estimate race.tum --json figures.json --csv errors.csv
  raceloc-eval --truth truth.tum --estimate race.tum --integrity integrity.csv --decisions decisions.csv --pictures paper/

EXIT STATUS
  0 done; 2 bad input or arguments, one line on stderr says what and where; 1 an error of the program.
)";

std::vector<std::string> fieldsOf(const std::string& text) {
  std::vector<std::string> fields;
  std::istringstream list(text);
  for (std::string field; std::getline(list, field, ',');) fields.push_back(field);
  return fields;
}

double positive(const std::string& text, const std::string& option, const std::string& unit) {
  const auto number = parseNumber(text);
  if (!number || !(*number > 0 && *number < 1e9))
    throw InputError("option " + option + ": \"" + text + "\", but it must be a number of " + unit + " > 0");
  return *number;
}

/** "1s" and "10m". */
RpeStep stepOf(const std::string& text) {
  if (text.empty() || (text.back() != 's' && text.back() != 'm'))
    throw InputError("option --rpe: \"" + text + "\", but it must be a time or a way like 1s or 10m");
  const auto unit = text.back() == 's' ? RpeStep::Unit::seconds : RpeStep::Unit::metres;
  return {unit, positive(text.substr(0, text.size() - 1), "--rpe", "seconds or metres")};
}

std::optional<TrajectoryArgs> parseTrajectoryArgs(int argc, char** argv) {
  CommandLine cmd(kEvalManual);
  Text truth("t", "truth", "true trajectory, TUM", true, "", "FILE", cmd);
  Text estimate("e", "estimate", "estimated trajectory, TUM", true, "", "FILE", cmd);
  Text integrity("", "integrity", "states and protection levels of the estimate, of raceloc-live --integrity",
                 false, "", "FILE.csv", cmd);
  Text decisions("", "decisions", "what the gate held against each source, of raceloc-live --decisions",
                 false, "", "FILE.csv", cmd);
  Text latency("", "latency", "times from sweep to pose, of raceloc-live --latency", false, "", "FILE.csv",
               cmd);
  Text report("r", "report", "write a page with figures and pictures, one self-contained HTML file", false,
              "", "FILE.html", cmd);
  Text picture("p", "picture", "write the picture of the trajectories alone, SVG or PNG by the name", false,
               "", "FILE.svg|FILE.png", cmd);
  Text pictures("", "pictures", "write every picture of the report into this folder, as SVG and as PNG",
                false, "", "FOLDER", cmd);
  Text csv("", "csv", "write a line a matched pose with its errors", false, "", "FILE", cmd);
  Text json("", "json", "write the figures for other programs", false, "", "FILE", cmd);
  Text align(
      "", "align",
      "none: both are in one map frame (default); se3: move the estimate rigidly to the least squared "
      "distance first, for odometry without georeference; axes: then turn its body axes by one rotation "
      "too, for a truth whose axes are calibrated otherwise, as in foreign recordings",
      false, "none", "none|se3|axes", cmd);
  Text max_gap("", "max-gap",
               "do not interpolate between truth poses further apart than this [s], default 0.5", false,
               "0.5", "S", cmd);
  Text rpe("", "rpe", "steps of the relative pose error, in time or way, default 1s,10m", false, "1s,10m",
           "STEP,STEP,...", cmd);
  Text segments("", "segments", "lengths of the drift segments [m], default 20,40,80", false, "20,40,80",
                "M,M,...", cmd);
  Text sectors("", "sectors", "sectors of a lap, default 12", false, "12", "N", cmd);
  Text speed_bin("", "speed-bin", "width of the bins of speed [m/s], default 10", false, "10", "V", cmd);
  if (!cmd.parse(argc, argv)) return std::nullopt;

  TrajectoryArgs args;
  args.truth_path = truth.getValue();
  args.estimate_path = estimate.getValue();
  args.integrity_path = integrity.getValue();
  args.decisions_path = decisions.getValue();
  args.latency_path = latency.getValue();
  args.report_path = report.getValue();
  args.picture_path = picture.getValue();
  args.pictures_folder = pictures.getValue();
  args.csv_path = csv.getValue();
  args.json_path = json.getValue();
  if (!args.picture_path.empty()) (void)formatOf(args.picture_path);
  requireApart(
      {args.truth_path, args.estimate_path, args.integrity_path, args.decisions_path, args.latency_path},
      {args.report_path, args.picture_path, args.csv_path, args.json_path});
  std::vector<std::pair<std::string, Alignment>> alignments;
  for (const Alignment choice : {Alignment::none, Alignment::se3, Alignment::axes})
    alignments.emplace_back(nameOf(choice), choice);
  args.options.align = choiceOf<Alignment>(align, alignments);
  args.options.max_gap_s = positive(max_gap.getValue(), "--max-gap", "seconds");
  args.options.rpe_steps.clear();
  for (const std::string& field : fieldsOf(rpe.getValue())) args.options.rpe_steps.push_back(stepOf(field));
  args.options.segment_lengths_m.clear();
  for (const std::string& field : fieldsOf(segments.getValue()))
    args.options.segment_lengths_m.push_back(positive(field, "--segments", "metres"));
  args.options.sectors = wholeNumberOf(sectors, between(1, 1000));
  args.options.speed_bin_mps = numberOf(speed_bin, between(0.1, 1000));
  std::vector<std::string> words(argv, argv + argc);
  words.front() = "raceloc-eval";
  args.command = commandText(words);
  return args;
}

RunTables tablesOf(const TrajectoryArgs& args, const Evaluation& evaluation) {
  RunTables run;
  if (!args.integrity_path.empty())
    run.stanford = stanford(evaluation.poses, readIntegrity(args.integrity_path), args.integrity_path);
  if (!args.decisions_path.empty()) run.decisions = readDecisions(args.decisions_path);
  if (!args.latency_path.empty()) run.latency = readLatency(args.latency_path);
  return run;
}

void writePictures(const std::vector<Picture>& pictures, const std::string& folder) {
  std::error_code failed;
  std::filesystem::create_directories(folder, failed);
  if (failed) throw cannotWrite(folder, failed.message());
  for (const Picture& picture : pictures) {
    const std::string path = (std::filesystem::path(folder) / picture.name).string();
    writeTextFile(path + ".svg", drawn(picture, PictureFormat::svg));
    writeTextFile(path + ".png", drawn(picture, PictureFormat::png));
  }
}

int run(const TrajectoryArgs& args) {
  const auto evaluation =
      evaluate(readTrajectoryFile(args.truth_path), readTrajectoryFile(args.estimate_path), args.options);
  const RunTables run = tablesOf(args, evaluation);
  std::cout << textReport(evaluation, run) << std::flush;
  if (!args.csv_path.empty()) writeTextFile(args.csv_path, errorsCsv(evaluation));
  if (!args.json_path.empty()) writeTextFile(args.json_path, figuresJson(evaluation, run));
  if (!args.picture_path.empty())
    writeTextFile(args.picture_path, drawn(picturesOf(evaluation, {}).front(), formatOf(args.picture_path)));
  if (!args.pictures_folder.empty()) writePictures(picturesOf(evaluation, run), args.pictures_folder);
  if (!args.report_path.empty()) writeTextFile(args.report_path, htmlReport(evaluation, run, args.command));
  return 0;
}

}  // namespace

std::optional<EvalArgs> parseEvalArgs(int argc, char** argv) {
  const std::string command = argc > 1 ? argv[1] : "";
  if (command == "compare") return parseCompareArgs({argv, argv + argc});
  if (command == "cpu") return parseCpuArgs({argv, argv + argc});
  return parseTrajectoryArgs(argc, argv);
}

int runEval(const EvalArgs& args) {
  if (const auto* trajectories = std::get_if<TrajectoryArgs>(&args)) return run(*trajectories);
  if (const auto* two_runs = std::get_if<CompareArgs>(&args)) return runCompare(*two_runs);
  return runCpu(std::get<CpuArgs>(args));
}

}  // namespace raceloc
