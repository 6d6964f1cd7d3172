/** \file
 * The surveys of all logs as stages of a build, which goes on where it was killed. */
#pragma once

#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "map/stage_store.h"
#include "pipeline/survey.h"

namespace raceloc {

/** A stage of the work, and how far it is (0..1). */
using StageProgress = std::function<void(const std::string& stage, double share)>;

/** Whether a build has kept the survey of a log: something to go on with. */
[[nodiscard]] bool holdsSurveys(const StageStore& store);

/** The scans of all key poses, on the disk. */
class ScanStore {
 public:
  explicit ScanStore(StageStore& store) : x_store(store) {}

  void put(std::size_t survey, const std::string& input, std::size_t key, const Cloud& scan) {
    x_store.put(name(survey, key), input, toBytes(scan));
  }
  void addSurvey(std::size_t survey, const std::string& input, std::size_t keys) {
    for (std::size_t key = 0; key < keys; ++key) x_places.push_back({survey, input, key});
  }
  [[nodiscard]] Cloud scan(std::size_t key) const {
    const Place& at = x_places.at(key);
    const auto bytes = x_store.get(name(at.survey, at.key), at.input);
    if (!bytes)
      throw InputError("scan " + std::to_string(key) +
                       ", kept beside the map in its .build file, is damaged: build the map with --replace");
    return cloudFrom(*bytes);
  }

 private:
  static std::string name(std::size_t survey, std::size_t key) {
    return "survey " + std::to_string(survey) + ", scan " + std::to_string(key);
  }
  struct Place {
    std::size_t survey;
    std::string input;
    std::size_t key;  ///< of the survey
  };
  StageStore& x_store;
  std::vector<Place> x_places;  ///< by key pose of all surveys
};

/** All drives as one row of key poses, in the order of the logs. */
struct Drives {
  std::vector<Survey> surveys;  ///< without their key poses
  std::vector<Keyframe> keyframes;
  std::vector<int> session_of;  ///< by key pose
  std::optional<GeodeticPoint> origin;
};

/** Odometry and key poses of each log, made now or by a run before; their scans go into the store.
 * \throws InputError as surveyOf() does, for a log without GPS among several, and for a log in the store that is not among
 * these. */
[[nodiscard]] Drives survey(const std::vector<SurveyLog>& logs, StageStore& store, ScanStore& scans,
                            const MapperOptions& options, const std::string& tool_version,
                            const StageProgress& progress);

/** \throws InputError naming a log that was recorded nowhere near those before it. */
void requireOnePlace(const Drives& drives, const std::vector<Pose>& T_map_body,
                     const std::vector<SurveyLog>& logs);

/** What is too far apart for requireOnePlace() is told before the odometry, by the fixes alone. */
void requireNearFixes(const std::vector<SurveyLog>& logs);

}  // namespace raceloc
