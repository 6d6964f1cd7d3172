/** \file
 * Whether a map may be used: its figures by station, and one verdict with the limits that decided it. */
#pragma once

#include <array>
#include <optional>
#include <string>
#include <vector>

#include "pipeline/mapper.h"
#include "pipeline/qa_options.h"

namespace raceloc {

/** A fix against the map. */
struct FixResidual {
  std::int32_t key;
  std::size_t receiver;             ///< number in QaResult::receivers
  std::optional<double> station_m;  ///< none off the racing line
  double off_m;
  bool refused;
};

struct Estimate {
  double value, sigma;
  bool observable;  ///< sigma is within the limit of QaOptions
};

struct ReceiverQa {
  std::string receiver;
  std::size_t fixes, refused;
  double rmse_m;                    ///< of the fixes that were not refused
  std::array<Estimate, 3> lever_m;  ///< x, y, z: what its lever arm lacks, as the residuals have it
  Estimate time_offset_s;           ///< positive: a fix shows where the antenna is that much later
};

/** Translation of a match in its weakest direction. */
struct Weakest {
  double sigma_m;
  double along_m;  ///< sigma along the car
  char axis;       ///< of the car, nearest to the weakest direction: x, y, z
};

struct LoopResidual {
  std::size_t i, j;
  std::optional<double> station_m;
  double off_m;  ///< from where the map has it
  int rivals;    ///< other places where it fits too
  Weakest weakest;
};

struct StationQa {
  double station_m;
  int passes;
  bool road, wall_left, wall_right;
  bool fix;                         ///< one was believed; on a lap: on some pass
  std::optional<Weakest> odometry;  ///< the weakest match of all passes
};

/** Stations in a row that lack something. */
struct Stretch {
  double begin_m, end_m;
};

/** A figure against its limit. */
struct QaCheck {
  std::string name, unit;
  double value, limit;
  bool at_least;  ///< the limit is a lower one
  [[nodiscard]] bool passed() const { return at_least ? value >= limit : value <= limit; }
};
/** "wall thickness 0.071 m > 0.050 m" */
[[nodiscard]] std::string text(const QaCheck& check);

struct QaResult {
  bool on_lap;       ///< stations are metres of the racing line; false: there is none, they are metres driven
  double spacing_m;  ///< of the stations
  std::vector<StationQa> stations;
  std::vector<FixResidual> fixes;
  std::vector<ReceiverQa> receivers;                      ///< by name
  std::vector<LoopResidual> loops;                        ///< as in the report
  std::vector<std::optional<double>> refused_loops_at_m;  ///< their stations, as in the report
  std::size_t loops_ambiguous;                            ///< refused, for the place repeats itself
  std::size_t loops_with_rivals;                          ///< kept, by their neighbours' word
  std::vector<Stretch> unpassed, without_road, without_wall, degenerate;
  std::vector<Stretch> without_fix;                 ///< those longer than max_gap_m
  double longest_without_fix_m;                     ///< across the start line, too
  std::vector<Stretch> degenerate_loops;            ///< from the first to the last of such loops in a row
  double road_share, wall_share, degenerate_share;  ///< of the stations
  std::vector<QaCheck> checks;
  std::vector<std::string> taken_as_they_are;  ///< scans without good point times: assumed not to be bent
  std::vector<std::string> degraded;           ///< what else the logs lacked, which the figures may not show
  [[nodiscard]] bool passed() const;
};
/** "PASS", or "FAIL: " and each limit that was not kept; then what was assumed and what was degraded. */
[[nodiscard]] std::string verdict(const QaResult& qa);

/** Judges a map by what it holds and by how it was made. A map without a full lap fails as "full laps 0 < 1", one
 * without GPS as "GPS fixes 0 < 1"; limits of what it lacks are left out.
 *
 * Lever arm and stamps of a receiver, by weighted least squares over the fixes that were not refused, to
 * first order:
 *   z - (p + R l) = R dl + v dt + s,   v = velocity of the antenna, by the key poses before and after,
 * where the shift s stands for what the georeference can take up. So dl shows only where the car turns, and dt apart
 * from dl_x only where its speed changes; what the pose graph has bent itself to is not seen. Sigmas begin at 10 m
 * and 1 s and grow with residuals beyond their covariances. */
[[nodiscard]] QaResult qaOf(const MapContent& content, const MapReport& report, const QaOptions& options);

}  // namespace raceloc
