#include "pipeline/survey_stages.h"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <limits>
#include <utility>

#include "core/errors.h"

namespace raceloc {

namespace {

/** What identifies a log without reading it whole. */
std::string identityOf(const std::string& path) {
  std::error_code unknown;
  const auto size = std::filesystem::file_size(path, unknown);
  const auto written = std::filesystem::last_write_time(path, unknown).time_since_epoch().count();
  return std::filesystem::path(path).filename().string() + " " + std::to_string(size) + " " +
         std::to_string(written);
}

std::string nameOfScan(std::size_t survey, std::size_t key) {
  return "survey " + std::to_string(survey) + ", scan " + std::to_string(key);
}

/** Of what surveyOf() makes and how it is kept: another one's results are not taken. */
constexpr char kSurveyFormat[] = "1";

/** Stage: names of the logs whose surveys are kept. */
constexpr char kReadLogs[] = "logs";

/** \throws InputError if a run before read a log that is not named now: it would be lost. */
void requireAllNamed(const StageStore& store, const std::vector<SurveyLog>& logs) {
  const auto kept = store.get(kReadLogs, "");
  if (!kept) return;
  for (ByteReader in(*kept); in.left() > 0;) {
    const std::string name = in.text();
    if (std::none_of(logs.begin(), logs.end(), [&](const SurveyLog& log) {
          return std::filesystem::path(log.path).filename() == name;
        }))
      throw InputError(
          "rawlog " + name +
          ": was read by the build that is to go on, but is not named now; name it too, or build the "
          "map with --replace");
  }
}

InputError ofAnotherPlace(const SurveyLog& log, double nearest_m) {
  return InputError("rawlog " + log.path + ": of another place, " + std::to_string(std::lround(nearest_m)) +
                    " m from the logs before it; map it alone");
}

}  // namespace

void ScanStore::put(std::size_t survey, const std::string& input, std::size_t key, const Cloud& scan) {
  x_store.put(nameOfScan(survey, key), input, toBytes(scan));
}

void ScanStore::addSurvey(std::size_t survey, const std::string& input, std::size_t keys) {
  for (std::size_t key = 0; key < keys; ++key) x_places.push_back({survey, input, key});
}

Cloud ScanStore::scan(std::size_t key) const {
  const Place& at = x_places.at(key);
  const auto bytes = x_store.get(nameOfScan(at.survey, at.key), at.input);
  if (!bytes)
    throw InputError("scan " + std::to_string(key) +
                     ", kept beside the map in its .build file, is damaged: build the map with --replace");
  return cloudFrom(*bytes);
}

bool holdsSurveys(const StageStore& store) { return store.get(kReadLogs, "").has_value(); }

SurveyedDrives surveyLogs(const std::vector<SurveyLog>& logs, StageStore& store, ScanStore& scans,
                          const MapperOptions& options, const std::string& tool_version,
                          const StageProgress& progress) {
  SurveyedDrives drives;
  requireAllNamed(store, logs);
  Bytes read;
  for (std::size_t n = 0; n < logs.size(); ++n) {
    const std::string stage = "survey " + std::to_string(n);
    Bytes origin;
    if (drives.origin)
      for (const double number :
           {drives.origin->latitude_deg, drives.origin->longitude_deg, drives.origin->height_m})
        append(origin, number);
    const std::string input = inputHash({tool_version,
                                         kSurveyFormat,
                                         identityOf(logs[n].path),
                                         options.resultText(),
                                         {origin.begin(), origin.end()}});
    const std::string title = logs.size() == 1
                                  ? "odometry"
                                  : "odometry " + std::to_string(n + 1) + "/" + std::to_string(logs.size());
    Survey found;
    if (const auto kept = store.get(stage, input)) {
      found = surveyFrom(*kept);
      found.kept = true;
    } else {
      found = surveyOf(
          logs[n], drives.origin, options,
          [&](std::size_t key, const Cloud& scan) { scans.put(n, input, key, scan); },
          [&](double share) { progress(title, share); });
      store.put(stage, input, toBytes(found));
    }
    if (logs.size() > 1 && !found.origin)
      throw InputError("rawlog " + logs[n].path +
                       ": no GPS, so where it belongs among the other logs is not known; map it alone");
    if (!drives.origin) drives.origin = found.origin;
    append(read, found.session);
    store.put(kReadLogs, "", read);
    scans.addSurvey(n, input, found.keyframes.size());
    drives.session_of.insert(drives.session_of.end(), found.keyframes.size(), static_cast<int>(n));
    for (auto& k : found.keyframes) {
      drives.keyframes.push_back(std::move(k));
    }
    found.keyframes.clear();
    drives.surveys.push_back(std::move(found));
  }
  return drives;
}

void requireOnePlace(const SurveyedDrives& drives, const std::vector<Pose>& T_map_body,
                     const std::vector<SurveyLog>& logs) {
  constexpr double kNear_m = 200;
  for (std::size_t key = 0; key < T_map_body.size();) {
    const int session = drives.session_of[key];
    const std::size_t begin = key;
    bool near = session == 0;
    double nearest_m = std::numeric_limits<double>::max();
    for (; key < T_map_body.size() && drives.session_of[key] == session; ++key)
      for (std::size_t other = 0; other < begin && !near; ++other) {
        nearest_m =
            std::min(nearest_m, (T_map_body[key].translation() - T_map_body[other].translation()).norm());
        near = nearest_m < kNear_m;
      }
    if (!near) throw ofAnotherPlace(logs[static_cast<std::size_t>(session)], nearest_m);
  }
}

void requireNearFixes(const std::vector<SurveyLog>& logs) {
  constexpr double kFar_m = 1000;  // a drive may go on so far without fixes
  for (std::size_t n = 1; n < logs.size(); ++n) {
    const auto& fixes_m = logs[n].summary.fixes_earth_m;
    double nearest_m = std::numeric_limits<double>::max();
    for (std::size_t before = 0; before < n; ++before) {
      const auto& others_m = logs[before].summary.fixes_earth_m;
      if (fixes_m.isEmpty() || others_m.isEmpty()) return;  // told with the odometry
      nearest_m = std::min(nearest_m, fixes_m.exteriorDistance(others_m));
    }
    if (nearest_m > kFar_m) throw ofAnotherPlace(logs[n], nearest_m);
  }
}

}  // namespace raceloc
