/** \file
 * What a localizer says of its own run, in the tables that raceloc-live writes. */
#pragma once

#include <array>
#include <optional>
#include <string>
#include <vector>

#include "eval/pose_errors.h"

namespace raceloc {

/** Of one estimate. */
struct IntegrityLine {
  double stamp_s;
  int state;  ///< 0 ok, 1 degraded, 2 dead reckoning, 3 lost
  double protection_lateral_m, protection_longitudinal_m, protection_heading_deg;
  double alert_limit_m;  ///< lateral
};

/** What the gate held against one source in one decision. */
struct DecisionLine {
  double stamp_s;
  double innovation_along_m, innovation_across_m;  ///< fix less estimate, in the car's axes
  double nis;                                      ///< normalised innovation squared
  bool accepted;
  std::string source;
};

/** Of one sweep. */
struct LatencyLine {
  double stamp_s, scan_to_pose_s;
};

/** \name All \throws InputError as readCsv() does, and for a stamp before the one above it.
 * @{ */
[[nodiscard]] std::vector<IntegrityLine> readIntegrity(const std::string& path);
[[nodiscard]] std::vector<DecisionLine> readDecisions(const std::string& path);
[[nodiscard]] std::vector<LatencyLine> readLatency(const std::string& path);
/** @} */

/** An error beside what the localizer allowed for it. */
struct Protected {
  double error;        ///< without sign
  double protection;   ///< level, in the unit of the error
  double alert_limit;  ///< above it the estimate may not be used; inf where there is no limit
};

/** Epochs by what the localizer said and what was so. Source: Tossaint et al., The Stanford-ESA integrity diagram, ION GNSS
 * 2006. */
struct StanfordCounts {
  std::size_t epochs = 0;
  std::size_t available = 0;    ///< error <= protection <= alert limit
  std::size_t unavailable = 0;  ///< protection > alert limit: said that it is not good enough
  std::size_t misleading = 0;   ///< error > protection
  std::size_t hazardous = 0;    ///< of these: error > alert limit >= protection
};
[[nodiscard]] StanfordCounts stanfordCounts(const std::vector<Protected>& epochs);

/** Errors of the poses beside the protection levels at their stamps. */
struct Stanford {
  std::vector<Protected> lateral_m, longitudinal_m, heading_deg;  ///< alert limits are lateral only
  std::array<std::size_t, 4> states;                              ///< lines in each state, matched or not
};

/** Poses without a line of their stamp (to 0.5 ms) are left out.
 * \throws InputError if none has one: other run, or other clock. \param path  of the lines, for the message */
[[nodiscard]] Stanford stanford(const std::vector<PoseError>& poses, const std::vector<IntegrityLine>& lines,
                                const std::string& path);

/** Names of the sources, in alphabetical order. */
[[nodiscard]] std::vector<std::string> sourcesOf(const std::vector<DecisionLine>& lines);

/** What the gate made of one source. The innovations are those of its accepted fixes. */
struct SourceFigures {
  std::string source;
  std::size_t decisions, accepted;
  struct Innovation {
    double mean_along_m, mean_across_m, rms_m, mean_nis;
  };
  std::optional<Innovation> innovation;  ///< of what was accepted; none if nothing was
};
[[nodiscard]] SourceFigures sourceFigures(const std::vector<DecisionLine>& lines, const std::string& source);

/** p50, p99 and the like [ms]. */
struct LatencyFigures {
  std::size_t sweeps;
  double mean_ms, p50_ms, p99_ms, max_ms;
};
/** \param lines  at least one */
[[nodiscard]] LatencyFigures latencyFigures(const std::vector<LatencyLine>& lines);

/** The tables that a user gave. */
struct RunTables {
  std::optional<Stanford> stanford;
  std::vector<DecisionLine> decisions;  ///< empty: not given
  std::vector<LatencyLine> latency;     ///< empty: not given
};

}  // namespace raceloc
