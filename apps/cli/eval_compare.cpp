#include "cli/eval_compare.h"

#include <algorithm>
#include <filesystem>
#include <iostream>
#include <nlohmann/json.hpp>
#include <utility>

#include "cli/app.h"
#include "cli/command_text.h"
#include "cli/text_options.h"
#include "core/output_file.h"
#include "eval/html.h"

namespace raceloc {

namespace {

namespace fs = std::filesystem;

constexpr char kCompareManual[] = R"(NAME
  raceloc-eval compare - two runs on one truth, and whether their difference is more than chance

SYNOPSIS
  raceloc-eval compare A.csv B.csv [--report FILE.html] [--json FILE] [--block S] [--resamples N] [--seed N]
  raceloc-eval compare A/ B/ ...

DESCRIPTION
  A and B are files that raceloc-eval --csv wrote, or two folders of them: files of one name are compared.
  Errors of neighbouring poses are much the same, so the time that both runs have is cut into blocks, which are longer than
  errors last (--block, 10 s), and the blocks are the samples. For each direction of the error: rmse of A and B, each
  block weighing the same; their difference; its 95 % interval, by a block bootstrap; and p, the probability that chance alone
  makes a difference as large, by swapping A and B in blocks at random. Fewer than 8 blocks give no p; when
  neighbouring blocks still correlate, a warning says so. Same input and --seed, same figures.

EXAMPLES
  raceloc-eval --truth truth.tum --estimate a.tum --csv a.csv
  raceloc-eval --truth truth.tum --estimate b.tum --csv b.csv
  raceloc-eval compare a.csv b.csv --report build/a_or_b.html

EXIT STATUS
  0 done, whichever is better; 2 bad input or arguments, one line on stderr says what and where; 1 an error of the program.
)";

/** Files to compare, and what they are called. */
struct Pair {
  std::string name, a_path, b_path;
};

/** Names of the errors files in a folder, in alphabetical order. */
std::vector<std::string> errorsFilesIn(const std::string& folder) {
  std::vector<std::string> names;
  std::error_code failed;
  for (const auto& entry : fs::directory_iterator(folder, failed))
    if (entry.is_regular_file() && isErrorsFile(entry.path().string()))
      names.push_back(entry.path().filename().string());
  if (failed) throw InputError("folder " + folder + ": cannot be read (" + failed.message() + ")");
  std::sort(names.begin(), names.end());
  return names;
}

std::vector<Pair> pairsOf(const CompareArgs& args) {
  const bool a_is_folder = fs::is_directory(args.a_path), b_is_folder = fs::is_directory(args.b_path);
  if (!a_is_folder && !b_is_folder) return {{"A and B", args.a_path, args.b_path}};
  if (!a_is_folder || !b_is_folder)
    throw InputError("compare " + args.a_path + " " + args.b_path + ": one is a folder, the other is not");
  const auto in_a = errorsFilesIn(args.a_path), in_b = errorsFilesIn(args.b_path);
  std::vector<std::string> names;
  std::set_intersection(in_a.begin(), in_a.end(), in_b.begin(), in_b.end(), std::back_inserter(names));
  if (names.empty())
    throw InputError("folders " + args.a_path + " and " + args.b_path +
                     ": no file of raceloc-eval --csv of one name in both (A: " + listed(in_a) +
                     "; B: " + listed(in_b) + ")");
  std::vector<Pair> pairs;
  pairs.reserve(names.size());
  for (const std::string& name : names)
    pairs.push_back({name, (fs::path(args.a_path) / name).string(), (fs::path(args.b_path) / name).string()});
  return pairs;
}

nlohmann::ordered_json jsonOf(const std::string& name, const Comparison& c) {
  nlohmann::ordered_json json{{"name", name},          {"a", c.a_path},
                              {"b", c.b_path},         {"first_s", c.first_s},
                              {"last_s", c.last_s},    {"blocks", c.blocks},
                              {"block_s", c.block_s},  {"resamples", c.options.resamples},
                              {"seed", c.options.seed}};
  for (const Difference& d : c.differences) {
    auto& row = json["rmse"][d.column];
    row = {
        {"a", d.a_rmse}, {"b", d.b_rmse}, {"a_less_b", d.a_rmse - d.b_rmse}, {"correlation", d.correlation}};
    if (d.significance)
      row.update({{"low", d.significance->low}, {"high", d.significance->high}, {"p", d.significance->p}});
  }
  json["warnings"] = c.warnings;
  return json;
}

}  // namespace

std::optional<CompareArgs> parseCompareArgs(const std::vector<std::string>& words) {
  std::vector<std::string> rest{words.front()};
  rest.insert(rest.end(), words.begin() + 2, words.end());
  CommandLine cmd(kCompareManual);
  TCLAP::UnlabeledValueArg<std::string> a("A", "errors of the one run", true, "", "A.csv|A/", cmd);
  TCLAP::UnlabeledValueArg<std::string> b("B", "errors of the other", true, "", "B.csv|B/", cmd);
  Text report("r", "report", "write a page with tables and pictures, one self-contained HTML file", false, "",
              "FILE.html", cmd);
  Text json("", "json", "write the figures for other programs", false, "", "FILE", cmd);
  Text block("", "block", "length of a block [s], default 10", false, "10", "S", cmd);
  Text resamples("", "resamples", "draws of the bootstrap and of the swaps, default 10000", false, "10000",
                 "N", cmd);
  Text seed("", "seed", "of the draws, default 1", false, "1", "N", cmd);
  if (!cmd.parse(rest)) return std::nullopt;

  CompareArgs args;
  args.a_path = a.getValue();
  args.b_path = b.getValue();
  args.report_path = report.getValue();
  args.json_path = json.getValue();
  args.options.block_s = numberOf(block, between(0.01, 1e6));
  args.options.resamples = wholeNumberOf(resamples, between(100, 1e6));
  args.options.seed = static_cast<std::uint64_t>(wholeNumberOf(seed, between(0, 2e9)));
  requireApart({args.a_path, args.b_path}, {args.report_path, args.json_path});
  rest.front() = "raceloc-eval compare";
  args.command = rest.front() + " " + commandText({rest.begin() + 1, rest.end()});
  return args;
}

int runCompare(const CompareArgs& args) {
  std::string text, page;
  std::vector<Picture> pictures;
  nlohmann::ordered_json json = nlohmann::ordered_json::array();
  for (const auto& [name, a_path, b_path] : pairsOf(args)) {
    const ErrorSeries a = readErrors(a_path), b = readErrors(b_path);
    const Comparison comparison = compare(a, b, args.options);
    const Table table = tableOf(comparison, name);
    text += (text.empty() ? "A  " : "\nA  ") + a_path + "\nB  " + b_path + "\n" + textTable(table);
    page += htmlTable(table);
    for (const std::string& warning : comparison.warnings) {
      text += "warning: " + warning + "\n";
      page += "<p class=\"warning\">" + escaped(warning) + "</p>\n";
    }
    json.push_back(jsonOf(name, comparison));
    if (args.report_path.empty()) continue;
    pictures.push_back(comparisonPicture(a, b, "run_" + std::to_string(pictures.size() + 1)));
    pictures.back().title += ", " + name;
  }
  std::cout << text << std::flush;
  if (!args.json_path.empty())
    writeTextFile(args.json_path,
                  json.dump(2, ' ', false, nlohmann::ordered_json::error_handler_t::replace) + "\n");
  if (!args.report_path.empty())
    writeTextFile(args.report_path,
                  htmlPage("Two runs", "<table class=\"words\">\n" + htmlRow("td", {"A", args.a_path}) +
                                           htmlRow("td", {"B", args.b_path}) + "</table>\n" + page +
                                           htmlPictures(pictures) + "<h2>Made by</h2>\n<p><code>" +
                                           escaped(args.command) + "</code></p>\n"));
  return 0;
}

}  // namespace raceloc
