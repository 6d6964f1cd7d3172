#include "eval/report_tables.h"

namespace raceloc {

namespace {

double span_s(const Trajectory& trajectory) {
  return trajectory.poses.back().stamp_s - trajectory.poses.front().stamp_s;
}

/** "144 poses, 14.8 s, 9.7 Hz" */
std::string size(const Trajectory& trajectory) {
  const double duration_s = span_s(trajectory);
  std::string text = format("%zu poses, %.1f s", trajectory.poses.size(), duration_s);
  if (duration_s > 0)
    text += format(", %.1f Hz", static_cast<double>(trajectory.poses.size() - 1) / duration_s);
  return text;
}

std::string matchedText(const Evaluation& e) {
  std::string text =
      format("%zu of %zu estimate poses (%.1f %%), from first to last %.1f of %.1f s of the truth",
             e.poses.size(), e.estimate.trajectory.poses.size(), 100 * e.matchShare(), e.coveredTruth_s(),
             span_s(e.truth.trajectory));
  if (e.outside_truth > 0) text += format("; %zu before or after it", e.outside_truth);
  if (e.in_gaps > 0) text += format("; %zu in its gaps wider than %g s", e.in_gaps, e.options.max_gap_s);
  return text;
}

std::string pathText(const Evaluation& e) {
  std::string text = format("%.1f m at %.1f .. %.1f m/s (%.0f .. %.0f km/h)", e.path_length_m,
                            e.min_speed_mps, e.max_speed_mps, 3.6 * e.min_speed_mps, 3.6 * e.max_speed_mps);
  if (e.lap_starts_m.size() > 1)
    text += format("; full laps: %zu, of %.0f m", e.lap_starts_m.size() - 1,
                   lapLength_m(e.poses, e.lap_starts_m));
  return text;
}

std::string alignedText(const Evaluation& e) {
  if (e.options.align == Alignment::none) return "not: both are taken to be in one map frame";
  const Eigen::Vector3d t_m = e.T_map_estimate_frame.translation();
  std::string text =
      format("rigidly: estimate moved by x %.3f y %.3f z %.3f m, turned by %.3f deg", t_m.x(), t_m.y(),
             t_m.z(), Eigen::AngleAxisd(e.T_map_estimate_frame.linear()).angle() / kDegree);
  if (e.options.align == Alignment::axes) {
    const Eigen::Vector3d turn_deg = e.bodyTurn_deg();
    text += format("; its body axes by the rotation vector %.3f %.3f %.3f deg", turn_deg.x(), turn_deg.y(),
                   turn_deg.z());
  }
  return text;
}

std::vector<std::string> figureCells(const std::string& name, const Statistics& s,
                                     const char* pattern = "%.3f") {
  return {name,
          format(pattern, s.rmse),
          format(pattern, s.mean),
          format(pattern, s.median),
          format(pattern, s.std),
          format(pattern, s.max)};
}

Table rpeTable(const Evaluation& e) {
  Table table{"Relative pose errors",
              {"RPE over", "rmse", "mean", "median", "std", "max", "pairs"},
              {},
              "of steps that follow one another; [m] and [deg] of the motion over a step"};
  for (const RelativePoseError& rpe : e.rpe) {
    const std::string step = text(rpe.step);
    if (rpe.pairs == 0) {
      table.rows.push_back({step, "the path is too short"});
      continue;
    }
    for (const auto& [unit, figures] : {std::pair{" [m]", rpe.translation_m}, {" [deg]", rpe.rotation_deg}}) {
      table.rows.push_back(figureCells(step + unit, figures, "%.4f"));
      table.rows.back().push_back(std::to_string(rpe.pairs));
    }
  }
  return table;
}

Table driftTable(const Evaluation& e) {
  Table table{"Drift", {"drift over", "segments", "translation [%]", "rotation [deg/m]"}, {}, ""};
  for (const RelativeError& r : e.relative) {
    const std::string length = format("%g m", r.length_m);
    if (r.segments > 0)
      table.rows.push_back({length, std::to_string(r.segments), format("%.3f", r.translation_percent),
                            format("%.4f", r.rotation_deg_per_m)});
    else
      table.rows.push_back({length, "0", "the path is too short"});
  }
  return table;
}

Table binTable(const std::string& title, const std::string& name, const std::vector<ErrorBin>& bins,
               const std::string& note) {
  Table table{title,
              {name, "poses", "plane [m]", "lateral", "longit.", "height", "heading [deg]", "plane max"},
              {},
              note};
  for (const ErrorBin& bin : bins) {
    table.rows.push_back({bin.name, std::to_string(bin.poses)});
    if (bin.poses == 0) continue;
    for (const double value : {bin.plane_rmse_m, bin.lateral_rmse_m, bin.longitudinal_rmse_m,
                               bin.height_rmse_m, bin.heading_rmse_deg, bin.plane_max_m})
      table.rows.back().push_back(format("%.3f", value));
  }
  return table;
}

Table integrityTable(const Stanford& stanford) {
  const auto& [ok, degraded, dead_reckoning, lost] = stanford.states;
  Table table{
      "Integrity",
      {"integrity", "estimates", "available", "unavailable", "misleading", "hazardous"},
      {},
      "available: error <= protection level <= alert limit; unavailable: level above the limit; misleading: "
      "error above the level, hazardous if above the limit too; " +
          format("states: ok %zu, degraded %zu, dead reckoning %zu, lost %zu", ok, degraded, dead_reckoning,
                 lost)};
  const std::pair<const char*, const std::vector<Protected>*> directions[] = {
      {"lateral", &stanford.lateral_m},
      {"longitudinal", &stanford.longitudinal_m},
      {"heading", &stanford.heading_deg}};
  for (const auto& [name, epochs] : directions) {
    const StanfordCounts c = stanfordCounts(*epochs);
    table.rows.push_back({name, std::to_string(c.epochs), std::to_string(c.available),
                          std::to_string(c.unavailable), std::to_string(c.misleading),
                          std::to_string(c.hazardous)});
  }
  return table;
}

Table gateTable(const std::vector<DecisionLine>& lines) {
  Table table{
      "Gate",
      {"gate", "decisions", "accepted", "[%]", "along [m]", "across [m]", "rms [m]", "NIS"},
      {},
      "means and rms of the innovations of accepted fixes; NIS 2 in the mean when a source is as good as it "
      "claims"};
  for (const std::string& source : sourcesOf(lines)) {
    const SourceFigures f = sourceFigures(lines, source);
    std::vector<std::string> row{
        source, std::to_string(f.decisions), std::to_string(f.accepted),
        format("%.1f", 100 * static_cast<double>(f.accepted) / static_cast<double>(f.decisions))};
    if (f.innovation) {
      const auto& [along_m, across_m, rms_m, nis] = *f.innovation;
      row.insert(row.end(), {format("%.3f", along_m), format("%.3f", across_m), format("%.3f", rms_m),
                             format("%.2f", nis)});
    } else {
      row.insert(row.end(), 4, "-");
    }
    table.rows.push_back(std::move(row));
  }
  return table;
}

}  // namespace

std::vector<std::pair<std::string, std::string>> summaryOf(const Evaluation& e) {
  return {{"truth", e.truth.path + ": " + size(e.truth.trajectory)},
          {"estimate", e.estimate.path + ": " + size(e.estimate.trajectory)},
          {"matched", matchedText(e)},
          {"path", pathText(e)},
          {"aligned", alignedText(e)}};
}

std::vector<Table> tablesOf(const Evaluation& e) {
  Table errors{"Errors at the stamps of the estimate",
               {"error", "rmse", "mean", "median", "std", "max"},
               {},
               kErrorSigns};
  for (const ErrorRow& row : kErrorRows) errors.rows.push_back(figureCells(row.name, e.*row.figures));
  std::vector<Table> tables{errors};
  if (!e.rpe.empty()) tables.push_back(rpeTable(e));
  if (!e.relative.empty()) tables.push_back(driftTable(e));
  const bool has_laps = e.lap_starts_m.size() > 1;
  if (has_laps)
    tables.push_back(binTable("Errors by lap", "by lap (rmse)", e.by_lap, "the last one is not whole"));
  tables.push_back(binTable("Errors by sector", "by sector (rmse)", e.by_sector,
                            has_laps
                                ? "equal parts of the lap, over all laps"
                                : "equal parts of the way: the drive comes by its start no second time"));
  tables.push_back(binTable("Errors by speed", "by speed (rmse)", e.by_speed, ""));
  return tables;
}

std::vector<Table> tablesOf(const RunTables& run) {
  std::vector<Table> tables;
  if (run.stanford) tables.push_back(integrityTable(*run.stanford));
  if (!run.decisions.empty()) tables.push_back(gateTable(run.decisions));
  if (!run.latency.empty()) {
    const LatencyFigures f = latencyFigures(run.latency);
    tables.push_back({"Latency",
                      {"latency [ms]", "sweeps", "mean", "p50", "p99", "max"},
                      {{"scan to pose", std::to_string(f.sweeps), format("%.2f", f.mean_ms),
                        format("%.2f", f.p50_ms), format("%.2f", f.p99_ms), format("%.2f", f.max_ms)}},
                      ""});
  }
  return tables;
}

}  // namespace raceloc
