#include "eval/report.h"

#include <cstdio>
#include <nlohmann/json.hpp>
#include <vector>

#include "eval/html.h"
#include "eval/plots.h"

namespace raceloc {

namespace {

struct Row {
  const char* name;  ///< with its unit
  const char* key;
  Statistics Evaluation::*figures;
};
constexpr Row kRows[] = {{"position 3-D [m]", "position_3d_m", &Evaluation::position_3d_m},
                         {"position plane [m]", "position_plane_m", &Evaluation::position_plane_m},
                         {"lateral [m]", "lateral_m", &Evaluation::lateral_m},
                         {"longitudinal [m]", "longitudinal_m", &Evaluation::longitudinal_m},
                         {"height [m]", "height_m", &Evaluation::height_m},
                         {"heading [deg]", "heading_deg", &Evaluation::heading_deg}};
constexpr char kSigns[] =
    "positive: left, ahead, up, counter-clockwise; mean and median keep the sign, max does not";

template <class... Values>
std::string format(const char* pattern, Values... values) {
  char text[256];
  std::snprintf(text, sizeof text, pattern, values...);
  return text;
}

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
  return format("%.1f m at %.1f .. %.1f m/s (%.0f .. %.0f km/h)", e.path_length_m, e.min_speed_mps,
                e.max_speed_mps, 3.6 * e.min_speed_mps, 3.6 * e.max_speed_mps);
}

std::string alignedText(const Evaluation& e) {
  if (e.options.align == Alignment::none) return "not: both are taken to be in one map frame";
  const Eigen::Vector3d t_m = e.T_map_estimate_frame.translation();
  return format("rigidly: estimate moved by x %.3f y %.3f z %.3f m, turned by %.3f deg", t_m.x(), t_m.y(),
                t_m.z(), Eigen::AngleAxisd(e.T_map_estimate_frame.linear()).angle() * 180 / M_PI);
}

std::string htmlInput(const char* role, const TrajectoryFile& file) {
  return htmlRow("td", {role, file.path, size(file.trajectory),
                        format("%.1f kB", static_cast<double>(file.bytes) / 1000)});
}

}  // namespace

std::string textReport(const Evaluation& e) {
  std::string text;
  text += "truth      " + e.truth.path + ": " + size(e.truth.trajectory) + "\n";
  text += "estimate   " + e.estimate.path + ": " + size(e.estimate.trajectory) + "\n";
  text += "matched    " + matchedText(e) + "\n";
  text += "path       " + pathText(e) + "\n";
  text += "aligned    " + alignedText(e) + "\n\n";
  text += format("%-20s %10s %10s %10s %10s %10s\n", "error", "rmse", "mean", "median", "std", "max");
  for (const Row& row : kRows) {
    const Statistics& s = e.*row.figures;
    text += format("%-20s %10.3f %10.3f %10.3f %10.3f %10.3f\n", row.name, s.rmse, s.mean, s.median, s.std,
                   s.max);
  }
  text += std::string("(") + kSigns + ")\n";
  if (!e.relative.empty())
    text +=
        format("\n%-20s %10s %16s %18s\n", "drift over", "segments", "translation [%]", "rotation [deg/m]");
  for (const RelativeError& r : e.relative) {
    if (r.segments > 0) {
      text += format("%-20s %10zu %16.3f %18.4f\n", format("%g m", r.length_m).c_str(), r.segments,
                     r.translation_percent, r.rotation_deg_per_m);
    } else {
      text += format("%-20s %10d   the path is too short\n", format("%g m", r.length_m).c_str(), 0);
    }
  }
  for (const auto& warning : e.warnings) text += "\nwarning: " + warning + "\n";
  return text;
}

std::string htmlReport(const Evaluation& e, const std::string& command) {
  std::string page;
  for (const auto& warning : e.warnings) page += "<p class=\"warning\">" + escaped(warning) + "</p>\n";
  page += "<table class=\"words\">\n" + htmlRow("td", {"matched", matchedText(e)}) +
          htmlRow("td", {"path", pathText(e)}) + htmlRow("td", {"aligned", alignedText(e)}) + "</table>\n";

  page += "<h2>Errors at the stamps of the estimate</h2>\n<table>\n" +
          htmlRow("th", {"", "rmse", "mean", "median", "std", "max"});
  for (const Row& row : kRows) {
    const Statistics& s = e.*row.figures;
    page += htmlRow("td", {row.name, format("%.3f", s.rmse), format("%.3f", s.mean), format("%.3f", s.median),
                           format("%.3f", s.std), format("%.3f", s.max)});
  }
  page += std::string("</table>\n<p class=\"note\">") + kSigns + "</p>\n";

  if (!e.relative.empty()) {
    page += "<h2>Drift</h2>\n<table>\n" +
            htmlRow("th", {"over", "segments", "translation [%]", "rotation [deg/m]"});
    for (const RelativeError& r : e.relative)
      page +=
          r.segments > 0
              ? htmlRow("td", {format("%g m", r.length_m), std::to_string(r.segments),
                               format("%.3f", r.translation_percent), format("%.4f", r.rotation_deg_per_m)})
              : htmlRow("td", {format("%g m", r.length_m), "0", "path too short", ""});
    page += "</table>\n";
  }

  page += "<h2>Seen from above</h2>\n" + inlinedSvg(trajectoryPicture(e));
  page += "<h2>Errors over time</h2>\n" + inlinedSvg(errorPicture(e));
  page += "<h2>Share of the poses below an error</h2>\n" + inlinedSvg(distributionPicture(e));

  page += "<h2>Made from</h2>\n<table class=\"words\">\n" + htmlInput("truth", e.truth) +
          htmlInput("estimate", e.estimate) + "</table>\n<p><code>" + escaped(command) + "</code></p>\n";
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

std::string figuresJson(const Evaluation& e) {
  using nlohmann::ordered_json;
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
  json["aligned"] = e.options.align == Alignment::se3 ? "se3" : "none";
  json["path_length_m"] = e.path_length_m;
  json["min_speed_mps"] = e.min_speed_mps;
  json["max_speed_mps"] = e.max_speed_mps;
  for (const Row& row : kRows) {
    const Statistics& s = e.*row.figures;
    json["errors"][row.key] = {
        {"rmse", s.rmse}, {"mean", s.mean}, {"median", s.median}, {"std", s.std}, {"max", s.max}};
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
  json["warnings"] = e.warnings;
  return json.dump(2, ' ', false, ordered_json::error_handler_t::replace) + "\n";
}

}  // namespace raceloc
