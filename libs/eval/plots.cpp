#include "eval/plots.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "eval/curves.h"
#include "eval/format.h"

namespace raceloc {

namespace {

std::string curveOverTime(const std::vector<PoseError>& poses, double PoseError::*error) {
  std::vector<double> y;
  y.reserve(poses.size());
  for (const auto& pose : poses) y.push_back(pose.*error);
  const std::vector<int> stretch = stretchesOf(poses);
  std::string text;
  std::size_t before = 0;
  for (const std::size_t i : extremes(y)) {
    if (stretch[i] != stretch[before]) text += "\n";
    text += number(poses[i].stamp_s - poses.front().stamp_s) + " " + number(y[i]) + "\n";
    before = i;
  }
  return text;
}

}  // namespace

Picture trajectoryPicture(const Evaluation& evaluation) {
  const auto& truth = evaluation.truth.trajectory.poses;
  const auto& poses = evaluation.poses;
  Eigen::AlignedBox2d box;
  std::string script = "$truth << EOD\n";
  const std::vector<int> truth_stretch = stretches(truth.size(), [&](std::size_t i) {
    return truth[i].stamp_s - truth[i - 1].stamp_s > evaluation.options.max_gap_s;
  });
  std::size_t before = 0;
  for (const std::size_t i : thinned(truth.size())) {
    if (truth_stretch[i] != truth_stretch[before]) script += "\n";
    before = i;
    const Eigen::Vector3d p_m = truth[i].T_map_body.translation();
    box.extend(p_m.head<2>());
    script += number(p_m.x()) + " " + number(p_m.y()) + "\n";
  }
  script += "EOD\n$estimate << EOD\n";
  const std::vector<int> stretch = stretchesOf(poses);
  before = 0;
  double largest_m = 0;
  for (const std::size_t i : thinned(poses.size())) {
    const Eigen::Vector3d p_m = poses[i].T_map_estimate.translation();
    box.extend(p_m.head<2>());
    largest_m = std::max(largest_m, poses[i].position_plane_m);
    if (stretch[i] != stretch[before]) script += "\n";
    script += number(p_m.x()) + " " + number(p_m.y()) + " " + number(poses[i].position_plane_m) + "\n";
    before = i;
  }
  const Eigen::Vector3d start_m = truth.front().T_map_body.translation();
  script += "EOD\n$start << EOD\n" + number(start_m.x()) + " " + number(start_m.y()) + "\nEOD\n";

  // Equal axes: the height follows the shape of the track, within what a page can show.
  const Eigen::Vector2d size_m = box.sizes().cwiseMax(1.0);
  const int height_px =
      std::clamp(static_cast<int>(kPicture_px * 0.8 * size_m.y() / size_m.x()) + 120, 320, 900);
  const Eigen::Vector2d margin_m = Eigen::Vector2d::Constant(0.05 * size_m.maxCoeff());
  const Eigen::Vector2d low_m = box.min() - margin_m;
  const Eigen::Vector2d high_m = box.max() + margin_m;
  script += "set size ratio -1\nset xrange [" + number(low_m.x()) + ":" + number(high_m.x()) +
            "]\nset yrange [" + number(low_m.y()) + ":" + number(high_m.y()) + "]\n";
  script += std::string("set palette defined (0 '") + kBlue + "', 0.5 '#B07AA1', 1 '" + kVermillion + "')\n" +
            "set cbrange [0:" + number(std::max(largest_m, 1e-3)) + "]\n";
  script +=
      "set xlabel 'x [m]'\nset ylabel 'y [m]'\nset cblabel 'error in the plane [m]'\n"
      "set key outside top left horizontal Left reverse samplen 2\n";
  script += std::string("plot $truth using 1:2 with lines lw 6 lc rgb '") + kGrey +
            "' title 'truth', $estimate using 1:2:3 with lines lw 2 lc palette title 'estimate', "
            "$start using 1:2 with points pt 6 ps 1.2 lw 1.5 lc rgb 'black' title 'start'\n";
  return {"trajectory", "Seen from above", height_px, std::move(script)};
}

std::vector<Picture> errorPictures(const Evaluation& evaluation) {
  struct Error {
    const char* name;
    const char* title;
    const char* label;
    double PoseError::*error;
    const char* colour;
  };
  const Error errors[] = {
      {"lateral", "Lateral error over time", "left [m]", &PoseError::lateral_m, kBlue},
      {"longitudinal", "Longitudinal error over time", "ahead [m]", &PoseError::longitudinal_m, kVermillion},
      {"height", "Height error over time", "up [m]", &PoseError::height_m, kGreen},
      {"heading", "Heading error over time", "counter-clockwise [deg]", &PoseError::heading_deg, "black"}};
  std::vector<Picture> pictures;
  for (const Error& error : errors) {
    std::string script = "set xrange [0:" + number(std::max(evaluation.coveredTruth_s(), 1e-3)) +
                         "]\nset yrange [*<-0.01:0.01<*]\nset xzeroaxis lt 1 lc rgb '#606060' lw 0.8\nunset "
                         "key\nset xlabel 'time since the first match [s]'\nset ylabel '" +
                         error.label + "'\nset lmargin 10\n$curve << EOD\n" +
                         curveOverTime(evaluation.poses, error.error) +
                         "EOD\nplot $curve using 1:2 with lines lw 1.2 lc rgb '" + error.colour + "'\n";
    pictures.push_back({error.name, error.title, 240, std::move(script)});
  }
  return pictures;
}

Picture distributionPicture(const Evaluation& evaluation) {
  struct Curve {
    const char* name;
    double PoseError::*error;
    int dash;
    const char* colour;
  };
  const Curve curves[] = {{"in the plane", &PoseError::position_plane_m, 1, "black"},
                          {"lateral", &PoseError::lateral_m, 1, kBlue},
                          {"longitudinal", &PoseError::longitudinal_m, 2, kVermillion},
                          {"height", &PoseError::height_m, 4, kGreen}};
  std::string script;
  std::string plots;
  for (const Curve& curve : curves) {
    std::vector<double> errors_m;
    for (const auto& pose : evaluation.poses) errors_m.push_back(std::abs(pose.*curve.error));
    std::sort(errors_m.begin(), errors_m.end());
    const std::string block = "$curve" + std::to_string(&curve - curves);
    script += block + " << EOD\n" + number(errors_m.front()) + " 0\n";
    for (const std::size_t i : thinned(errors_m.size()))
      script += number(errors_m[i]) + " " +
                number(100 * static_cast<double>(i + 1) / static_cast<double>(errors_m.size())) + "\n";
    script += "EOD\n";
    plots += (plots.empty() ? "plot " : ", ") + block + " using 1:2 with steps lw 1.5 dt " +
             std::to_string(curve.dash) + " lc rgb '" + curve.colour + "' title '" + curve.name + "'";
  }
  script +=
      "set xrange [0:*]\nset yrange [0:100]\nset ytics (0, 25, 50, 75, 95, 100)\n"
      "set xlabel 'size of the error [m]'\nset ylabel 'poses below [%]'\nset key bottom right Left reverse "
      "samplen 3\n";
  return {"distribution", "Share of the poses below an error", 400, script + plots + "\n"};
}

}  // namespace raceloc
