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

LiveOutputs::LiveOutputs(const LiveArgs& args) {
  if (!args.trajectory_path.empty()) x_trajectory_probe.emplace(args.trajectory_path);
  if (!args.integrity_path.empty()) x_tables.push_back(std::make_unique<IntegrityCsv>(args.integrity_path));
  if (!args.decisions_path.empty()) x_tables.push_back(std::make_unique<DecisionCsv>(args.decisions_path));
  if (!args.latency_path.empty()) x_tables.push_back(std::make_unique<LatencyCsv>(args.latency_path));
  if (!args.scene_path.empty()) x_scene.emplace(args.scene_path);
}

void LiveOutputs::see(const LocalizerOutput& output) {
  for (const auto& table : x_tables) table->write(output);
  if (x_scene) x_scene->see(output);
}

std::vector<std::string> LiveOutputs::commit(const Trajectory& trajectory) {
  std::vector<std::string> kept;
  for (const auto& table : x_tables) {
    table->commit();
    kept.push_back(table->path());
  }
  if (x_scene && x_scene->write())
    kept.push_back(x_scene->path());
  else if (x_scene)
    std::printf("scene            NONE: no sweep was looked at\n");
  if (x_trajectory_probe && !trajectory.poses.empty()) {
    writeTum(x_trajectory_probe->path(), trajectory);
    kept.push_back(x_trajectory_probe->path());
  }
  return kept;
}

}  // namespace raceloc
