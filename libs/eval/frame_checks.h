/** \file
 * Mix-ups of frames, recognised by what they do to the errors. */
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "eval/pose_errors.h"

namespace raceloc {

/** What shows that truth and estimate are hardly in one frame, one sentence each: a constant offset of kilometres, headings that
 * differ by a constant quarter or half turn. */
[[nodiscard]] std::vector<std::string> frameMismatches(const std::vector<PoseError>& poses);

/** The sentence for a truth that does not look where it drives, which makes the split into lateral and longitudinal
 * worthless; none if it does, or hardly moves. */
[[nodiscard]] std::optional<std::string> sidewaysTruth(const std::vector<PoseError>& poses);

}  // namespace raceloc
