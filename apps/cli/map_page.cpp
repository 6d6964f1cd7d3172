#include "cli/map_page.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <functional>
#include <nlohmann/json.hpp>
#include <vector>

#include "cli/map_pictures.h"
#include "core/errors.h"
#include "eval/format.h"
#include "eval/html.h"

namespace raceloc {

namespace {

std::string table(const std::vector<std::string>& head, const std::vector<std::vector<std::string>>& rows,
                  bool words = false) {
  std::string html = words ? "<table class=\"words\">\n" : "<table>\n";
  if (!head.empty()) html += htmlRow("th", head);
  for (const auto& row : rows) html += htmlRow("td", row);
  return html + "</table>\n";
}
std::string note(const std::string& words) { return "<p class=\"note\">" + escaped(words) + "</p>\n"; }
std::string heading(const std::string& words) { return "<h2>" + escaped(words) + "</h2>\n"; }

/** Lines for people, the rest of a long list counted. */
std::string list(const std::vector<std::string>& lines, std::size_t most = 200) {
  std::vector<std::vector<std::string>> rows;
  for (std::size_t i = 0; i < std::min(most, lines.size()); ++i) rows.push_back({lines[i]});
  std::string html = table({}, rows, true);
  if (lines.size() > most) html += note(std::to_string(lines.size() - most) + " more are in the JSON file.");
  return html;
}

std::string stretchText(const std::vector<Stretch>& stretches) {
  std::string words;
  for (const Stretch& s : stretches)
    words += (words.empty() ? "" : ", ") + format("%.0f .. %.0f", s.begin_m, s.end_m);
  return words.empty() ? "none" : words;
}

const char* directionOf(char axis) { return axis == 'x' ? "along" : axis == 'y' ? "across" : "up"; }

std::string checksTable(const QaResult& qa) {
  std::vector<std::vector<std::string>> rows;
  for (const QaCheck& check : qa.checks) rows.push_back({check.passed() ? "pass" : "FAIL", text(check)});
  return table({}, rows, true);
}

std::string receiversTable(const QaResult& qa) {
  std::vector<std::vector<std::string>> rows;
  for (const ReceiverQa& r : qa.receivers)
    rows.push_back(
        {r.receiver, std::to_string(r.fixes), std::to_string(r.refused), format("%.3f", r.rmse_m)});
  return table({"receiver", "fixes", "refused", "rmse of the others [m]"}, rows);
}

std::string calibrationTable(const QaResult& qa) {
  std::vector<std::vector<std::string>> rows;
  for (const ReceiverQa& r : qa.receivers) {
    for (std::size_t i = 0; i < 3; ++i)
      rows.push_back({r.receiver, std::string("lever arm ") + "xyz"[i], format("%+.3f m", r.lever_m[i].value),
                      format("%.3f m", r.lever_m[i].sigma),
                      r.lever_m[i].observable ? "yes" : "not observable"});
    rows.push_back({r.receiver, "stamps", format("%+.4f s", r.time_offset_s.value),
                    format("%.4f s", r.time_offset_s.sigma),
                    r.time_offset_s.observable ? "yes" : "not observable"});
  }
  return table({"receiver", "what", "to be added", "sigma", "observable"}, rows);
}

std::string sessionsTable(const MapReport& report) {
  std::vector<std::vector<std::string>> rows;
  for (const SessionReport& s : report.sessions)
    rows.push_back({s.session, format("%.1f", s.recorded_s), std::to_string(s.key_poses),
                    format("%zu of %zu", s.odometry.trusted, s.odometry.scans),
                    format("%.3f", s.match_residual_m), format("%.2f", s.match_inlier_share)});
  return table({"drive", "recorded [s]", "key poses", "trusted scans", "match residual [m]", "inlier share"},
               rows);
}

/** Figures to a tenth of a millimetre: further digits are noise. */
double rounded(double value) { return std::round(1e4 * value) / 1e4; }

}  // namespace

std::string qaPage(const std::string& title, const BuiltMap& built, const QaResult& qa,
                   const QaOptions& options) {
  const MapReport& report = built.report;
  const MapInfo& info = built.content.info;
  const auto picture = [&](const std::function<std::string()>& draw) -> std::string {
    try {
      return inlinedSvg(draw());
    } catch (const std::exception& failed) {  // the figures are worth having without the picture
      return "<p class=\"warning\">" + escaped(failed.what()) + "</p>\n";
    }
  };
  std::string body = "<p class=\"" + std::string(qa.passed() ? "pass" : "warning") + "\"><b>" +
                     escaped(verdict(qa)) + "</b></p>\n" + checksTable(qa);

  body += heading("Seen from above") + picture([&] { return mapPicture(built); }) +
          note(info.origin ? format("Origin %.7f %.7f deg, %.2f m. ", info.origin->latitude_deg,
                                    info.origin->longitude_deg, info.origin->height_m) +
                                 "Grey: points of the map, darker where more are above each other."
                           : "No georeference: the frame is that of the first pose.");

  body += heading("GNSS against the map");
  if (qa.fixes.empty()) {
    body += note("No fixes.");
  } else {
    body += receiversTable(qa) + picture([&] { return fixPicture(qa); }) + heading("GNSS refused or poor");
    std::vector<std::string> spans;
    for (const GpsSpan& span : report.gps_spans)
      spans.push_back((span.refused ? "refused: " : "poor: ") + text(span, report.first_s));
    body += spans.empty() ? note("None.") : list(spans);
    body +=
        heading("Lever arms and stamps") + calibrationTable(qa) +
        note(
            format("What the residuals of believed fixes ask to be added to lever arm and stamp. Observable: "
                   "sigma within %.3f m, %.4f s.",
                   options.max_lever_sigma_m, options.max_time_sigma_s) +
            " A lever arm shows where the car turns, stamps where its speed changes. What both receivers "
            "share, the pose graph has taken up for the most part: it does not show here.");
  }

  body += heading("Loops");
  if (report.loops.empty() && report.refused_loops.empty()) {
    body += note("None.");
  } else {
    body += picture([&] { return loopPicture(qa, report, options.degenerate_loop_sigma_m); }) +
            note(format("%zu kept, %.3f m off the map (median), %zu refused. A degenerate one has a sigma "
                        "above %g m in its "
                        "weakest direction: it may be as far off that way, and has no say there.",
                        report.loops.size(), report.loop_residual_m, report.refused_loops.size(),
                        options.degenerate_loop_sigma_m));
    body += heading("Repeated structure") +
            note(format("%zu kept loops fit elsewhere too, and their neighbours decided; %zu were refused as "
                        "ambiguous.",
                        qa.loops_with_rivals, qa.loops_ambiguous));
    if (!report.refused_loops.empty()) {
      std::vector<std::string> refused;
      for (std::size_t i = 0; i < report.refused_loops.size(); ++i)
        refused.push_back((qa.refused_loops_at_m[i] ? format("%.0f m: ", *qa.refused_loops_at_m[i]) : "") +
                          text(report.refused_loops[i]));
      body += heading("Refused loops") + list(refused);
    }
  }

  body += heading("Walls") +
          (report.walls.cells > 0
               ? note(format("Standard deviation across the wall %.3f m median, %.3f m p90, over %zu pieces.",
                             report.walls.median_m, report.walls.p90_m, report.walls.cells))
               : note("No piece of wall has enough points to be measured."));

  body += heading("Overlap and gaps") + picture([&] { return coveragePicture(qa); });
  std::vector<std::vector<std::string>> gaps{
      {format("passes below %d", options.min_passes), stretchText(qa.unpassed)},
      {"no believed fix on any pass", stretchText(qa.without_fix)}};
  if (qa.on_lap) {
    gaps.push_back({"no road", stretchText(qa.without_road)});
    gaps.push_back({"no wall", stretchText(qa.without_wall)});
  }
  body += table({"", "stations [m]"}, gaps, true);

  body +=
      heading("Degenerate stretches") +
      picture([&] { return sigmaPicture(qa, options.degenerate_sigma_m); }) +
      table({"", "stations [m]"},
            {{format("odometry above %g m", options.degenerate_sigma_m), stretchText(qa.degenerate)},
             {format("loops above %g m", options.degenerate_loop_sigma_m), stretchText(qa.degenerate_loops)}},
            true);

  body += heading("Scans used as they are") +
          (qa.taken_as_they_are.empty() ? note("None.") : list(qa.taken_as_they_are)) + heading("Degraded") +
          (qa.degraded.empty() ? note("Nothing.") : list(qa.degraded));

  body +=
      heading("Made from") + sessionsTable(report) +
      note(format("%zu key poses, %zu points in %zu tiles; ", report.key_poses, report.points, report.tiles) +
           (info.origin ? format("LiDAR graph on GPS graph %.3f m rmse, refined %.3f m; ",
                                 report.aligned_rmse_m, report.refined_rmse_m)
                        : "") +
           format("cost %.4g; made by raceloc ", report.cost) + info.tool_version);
  return htmlPage("Map " + title, body);
}

std::string qaJson(const BuiltMap& built, const QaResult& qa) {
  using nlohmann::ordered_json;
  const MapReport& r = built.report;
  const auto place = [](const std::optional<double>& station_m) {
    return station_m ? ordered_json(rounded(*station_m)) : ordered_json();
  };
  const auto estimate = [](const Estimate& e, const char* unit) {
    const std::string suffix = unit;
    return ordered_json{{"value_" + suffix, std::round(1e6 * e.value) / 1e6},
                        {"sigma_" + suffix, std::round(1e6 * e.sigma) / 1e6},
                        {"observable", e.observable}};
  };
  const auto weakest = [](const Weakest& w) {
    return ordered_json{{"weakest_sigma_m", rounded(w.sigma_m)},
                        {"along_sigma_m", rounded(w.along_m)},
                        {"weakest_direction", directionOf(w.axis)}};
  };
  const auto stretches = [](const std::vector<Stretch>& found) {
    ordered_json list = ordered_json::array();
    for (const Stretch& s : found)
      list.push_back({{"begin_m", rounded(s.begin_m)}, {"end_m", rounded(s.end_m)}});
    return list;
  };
  ordered_json json;
  json["passed"] = qa.passed();
  json["verdict"] = verdict(qa);
  json["checks"] = ordered_json::array();
  for (const QaCheck& c : qa.checks)
    json["checks"].push_back({{"name", c.name},
                              {"unit", c.unit},
                              {"value", rounded(c.value)},
                              {"limit", c.limit},
                              {"limit_is", c.at_least ? "least" : "most"},
                              {"passed", c.passed()}});
  json["sessions"] = ordered_json::array();
  for (const SessionReport& s : r.sessions) {
    ordered_json faults = ordered_json::array();
    for (const auto& [fault, times] : s.odometry.faults)
      faults.push_back({{"what", fault}, {"times", times}});
    json["sessions"].push_back({{"session", s.session},
                                {"recorded_s", rounded(s.recorded_s)},
                                {"scans", s.odometry.scans},
                                {"trusted_scans", s.odometry.trusted},
                                {"key_poses", s.key_poses},
                                {"match_residual_m", rounded(s.match_residual_m)},
                                {"match_inlier_share", rounded(s.match_inlier_share)},
                                {"restarts", s.odometry.restarts},
                                {"dropped_samples", s.dropped_late},
                                {"faults", faults}});
  }
  json["graph"] = {{"key_poses", r.key_poses},
                   {"fixes", r.gps_fixes},
                   {"attitudes", r.attitudes},
                   {"converged", r.converged},
                   {"cost", r.cost},
                   {"aligned_rmse_m", rounded(r.aligned_rmse_m)},
                   {"aligned_share", rounded(r.aligned_share)},
                   {"refined_rmse_m", rounded(r.refined_rmse_m)},
                   {"gps_rmse_m", rounded(r.gps_rmse_m)}};
  json["map"] = {{"points", r.points},
                 {"tiles", r.tiles},
                 {"lap_m", rounded(r.lap_m)},
                 {"laps_begun", r.laps},
                 {"wall_thickness_median_m", rounded(r.walls.median_m)},
                 {"wall_thickness_p90_m", rounded(r.walls.p90_m)},
                 {"wall_pieces", r.walls.cells}};
  json["receivers"] = ordered_json::array();
  for (std::size_t n = 0; n < qa.receivers.size(); ++n) {
    const ReceiverQa& receiver = qa.receivers[n];
    ordered_json key = ordered_json::array(), station_m = key, off_m = key, refused = key;
    for (const FixResidual& fix : qa.fixes) {
      if (fix.receiver != n) continue;
      key.push_back(fix.key);
      station_m.push_back(place(fix.station_m));
      off_m.push_back(rounded(fix.off_m));
      refused.push_back(fix.refused);
    }
    json["receivers"].push_back(
        {{"receiver", receiver.receiver},
         {"fixes", receiver.fixes},
         {"refused", receiver.refused},
         {"rmse_m", rounded(receiver.rmse_m)},
         {"lever_arm_x", estimate(receiver.lever_m[0], "m")},
         {"lever_arm_y", estimate(receiver.lever_m[1], "m")},
         {"lever_arm_z", estimate(receiver.lever_m[2], "m")},
         {"time_offset", estimate(receiver.time_offset_s, "s")},
         {"residuals",
          {{"key_pose", key}, {"station_m", station_m}, {"off_m", off_m}, {"refused", refused}}}});
  }
  json["gps_spans"] = ordered_json::array();
  for (const GpsSpan& s : r.gps_spans)
    json["gps_spans"].push_back({{"receiver", s.receiver},
                                 {"refused", s.refused},
                                 {"first_key_pose", s.first},
                                 {"last_key_pose", s.last},
                                 {"begin_s", s.begin_s},
                                 {"end_s", s.end_s},
                                 {"fixes", s.fixes},
                                 {"off_m", rounded(s.off_m)},
                                 {"claimed_m", rounded(s.claimed_m)}});
  json["loop_residual_m"] = rounded(r.loop_residual_m);
  json["loops_with_rivals"] = qa.loops_with_rivals;
  json["loops_ambiguous"] = qa.loops_ambiguous;
  json["loops"] = ordered_json::array();
  for (const LoopResidual& loop : qa.loops) {
    ordered_json entry{{"i", loop.i},
                       {"j", loop.j},
                       {"station_m", place(loop.station_m)},
                       {"off_m", rounded(loop.off_m)},
                       {"rivals", loop.rivals}};
    entry.update(weakest(loop.weakest));
    json["loops"].push_back(entry);
  }
  json["refused_loops"] = ordered_json::array();
  for (std::size_t i = 0; i < r.refused_loops.size(); ++i)
    json["refused_loops"].push_back({{"i", r.refused_loops[i].i},
                                     {"j", r.refused_loops[i].j},
                                     {"station_m", place(qa.refused_loops_at_m[i])},
                                     {"why", text(r.refused_loops[i])},
                                     {"residual_m", rounded(r.refused_loops[i].residual_m)},
                                     {"overlap", rounded(r.refused_loops[i].overlap)},
                                     {"off_m", rounded(r.refused_loops[i].off_m)}});
  json["stations_are"] = qa.on_lap ? "along the racing line" : "driven";
  json["road_share"] = rounded(qa.road_share);
  json["wall_share"] = rounded(qa.wall_share);
  json["degenerate_share"] = rounded(qa.degenerate_share);
  json["too_few_passes"] = stretches(qa.unpassed);
  json["without_fix"] = stretches(qa.without_fix);
  json["longest_without_fix_m"] = rounded(qa.longest_without_fix_m);
  json["without_road"] = stretches(qa.without_road);
  json["without_wall"] = stretches(qa.without_wall);
  json["degenerate"] = stretches(qa.degenerate);
  json["degenerate_loops"] = stretches(qa.degenerate_loops);
  json["stations"] = ordered_json::array();
  for (const StationQa& s : qa.stations) {
    ordered_json entry{
        {"station_m", rounded(s.station_m)}, {"passes", s.passes},        {"fix", s.fix}, {"road", s.road},
        {"wall_left", s.wall_left},          {"wall_right", s.wall_right}};
    if (s.odometry) entry.update(weakest(*s.odometry));
    json["stations"].push_back(entry);
  }
  return json.dump(1, ' ', false, ordered_json::error_handler_t::replace) + "\n";
}

}  // namespace raceloc
