/** \file
 * The four apps, and the files that the fixtures of tests/apps/CMakeLists.txt made with them. */
#pragma once

#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "support/files.h"
#include "support/run_command.h"

namespace raceloc::test {

/** Path of an app of this build. */
inline std::string app(const std::string& name) { return APPS + name; }
/** Path of a shipped ini file. */
inline std::string ini(const std::string& name) { return INI + name; }

/** For the steps that a test builds on. \throws std::runtime_error with the program's own words if it failed. */
inline CommandResult require(CommandResult run) {
  if (run.exit_code != 0) throw std::runtime_error(run.err);
  return run;
}

/** The logs and the map of one drive. */
struct DriveFiles {
  explicit DriveFiles(const std::string& name) : folder(DATA + name + "/") {}
  std::string folder;
  [[nodiscard]] std::string survey() const { return folder + "survey.rawlog"; }
  [[nodiscard]] std::string race() const { return folder + "race.rawlog"; }
  [[nodiscard]] std::string noisyRace() const { return folder + "race_noisy.rawlog"; }  ///< 10 m on the GPS
  [[nodiscard]] std::string truth() const { return folder + "truth.tum"; }
  [[nodiscard]] std::string map() const { return folder + "map.rlmap"; }
};

/** raceloc-live's command line, writing out.rawlog and race.tum into `out`. */
inline std::vector<std::string> liveCommand(const std::string& ini_path, const std::string& map,
                                            const std::string& log, const TemporaryFolder& out) {
  return {app("raceloc-live"), "-c",           ini_path,        "-m", map, "-i", log, "-o",
          out / "out.rawlog",  "--trajectory", out / "race.tum"};
}
/** raceloc-map's command line, writing map.rlmap into `out`. */
inline std::vector<std::string> mapCommand(const std::string& ini_path, const std::string& log,
                                           const TemporaryFolder& out) {
  return {app("raceloc-map"), "-c", ini_path, "--replace", "-o", out / "map.rlmap", log};
}

}  // namespace raceloc::test
