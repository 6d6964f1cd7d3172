#include "eval/report.h"

#include "eval/html.h"
#include "eval/plots.h"
#include "eval/report_tables.h"
#include "eval/run_plots.h"

namespace raceloc {

std::string textReport(const Evaluation& e, const RunTables& run) {
  std::string text;
  for (const auto& [name, words] : summaryOf(e)) text += format("%-10s ", name.c_str()) + words + "\n";
  for (const Table& table : tablesOf(e)) text += "\n" + textTable(table);
  for (const Table& table : tablesOf(run)) text += "\n" + textTable(table);
  for (const auto& warning : e.warnings) text += "\nwarning: " + warning + "\n";
  return text;
}

std::vector<Picture> picturesOf(const Evaluation& e, const RunTables& run) {
  std::vector<Picture> pictures{trajectoryPicture(e)};
  const auto add = [&](std::vector<Picture> more) {
    for (Picture& picture : more) pictures.push_back(std::move(picture));
  };
  add(errorPictures(e));
  add({stationPicture(e), speedPicture(e), distributionPicture(e)});
  if (run.stanford) add(stanfordPictures(*run.stanford));
  if (!run.decisions.empty()) add(decisionPictures(run.decisions, e.poses.front().stamp_s));
  if (!run.latency.empty()) add({latencyPicture(run.latency)});
  add({ggPicture(e)});
  return pictures;
}

std::string htmlReport(const Evaluation& e, const RunTables& run, const std::string& command) {
  std::string page;
  for (const auto& warning : e.warnings) page += "<p class=\"warning\">" + escaped(warning) + "</p>\n";
  page += "<table class=\"words\">\n";
  for (const auto& [name, words] : summaryOf(e)) page += htmlRow("td", {name, words});
  page += "</table>\n";
  for (const Table& table : tablesOf(e)) page += htmlTable(table);
  for (const Table& table : tablesOf(run)) page += htmlTable(table);
  page += htmlPictures(picturesOf(e, run));
  page += "<h2>Made by</h2>\n<p><code>" + escaped(command) + "</code></p>\n";
  return htmlPage("Trajectory errors", page);
}

std::string errorsCsv(const Evaluation& e) {
  std::string text =
      "stamp_s,station_m,speed_mps,truth_x_m,truth_y_m,truth_z_m,estimate_x_m,estimate_y_m,estimate_z_m,"
      "position_3d_m,position_plane_m,lateral_m,longitudinal_m,height_m,heading_deg\n";
  for (const PoseError& p : e.poses) {
    const Eigen::Vector3d truth_m = p.T_map_truth.translation();
    const Eigen::Vector3d estimate_m = p.T_map_estimate.translation();
    text += format("%.6f,%.4f,%.4f,%.4f,%.4f,%.4f,%.4f,%.4f,%.4f", p.stamp_s, p.station_m, p.speed_mps,
                   truth_m.x(), truth_m.y(), truth_m.z(), estimate_m.x(), estimate_m.y(), estimate_m.z());
    text += format(",%.4f,%.4f,%.4f,%.4f,%.4f,%.5f\n", p.position_3d_m, p.position_plane_m, p.lateral_m,
                   p.longitudinal_m, p.height_m, p.heading_deg);
  }
  return text;
}

}  // namespace raceloc
