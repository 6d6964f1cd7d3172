#include "pipeline/localizer_options.h"

namespace raceloc {

void LocalizerPolicy::describe(OptionList& keys) {
  keys.add("map_radius_m", map_radius_m, above(0), "tiles within this distance of the car are held [m]");
  keys.add("output_period_s", output_period_s, above(0),
           "an estimate comes with each message of the car's own motion, or so long after the last [s]");
  keys.add("match_delay_s", match_delay_s, between(0, 0.1),
           "an estimate hears of a scan match so long after its sweep came, so that replays give the same "
           "bits: what a match "
           "takes on this computer, most of the time [s]");
  keys.add("max_fix_age_s", max_fix_age_s, above(0), "older fixes do not tell where to look for the car [s]");
  keys.add("min_course_speed_mps", min_course_speed_mps, above(0), "slower, two fixes give no course [m/s]");
  keys.add("course_sigma_deg", course_sigma_deg, above(0), "error of the course between two fixes [deg]");
  keys.add("gps_min_sigma_m", gps_min_sigma_m, above(0),
           "no fix is believed to be better than this per axis [m]");
  keys.add("start_patience_s", start_patience_s, above(0),
           "without a scan match near a fix for this long, the fix starts the filter alone [s]");
  keys.add("search_after", search_after, atLeast(1),
           "after so many scan matches in a row that cannot be trusted, the car is looked for around a fix");
  keys.add("line_lookahead_s", line_lookahead_s, between(0.05, 3),
           "a car beside the line it is told (--race-line) comes onto it by at most 1 m in this time [s]");
}

void TrialOptions::describe(OptionList& keys) {
  keys.add("noise_labels", noise_labels,
           "for experiments only: sources whose positions get white noise, e.g. scan_match; empty: none");
  keys.add("noise_m", noise_m, atLeast(0), "its sigma on each axis [m]");
  keys.add("noise_after_s", noise_after_s, atLeast(0), "so long after the start [s]");
  keys.add("noise_seed", noise_seed, atLeast(0), "of the noise");
}

}  // namespace raceloc
