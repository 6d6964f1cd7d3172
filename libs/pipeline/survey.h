/** \file
 * The first stage of mapping: what one log says, at its key poses. */
#pragma once

#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "core/trajectory.h"
#include "graph/map_graphs.h"
#include "map/bytes.h"
#include "map/static_points.h"
#include "pipeline/matching_options.h"
#include "pipeline/qa_options.h"
#include "track/driven_line.h"
#include "track/track_id.h"

namespace raceloc {

/** Section [map]. */
struct MapOptions {
  double point_spacing_m = 0.2;
  double covariance_radius_m = 0.6;
  double tile_size_m = 32;
  double keyframe_distance_m = 1.0;
  double keyframe_angle_deg = 5.0;
  double gps_max_gap_s = 0.5;
  bool write_simplemap = true;
  bool write_scene = true;
  void describe(OptionList& keys);
};

struct MapperOptions {
  MatchingOptions matching;
  GraphOptions graph;
  TrackIdOptions track_id;
  FirstLapOptions first_lap;
  LoopOptions loops;
  StaticOptions static_points;
  MapOptions map;
  QaOptions qa;
  /** \throws InputError as IniFile does. */
  static MapperOptions fromIni(const std::string& path);
  [[nodiscard]] std::string iniText() const;  ///< every section with its values
  /** The same of what a map depends on, which is what it keeps: threads change no bit of it. */
  [[nodiscard]] std::string resultText() const;
};

/** One drive. Key poses begin with one whose motion has no duration. */
struct Survey {
  std::string session;  ///< name of the log's file
  std::optional<GeodeticPoint> origin;
  double recorded_s;
  Eigen::Vector3d p_body_eyes_m;  ///< the middle of the LiDARs: key scans are theirs together
  std::vector<Keyframe> keyframes;
  Trajectory odometry;  ///< all scans, first pose at the origin of its own frame
  OdometryTally tally;
  double match_residual_m, match_inlier_share;  ///< medians over the trusted scans
  std::size_t dropped_late;
  std::string device_reason;
  bool kept = false;  ///< not made from the log now, but by a run before
};

/** A log that can be surveyed. */
struct SurveyLog {
  std::string path;
  LogSummary summary;
};
/** Reads it whole.
 * \param progress  is told the share that is done, 0..1
 * \throws InputError for a log that cannot be read, has no LiDAR of the configured labels, a device on
 * another clock, or a pattern that matches no device. */
[[nodiscard]] SurveyLog usableLog(const std::string& path, const LogOptions& options,
                                  const std::function<void(double)>& progress);

/** One pass over a log: odometry, key poses, what the receivers and the accelerometer said there.
 * \param origin  of the map frame, given by an earlier log; else the log's own first fix
 * \param keep    takes the scan of each key pose (its number in this drive; body frame, de-skewed, thinned to half of
 * the
 *                map's spacing): scans are not kept in memory
 * \throws InputError for fewer than two key poses, or fixes that can be interpolated at no key pose. */
[[nodiscard]] Survey surveyOf(const SurveyLog& log, const std::optional<GeodeticPoint>& origin,
                              const MapperOptions& options,
                              const std::function<void(std::size_t key, const Cloud& scan)>& keep,
                              const std::function<void(double share)>& progress);

/** \name For the stages of a build that goes on later. \throws std::out_of_range if the bytes are no such thing @{ */
[[nodiscard]] Bytes toBytes(const Survey& survey);
[[nodiscard]] Survey surveyFrom(const Bytes& bytes);
[[nodiscard]] Bytes toBytes(const Cloud& cloud);
[[nodiscard]] Cloud cloudFrom(const Bytes& bytes);
/** @} */

}  // namespace raceloc
