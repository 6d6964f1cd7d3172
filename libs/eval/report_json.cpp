#include <nlohmann/json.hpp>

#include "eval/report.h"
#include "eval/report_tables.h"

namespace raceloc {

namespace {

using nlohmann::ordered_json;

ordered_json figures(const Statistics& s) {
  return {{"rmse", s.rmse}, {"mean", s.mean}, {"median", s.median}, {"std", s.std}, {"max", s.max}};
}

ordered_json bins(const std::vector<ErrorBin>& list) {
  ordered_json json = ordered_json::array();
  for (const ErrorBin& bin : list) {
    ordered_json figures{{"name", bin.name}, {"poses", bin.poses}};
    if (bin.poses > 0)
      figures.update({{"plane_rmse_m", bin.plane_rmse_m},
                      {"lateral_rmse_m", bin.lateral_rmse_m},
                      {"longitudinal_rmse_m", bin.longitudinal_rmse_m},
                      {"height_rmse_m", bin.height_rmse_m},
                      {"heading_rmse_deg", bin.heading_rmse_deg},
                      {"plane_max_m", bin.plane_max_m}});
    json.push_back(figures);
  }
  return json;
}

ordered_json counts(const std::vector<Protected>& epochs) {
  const StanfordCounts c = stanfordCounts(epochs);
  return {{"epochs", c.epochs},
          {"available", c.available},
          {"unavailable", c.unavailable},
          {"misleading", c.misleading},
          {"hazardous", c.hazardous}};
}

void addRun(ordered_json& json, const RunTables& run) {
  if (run.stanford)
    json["integrity"] = {{"states", run.stanford->states},
                         {"lateral", counts(run.stanford->lateral_m)},
                         {"longitudinal", counts(run.stanford->longitudinal_m)},
                         {"heading", counts(run.stanford->heading_deg)}};
  for (const std::string& source : sourcesOf(run.decisions)) {
    const SourceFigures f = sourceFigures(run.decisions, source);
    ordered_json figures{{"source", source}, {"decisions", f.decisions}, {"accepted", f.accepted}};
    if (f.innovation) {
      figures["innovation_along_mean_m"] = f.innovation->mean_along_m;
      figures["innovation_across_mean_m"] = f.innovation->mean_across_m;
      figures["innovation_rms_m"] = f.innovation->rms_m;
      figures["nis_mean"] = f.innovation->mean_nis;
    }
    json["gate"].push_back(std::move(figures));
  }
  if (run.latency.empty()) return;
  const LatencyFigures f = latencyFigures(run.latency);
  json["latency"] = {{"sweeps", f.sweeps},
                     {"mean_ms", f.mean_ms},
                     {"p50_ms", f.p50_ms},
                     {"p99_ms", f.p99_ms},
                     {"max_ms", f.max_ms}};
}

}  // namespace

std::string figuresJson(const Evaluation& e, const RunTables& run) {
  const auto input = [](const TrajectoryFile& file) {
    const auto& poses = file.trajectory.poses;
    return ordered_json{{"file", file.path},
                        {"bytes", file.bytes},
                        {"poses", poses.size()},
                        {"start_s", poses.front().stamp_s},
                        {"end_s", poses.back().stamp_s}};
  };
  ordered_json json;
  json["truth"] = input(e.truth);
  json["estimate"] = input(e.estimate);
  json["match"] = {{"poses", e.poses.size()},
                   {"share", e.matchShare()},
                   {"outside_truth", e.outside_truth},
                   {"in_gaps", e.in_gaps},
                   {"covered_truth_s", e.coveredTruth_s()}};
  json["aligned"] = nameOf(e.options.align);
  if (e.options.align == Alignment::axes) {
    const Eigen::Vector3d turn_deg = e.bodyTurn_deg();
    json["body_axes_turned_deg"] = {turn_deg.x(), turn_deg.y(), turn_deg.z()};
  }
  json["path_length_m"] = e.path_length_m;
  json["min_speed_mps"] = e.min_speed_mps;
  json["max_speed_mps"] = e.max_speed_mps;
  for (const ErrorRow& row : kErrorRows) json["errors"][row.key] = figures(e.*row.figures);
  json["rpe"] = ordered_json::array();
  for (const RelativePoseError& r : e.rpe) {
    ordered_json rpe{{r.step.unit == RpeStep::Unit::seconds ? "step_s" : "step_m", r.step.length},
                     {"pairs", r.pairs}};
    if (r.pairs > 0) {
      rpe["translation_m"] = figures(r.translation_m);
      rpe["rotation_deg"] = figures(r.rotation_deg);
    }
    json["rpe"].push_back(rpe);
  }
  json["drift"] = ordered_json::array();
  for (const RelativeError& r : e.relative) {
    ordered_json drift{{"length_m", r.length_m}, {"segments", r.segments}};
    if (r.segments > 0) {
      drift["translation_percent"] = r.translation_percent;
      drift["rotation_deg_per_m"] = r.rotation_deg_per_m;
    }
    json["drift"].push_back(drift);
  }
  json["lap_starts_m"] = e.lap_starts_m;
  json["by_lap"] = bins(e.by_lap);
  json["by_sector"] = bins(e.by_sector);
  json["by_speed"] = bins(e.by_speed);
  addRun(json, run);
  json["warnings"] = e.warnings;
  return json.dump(2, ' ', false, ordered_json::error_handler_t::replace) + "\n";
}

}  // namespace raceloc
