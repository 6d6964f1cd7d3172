#include "cli/live_outputs.h"

#include <cstdio>

#include "core/errors.h"
#include "pipeline/sweep_scene.h"

namespace raceloc {

void SceneToKeep::see(const LocalizerOutput& output) {
  if (x_is_final || !output.scan_match || !output.walls) return;
  x_output = output;
  x_is_final = output.walls->guard.state != GuardState::localized;
}

bool SceneToKeep::write() {
  if (!x_output) return false;
  if (!sweepScene(*x_output)->saveToFile(x_file.temporaryPath())) throw cannotWrite(x_file.path());
  x_file.commit();
  return true;
}

LiveOutputs::LiveOutputs(const LiveArgs& args, const std::optional<GeodeticPoint>& origin) {
  if (!args.trajectory_path.empty()) x_trajectory.emplace(args.trajectory_path, origin);
  if (args.odometry_only) x_odometry.emplace(args.trajectory_path);
  if (!args.integrity_path.empty()) x_tables.push_back(std::make_unique<IntegrityCsv>(args.integrity_path));
  if (!args.decisions_path.empty()) x_tables.push_back(std::make_unique<DecisionCsv>(args.decisions_path));
  if (!args.latency_path.empty()) x_tables.push_back(std::make_unique<LatencyCsv>(args.latency_path));
  if (!args.scene_path.empty()) x_scene.emplace(args.scene_path);
}

void LiveOutputs::see(const LocalizerOutput& output) {
  for (const auto& table : x_tables) table->write(output);
  if (x_scene) x_scene->see(output);
  if (!x_trajectory) return;
  x_trajectory->write({output.stamp_s, output.T_map_body});
  x_has_poses = true;
}

void LiveOutputs::see(const StampedPose& odometry) {
  x_odometry->add(odometry);
  x_has_poses = true;
}

std::vector<std::string> LiveOutputs::commit(const Pose& T_map_odom) {
  std::vector<std::string> kept;
  for (const auto& table : x_tables) {
    table->commit();
    kept.push_back(table->path());
  }
  if (x_scene && x_scene->write())
    kept.push_back(x_scene->path());
  else if (x_scene)
    std::printf("scene            NONE: no sweep was looked at\n");
  if (x_trajectory && x_has_poses) {
    if (x_odometry) x_odometry->writeTo(*x_trajectory, T_map_odom);
    x_trajectory->commit();
    kept.push_back(x_trajectory->path());
  }
  return kept;
}

}  // namespace raceloc
