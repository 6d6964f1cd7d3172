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

/** The scans of all key poses, in the store of a build, to which it keeps a reference. */
class ScanStore {
 public:
  explicit ScanStore(StageStore& store) : x_store(store) {}

  void put(std::size_t survey, const std::string& input, std::size_t key, const Cloud& scan);
  /** Numbers the key poses of a survey behind those of the surveys before: in the order of the logs. */
  void addSurvey(std::size_t survey, const std::string& input, std::size_t keys);
  /** \param key  of all surveys \throws InputError if what the store has is damaged; std::out_of_range for a key of none */
  [[nodiscard]] Cloud scan(std::size_t key) const;

 private:
  struct Place {
    std::size_t survey;
    std::string input;
    std::size_t key;  ///< of the survey
  };
  StageStore& x_store;
  std::vector<Place> x_places;  ///< by key pose of all surveys
};

/** All drives as one row of key poses, in the order of the logs. */
struct SurveyedDrives {
  std::vector<Survey> surveys;  ///< without their key poses
  std::vector<Keyframe> keyframes;
  std::vector<int> session_of;  ///< by key pose
  std::optional<GeodeticPoint> origin;
};

/** Odometry and key poses of each log, made now or by a run before; their scans go into the store.
 * \throws InputError as surveyOf() does, for a log without GPS among several, and for a log in the store that is not among
 * these. */
[[nodiscard]] SurveyedDrives surveyLogs(const std::vector<SurveyLog>& logs, StageStore& store,
                                        ScanStore& scans, const MapperOptions& options,
                                        const std::string& tool_version, const StageProgress& progress);

/** \throws InputError naming a log that was recorded nowhere near those before it. */
void requireOnePlace(const SurveyedDrives& drives, const std::vector<Pose>& T_map_body,
                     const std::vector<SurveyLog>& logs);

/** Before the odometry. \throws InputError for a log whose fixes are all more than 1 km from those of the logs before it; a
 * log without fixes is left to requireOnePlace(). */
void requireNearFixes(const std::vector<SurveyLog>& logs);

}  // namespace raceloc
