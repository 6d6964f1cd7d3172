#include "eval/run_tables.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <set>
#include <utility>

#include "core/errors.h"
#include "core/statistics.h"
#include "eval/csv_columns.h"

namespace raceloc {

namespace {

constexpr double kSameStamp_s = 5e-4;

template <class Line>
void requireInOrder(const std::vector<Line>& lines, const std::string& where) {
  for (std::size_t i = 1; i < lines.size(); ++i)
    if (lines[i].stamp_s < lines[i - 1].stamp_s)
      throw InputError(where + ", line " + std::to_string(i + 2) + ": its stamp is before the one above it");
}

}  // namespace

std::vector<IntegrityLine> readIntegrity(const std::string& path) {
  CsvColumns table = readCsv("integrity", path,
                             {"stamp_s", "state", "protection_lateral_m", "protection_longitudinal_m",
                              "protection_heading_rad", "alert_limit_m"});
  auto& of = table.numbers;
  std::vector<IntegrityLine> lines(table.lines);
  for (std::size_t i = 0; i < lines.size(); ++i) {
    const double state = of["state"][i];
    if (!(state >= 0 && state <= 3 && state == std::floor(state)))
      throw InputError("integrity " + path + ", line " + std::to_string(i + 2) +
                       ": state must be 0, 1, 2 or 3");
    lines[i] = {of["stamp_s"][i],
                static_cast<int>(state),
                of["protection_lateral_m"][i],
                of["protection_longitudinal_m"][i],
                of["protection_heading_rad"][i] / kDegree,
                of["alert_limit_m"][i]};
  }
  requireInOrder(lines, "integrity " + path);
  return lines;
}

std::vector<DecisionLine> readDecisions(const std::string& path) {
  CsvColumns table =
      readCsv("decisions", path, {"stamp_s", "innovation_along_m", "innovation_across_m", "nis", "accepted"},
              {"source"});
  auto& of = table.numbers;
  std::vector<DecisionLine> lines(table.lines);
  for (std::size_t i = 0; i < lines.size(); ++i)
    lines[i] = {of["stamp_s"][i], of["innovation_along_m"][i], of["innovation_across_m"][i],
                of["nis"][i],     of["accepted"][i] != 0,      std::move(table.words["source"][i])};
  requireInOrder(lines, "decisions " + path);
  return lines;
}

std::vector<LatencyLine> readLatency(const std::string& path) {
  CsvColumns table = readCsv("latency", path, {"stamp_s", "scan_to_pose_s"});
  std::vector<LatencyLine> lines(table.lines);
  for (std::size_t i = 0; i < lines.size(); ++i)
    lines[i] = {table.numbers["stamp_s"][i], table.numbers["scan_to_pose_s"][i]};
  requireInOrder(lines, "latency " + path);
  return lines;
}

StanfordCounts stanfordCounts(const std::vector<Protected>& epochs) {
  StanfordCounts counts;
  for (const auto& [error, protection, alert_limit] : epochs) {
    ++counts.epochs;
    if (error > protection) {
      ++counts.misleading;
      if (error > alert_limit && protection <= alert_limit) ++counts.hazardous;
    } else if (protection > alert_limit) {
      ++counts.unavailable;
    } else {
      ++counts.available;
    }
  }
  return counts;
}

Stanford stanford(const std::vector<PoseError>& poses, const std::vector<IntegrityLine>& lines,
                  const std::string& path) {
  constexpr double kNoLimit = std::numeric_limits<double>::infinity();
  Stanford result{};
  for (const IntegrityLine& said : lines) ++result.states[static_cast<std::size_t>(said.state)];
  auto line = lines.begin();
  for (const PoseError& pose : poses) {
    while (line != lines.end() && line->stamp_s < pose.stamp_s - kSameStamp_s) ++line;
    if (line == lines.end()) break;
    if (line->stamp_s > pose.stamp_s + kSameStamp_s) continue;
    result.lateral_m.push_back({std::abs(pose.lateral_m), line->protection_lateral_m, line->alert_limit_m});
    result.longitudinal_m.push_back(
        {std::abs(pose.longitudinal_m), line->protection_longitudinal_m, kNoLimit});
    result.heading_deg.push_back({std::abs(pose.heading_deg), line->protection_heading_deg, kNoLimit});
  }
  if (result.lateral_m.empty())
    throw InputError("integrity " + path +
                     ": no line has the stamp of a matched pose; is it of the run that is evaluated?");
  return result;
}

std::vector<std::string> sourcesOf(const std::vector<DecisionLine>& lines) {
  std::set<std::string> names;
  for (const DecisionLine& line : lines) names.insert(line.source);
  return {names.begin(), names.end()};
}

SourceFigures sourceFigures(const std::vector<DecisionLine>& lines, const std::string& source) {
  SourceFigures f{source, 0, 0, std::nullopt};
  SourceFigures::Innovation sum{};
  for (const DecisionLine& line : lines) {
    if (line.source != source) continue;
    ++f.decisions;
    if (!line.accepted) continue;
    ++f.accepted;
    sum.mean_along_m += line.innovation_along_m;
    sum.mean_across_m += line.innovation_across_m;
    sum.mean_nis += line.nis;
    sum.rms_m += std::pow(line.innovation_along_m, 2) + std::pow(line.innovation_across_m, 2);
  }
  if (f.accepted == 0) return f;
  const auto n = static_cast<double>(f.accepted);
  f.innovation = {sum.mean_along_m / n, sum.mean_across_m / n, std::sqrt(sum.rms_m / n), sum.mean_nis / n};
  return f;
}

LatencyFigures latencyFigures(const std::vector<LatencyLine>& lines) {
  std::vector<double> times_ms;
  double sum_ms = 0;
  for (const LatencyLine& line : lines) {
    times_ms.push_back(1e3 * line.scan_to_pose_s);
    sum_ms += times_ms.back();
  }
  return {lines.size(), sum_ms / static_cast<double>(lines.size()), quantile(times_ms, 0.5),
          quantile(times_ms, 0.99), quantile(times_ms, 1)};
}

}  // namespace raceloc
