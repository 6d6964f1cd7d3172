#include "pipeline/run_csv.h"

#include <cstdio>
#include <limits>

namespace raceloc {

namespace {

/** A field as RFC 4180 has it: labels may hold commas. */
std::string quoted(const std::string& text) {
  std::string field = "\"";
  for (const char c : text) field += c == '"' ? std::string("\"\"") : std::string(1, c);
  return field + '"';
}

}  // namespace

RunCsv::RunCsv(const std::string& path, const char* columns)
    : x_file(path), x_stream(x_file.temporaryPath()) {
  x_stream << columns << '\n';
}

void RunCsv::commit() {
  x_stream.close();
  if (!x_stream) throw cannotWrite(x_file.path());
  x_file.commit();
}

IntegrityCsv::IntegrityCsv(const std::string& path)
    : RunCsv(path,
             "stamp_s,state,measured,limit,protection_lateral_m,protection_longitudinal_m,"
             "protection_heading_rad,alert_limit_m,var_along_m2,cov_along_across_m2,cov_along_heading_m_rad,"
             "var_across_m2,cov_across_heading_m_rad,var_heading_rad2,cause") {}

void IntegrityCsv::write(const LocalizerOutput& output) {
  const Integrity& i = output.integrity;
  const Matrix6d& C = output.covariance;
  char line[400];
  std::snprintf(line, sizeof line, "%.6f,%d,%.6g,%.6g,%.6g,%.6g,%.6g,%.6g,%.6g,%.6g,%.6g,%.6g,%.6g,%.6g,",
                output.stamp_s, static_cast<int>(i.state), i.measured, i.limit, i.protection.lateral_m,
                i.protection.longitudinal_m, i.protection.heading_rad, i.alert_limit_m, C(3, 3), C(3, 4),
                C(3, 2), C(4, 4), C(4, 2), C(2, 2));
  stream() << line << quoted(i.cause) << '\n';
}

DecisionCsv::DecisionCsv(const std::string& path)
    : RunCsv(path,
             "stamp_s,rule,alarm,reset,innovation_along_m,innovation_across_m,accepted,delta,limit,p_theta,"
             "weight,nis,inflation,confirms,left,source") {}

void DecisionCsv::write(const LocalizerOutput& output) {
  constexpr double kSettled_s = HistoryOptions::kLongestLag_s + 2 * HistoryOptions::kLongestGroup_s;
  for (const auto& made : output.decisions) {
    while (!x_pending.empty() && x_pending.back().begin_s >= made.front().begin_s) x_pending.pop_back();
    x_pending.insert(x_pending.end(), made.begin(), made.end());
  }
  writeBefore(output.stamp_s - kSettled_s);
}

void DecisionCsv::writeBefore(double stamp_s) {
  for (; !x_pending.empty() && x_pending.front().stamp_s < stamp_s; x_pending.pop_front()) {
    const DatedDecision& dated = x_pending.front();
    const GateDecision& decision = dated.decision;
    for (const SourceVerdict& v : decision.sources) {
      char line[300];
      std::snprintf(line, sizeof line, "%.6f,%d,%d,%d,%.6g,%.6g,%d,%.6g,%.6g,%.6g,%.6g,%.6g,%.6g,%d,%d,",
                    dated.stamp_s, static_cast<int>(decision.rule), decision.alarm ? 1 : 0,
                    decision.reset ? 1 : 0, v.innovation_body_m.x(), v.innovation_body_m.y(),
                    v.accepted ? 1 : 0, v.delta, v.limit, v.p_theta, v.weight, v.nis, v.inflation,
                    v.confirms ? 1 : 0, v.left ? 1 : 0);
      stream() << line << quoted(v.source) << '\n';
    }
  }
}

void DecisionCsv::commit() {
  writeBefore(std::numeric_limits<double>::infinity());
  RunCsv::commit();
}

LatencyCsv::LatencyCsv(const std::string& path) : RunCsv(path, "stamp_s,scan_to_pose_s") {}

void LatencyCsv::write(const LocalizerOutput& output) {
  if (!output.scan_match || !output.scan_match->took_s) return;
  char line[64];
  std::snprintf(line, sizeof line, "%.6f,%.6f\n", output.scan_match->stamp_s, *output.scan_match->took_s);
  stream() << line;
}

}  // namespace raceloc
