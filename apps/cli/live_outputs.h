/** \file
 * The files of raceloc-live beside the annotated log. */
#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "cli/live_args.h"
#include "core/output_file.h"
#include "core/trajectory.h"
#include "pipeline/run_csv.h"

namespace raceloc {

/** The sweep of --scene: the first in which the guard took over, or else the last. */
class SceneToKeep {
 public:
  explicit SceneToKeep(const std::string& path) : x_file(path) {}
  void see(const LocalizerOutput& output);
  /** \return whether there was one */
  [[nodiscard]] bool write();
  [[nodiscard]] const std::string& path() const { return x_file.path(); }

 private:
  OutputFile x_file;
  std::optional<LocalizerOutput> x_output;
  bool x_is_final = false;
};

/** Trajectory, tables and scene that were asked for, written as a run goes on. What cannot be written is told before
 * the work, not after. */
class LiveOutputs {
 public:
  /** \param origin of the map's frame; none without a map \throws InputError */
  LiveOutputs(const LiveArgs& args, const std::optional<GeodeticPoint>& origin);
  void see(const LocalizerOutput& output);
  void see(const StampedPose& odometry);  ///< of a run without a map: T_odom_body
  /** \param T_map_odom of a run without a map, else identity \return the files that are there now */
  [[nodiscard]] std::vector<std::string> commit(const Pose& T_map_odom);

 private:
  std::optional<TumWriter> x_trajectory;
  bool x_has_poses = false;
  std::optional<PoseSpool> x_odometry;  ///< what turns it level is known at the end
  std::vector<std::unique_ptr<RunCsv>> x_tables;
  std::optional<SceneToKeep> x_scene;
};

}  // namespace raceloc
