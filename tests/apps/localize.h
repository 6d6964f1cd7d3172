/** \file
 * Localization on a prepared drive, and how far it was from the truth. */
#pragma once

#include <gtest/gtest.h>

#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "apps/apps.h"

namespace raceloc::test {

/** What raceloc-eval says of a run of raceloc-live. */
struct Localized {
  double rmse_m;       ///< position, 3-D
  double match_share;  ///< of the estimate's poses
  double covered_s;    ///< span of the matched poses
  std::string trajectory;
};

/** Runs raceloc-live with `options` behind its usual arguments, and raceloc-eval on what it wrote to `out`.
 */
inline Localized localize(const DriveFiles& drive, const std::string& log, const TemporaryFolder& out,
                          const std::vector<std::string>& options = {}) {
  auto command = liveCommand(ini("live.ini"), drive.map(), log, out);
  command.insert(command.end(), options.begin(), options.end());
  const auto live = runCommand(command);
  EXPECT_EQ(live.exit_code, 0) << live.err;
  const auto eval = runCommand({app("raceloc-eval"), "--truth", drive.truth(), "--estimate", out / "race.tum",
                                "--json", out / "figures.json"});
  EXPECT_EQ(eval.exit_code, 0) << eval.err;
  if (live.exit_code != 0 || eval.exit_code != 0) throw std::runtime_error("no figures");
  const auto figures = nlohmann::json::parse(readFile(out / "figures.json"));
  return {figures.at("errors").at("position_3d_m").at("rmse"), figures.at("match").at("share"),
          figures.at("match").at("covered_truth_s"), readFile(out / "race.tum")};
}

}  // namespace raceloc::test
