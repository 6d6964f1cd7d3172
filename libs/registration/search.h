/** \file
 * Registration when the guess is metres off. */
#pragma once

#include "registration/align.h"

namespace raceloc {

/** Section [search]. */
struct SearchOptions {
  double radius_m = 40;
  double step_m = 1.5;
  int finalists = 5;
  int points = 2000;
  void describe(OptionList& keys);
};

/** How well a match fits, to be compared with others of one scan: its inlier share over its residual [1/m]. */
[[nodiscard]] double fitOf(const Registration& match);

/** The best of many matches: guesses on a square grid around `T_target_source_guess` (horizontal shifts up to
 * the radius, attitude and height as guessed) are ranked by how many points fall into occupied voxels; the
 * finalists are aligned, and the trusted one with the smallest residual for its inlier share wins. When none
 * is trusted, the result is not trusted either. Places that look alike (repeated posts) are not told apart:
 * the caller checks against other sources. Source: reading.md section 6, recovery with a search around the
 * GPS/INS pose. */
[[nodiscard]] Registration alignWithSearch(gpu::Context& context, const CovarianceCloud& source,
                                           const gpu::VoxelMap& target, const Pose& T_target_source_guess,
                                           const GicpOptions& options, const SearchOptions& search);

}  // namespace raceloc
